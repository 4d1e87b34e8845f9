// SPDX-License-Identifier: Apache-2.0
#pragma once

// The folder that nephos-mpi writes into, and its statistics.csv. For one process of all.

#include <cstdint>
#include <filesystem>
#include <string>

#include "core/descriptor.h"
#include "density/statistics.h"
#include "scenes/format/scene.h"
#include "simulation/folder_lock.h"

namespace nephos {

// Keeps other programs out of the folder while it lives. Not thread-safe.
class StatisticsTable {
  public:
    // Makes the folder and begins the table. Throws Error(usage) when the folder has a table, levels of a state or a run in it,
    // Error(io) when it cannot be written or another program writes in it. `overwrite`: removes table and levels of an
    // earlier call first; a run stays refused, and so do files of runs and exports, and those that the scene names.
    StatisticsTable(const std::filesystem::path& folder, bool overwrite, Scene scene);

    // Adds a row, with the columns of the command that bits alone have. Throws Error(io), also when the folder was removed.
    void add(std::uint64_t step, double time_s, const CloudStatistics& statistics, const std::string& hash);

  private:
    void write(const std::string& text);

    std::filesystem::path path_;
    FolderLock lock_;
    Descriptor file_;
};

}  // namespace nephos
