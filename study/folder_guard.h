// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string_view>

#include "core/descriptor.h"

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

// Opens a folder for its identity alone, by which it is known again when its path leads elsewhere. Throws Error(io).
Descriptor identity_of_folder(const std::filesystem::path& folder);

// Throws Error(io) where the path leads no longer to the folder that is held: "... was removed or replaced while WORK".
void require_in_place(const Descriptor& held, const std::filesystem::path& folder, std::string_view work);

}  // namespace nephos
