// SPDX-License-Identifier: Apache-2.0
#pragma once

// One run at a time writes into a folder.

#include <filesystem>

#include "core/descriptor.h"

namespace nephos {

// Holds the folder itself by flock(2) while it lives: no file is left behind, and the lock ends with the
// process however that ends. Programs that only read are not kept out.
class FolderLock {
  public:
    // Makes the folder when it is not there. Throws Error(io) when another run holds it, or it cannot be made
    // or opened.
    explicit FolderLock(const std::filesystem::path& folder);

    // False on a file system that has no locks (some network ones): two runs are then not kept apart.
    bool held() const { return held_; }

  private:
    Descriptor folder_;
    bool held_ = false;
};

}  // namespace nephos
