// SPDX-License-Identifier: Apache-2.0
#pragma once

// Keeps two programs from writing into one folder at once, and finds out when it is removed under them (not installed).

#include <filesystem>
#include <string>

#include "core/descriptor.h"

namespace nephos {

// Holds the folder itself by flock(2) while it lives: no file is left behind, and the lock ends with the
// process however that ends. Programs that only read are not kept out.
class FolderLock {
  public:
    // Makes the folder when it is not there. `work` is what is done in it, "run" or "export", for messages. Throws Error(io)
    // when it is held already, or it cannot be made or opened.
    FolderLock(const std::filesystem::path& folder, std::string work);

    // Returns false on a file system that has no locks (some network ones): two of them are then not kept apart.
    bool held() const { return held_; }

    const std::filesystem::path& path() const { return path_; }
    // Returns the descriptor of the folder, which this keeps open.
    int descriptor() const { return folder_.get(); }

    // Returns true while the folder's path leads to the folder that is held. Who removes or renames it takes the lock
    // along, and another one may begin in a new one of that name.
    bool in_place() const;
    // Throws Error(io) unless in_place().
    void require_in_place() const;

  private:
    std::filesystem::path path_;
    std::string work_;
    Descriptor folder_;
    bool held_ = false;
};

}  // namespace nephos
