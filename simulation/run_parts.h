// SPDX-License-Identifier: Apache-2.0
#pragma once

// The folders within that of a run: by links they may lie elsewhere, be one, or be those of other runs, too.

#include <filesystem>
#include <set>
#include <vector>

#include "core/paths.h"
#include "scenes/format/scene.h"
#include "simulation/folder_lock.h"
#include "simulation/run_folder.h"

namespace nephos {

// Returns the folders in that of a run that it writes to, each once, also those that are not there yet; `frames`, `pictures`:
// whether it has any.
std::vector<std::filesystem::path> parts_of_run(const RunFolder& folder, const Scene& scene, bool frames,
                                                bool pictures);

// Makes the parts. Throws Error(io), and Error(usage) where the density folders of layers are one, by links or on a disk for which
// upper and lower case are the same: the frames of one layer would replace those of another.
void make_parts(const RunFolder& folder, const Scene& scene, bool frames, bool pictures);

// Locks on folders, each of which is locked once by whatever path it is reached. They last as long as this lives.
class HeldFolders {
  public:
    // `own`: a folder whose lock somebody else holds for the same run.
    explicit HeldFolders(const std::filesystem::path& own);

    // Does nothing where there is no folder. Throws Error(io) when another run or export writes into it.
    void hold(const std::filesystem::path& folder);
    bool holds(const std::filesystem::path& folder) const;

  private:
    std::set<FileIdentity> known_;
    std::vector<FolderLock> locks_;
};

}  // namespace nephos
