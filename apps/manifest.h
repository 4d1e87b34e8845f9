// SPDX-License-Identifier: Apache-2.0
#pragma once

// manifest.json: what was run, with which hashes, and every file of the run with its moment, so that another
// program needs to guess nothing. All but "timing" is a function of the scene and the command line alone.

#include <filesystem>
#include <string>
#include <vector>

#include "apps/run_folder.h"

namespace nephos {

// A frame that is in the folder.
struct FrameRecord {
    int number = 1;
    double time_s = 0;
    std::uint64_t step = 0;
    std::string state_hash;
};

// What a run tells its manifest.
struct ManifestState {
    bool complete = false;
    std::uint64_t steps_reported = 0;
    std::string state_hash;  // at the last reported step
    std::vector<FrameRecord> frames;
    double wall_s = 0;
    std::string device;
};

std::string manifest_text(const RunSettings& settings, const ManifestState& state);

// What a later run must know about an earlier one.
struct EarlierRun {
    bool complete = false;
    std::string name, scene_hash, simulation_hash;
    bool render = true;
    PipelineRange range;
    std::uint64_t steps_reported = 0;
};

// Throws Error(io) when the file cannot be read or is no manifest.
EarlierRun read_manifest(const std::filesystem::path& path);

}  // namespace nephos
