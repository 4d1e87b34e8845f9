// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>

namespace nephos {

// Keeps other processes from beginning a sweep in a folder, or from replacing its plan, while it lives; waits for one that
// does, until `stop`: then nothing is kept apart, and is_held() says so. Makes the folder. Throws Error(io).
class FolderGuard {
  public:
    explicit FolderGuard(const std::filesystem::path& folder, const std::function<bool()>& stop = {});

    ~FolderGuard();
    FolderGuard(const FolderGuard&) = delete;
    FolderGuard& operator=(const FolderGuard&) = delete;

    bool is_held() const { return is_held_; }

    // Throws Error(io) when a process writes a shard of the folder, also this one.
    void require_no_writer() const;

  private:
    std::filesystem::path folder_;
    int file_ = -1;  // descriptor of the file that is locked
    bool is_held_ = false;
};

}  // namespace nephos
