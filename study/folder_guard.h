// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace nephos {

// Keeps other processes from beginning a sweep in a folder, or from replacing its plan, while it lives; waits for one that
// does. Makes the folder. Throws Error(io).
class FolderGuard {
  public:
    explicit FolderGuard(const std::filesystem::path& folder);

    ~FolderGuard();
    FolderGuard(const FolderGuard&) = delete;
    FolderGuard& operator=(const FolderGuard&) = delete;

    // Throws Error(io) when a process writes a shard of the folder, also this one.
    void require_no_writer() const;

  private:
    std::filesystem::path folder_;
    int file_ = -1;  // descriptor of the file that is locked
};

}  // namespace nephos
