// SPDX-License-Identifier: Apache-2.0
#pragma once

// A finished or interrupted run as its manifest lists it: what `nephos verify` checks and `nephos export` converts.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "scenes/format/scene.h"
#include "simulation/manifest.h"

namespace nephos {

struct ListedFrame {
    int number = 1;
    double time_s = 0;
    std::uint64_t step = 0;
    std::string state_hash;
    std::vector<FileRecord> files;  // empty in a manifest of an earlier version
    std::vector<RainRecord> rain;
};

struct RunListing {
    std::filesystem::path folder;
    Scene scene;
    std::string scene_file;  // its name, without a folder
    std::string scene_hash, frames_hash, simulation_hash, nephos_version;
    bool complete = false;
    bool render = false;
    SimulationRange range;
    std::uint64_t steps_reported = 0;
    std::vector<ListedFrame> frames;    // in the manifest's order
    std::vector<FileRecord> tables;     // of statistics, up to the reported steps; none of an earlier version
    std::vector<FileRecord> run_files;  // of a complete run
    std::vector<RunInput> inputs;  // files that the scene names; none in a manifest of an earlier version
    std::optional<BranchPoint> branch;  // of a run that branched off another one
};

// Returns true when the folder has a manifest of a run. Throws ReadFailure where the system cannot say.
bool is_run_folder(const std::filesystem::path& folder);

// Reads DIR/manifest.json. Throws Error(io) naming it when it cannot be read, is no manifest of this version, or holds
// a scene that cannot be read.
RunListing read_run(const std::filesystem::path& folder);

// Returns the folder of the run that lists the file, or whose manifest or checkpoint it is, links followed; nothing where no folder
// of a run that can be read is above it. Throws ReadFailure where the system cannot say.
std::optional<std::filesystem::path> run_with_file(const std::filesystem::path& file);

// Returns the path of the density file of a frame: of a layer, or of all together. Throws Error(usage) that lists the
// layers when there is none of this name or no such file is written.
std::filesystem::path density_file(const RunListing& run, const ListedFrame& frame,
                                   const std::optional<std::string>& layer);

// Returns the number of a layer. Throws Error(usage) that lists the layers.
std::size_t layer_index(const Scene& scene, const std::string& name);

}  // namespace nephos
