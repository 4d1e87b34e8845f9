// SPDX-License-Identifier: Apache-2.0
#pragma once

// The folders within that of a run: by links they may lie elsewhere, be one, or be those of other runs, too.

#include <filesystem>
#include <map>
#include <utility>
#include <vector>

#include "core/paths.h"
#include "scenes/format/scene.h"
#include "simulation/folder_lock.h"
#include "simulation/run_folder.h"

namespace nephos {

// Returns the folders in that of a run that it writes to, each once, also those that are not there yet;
// `pictures`: of its frames.
std::vector<std::filesystem::path> parts_of_run(const RunFolder& folder, const Scene& scene,
                                                const SimulationRange& range, bool pictures);

// Throws Error(usage) where the density folders of two layers are one, by links or on a disk for which upper
// and lower case are the same: the frames of one layer would replace those of the other.
void refuse_shared_density_folders(const RunFolder& folder, const Scene& scene);

// Locks on folders, each of which is locked once by whatever path it is reached. They last as long as this
// lives.
class HeldFolders {
  public:
    // `own`: the folder of the run, which `lock` is of.
    HeldFolders(const std::filesystem::path& own, const FolderLock& lock);

    // Locks a folder, and returns whether it was not known before; does nothing where there is none. Throws
    // Error(io) when another run or export writes into it.
    bool hold(const std::filesystem::path& folder);
    // Returns whether a folder is locked, and tries to lock it. False, too, on file systems without locks.
    bool can_hold(const std::filesystem::path& folder);
    // Locks the folders that a run writes to, and keeps where their paths lead. Throws as hold().
    void hold_in_place(const std::vector<std::filesystem::path>& folders);
    // Throws Error(io) where one of these is not there any more, or another folder or a link is in its place:
    // what is written would go where no lock is held. Thread-safe once all are held.
    void require_in_place() const;
    // Removes files, in this order, from known folders: from the folder itself, whatever gets its path meanwhile. Throws Error(io), also
    // where another folder is at the path.
    void remove(const std::vector<std::filesystem::path>& files) const;

  private:
    std::map<FileIdentity, bool> known_;  // whether they are locked
    std::vector<std::pair<std::filesystem::path, FileIdentity>> places_;
    std::vector<FolderLock> locks_;
};

}  // namespace nephos
