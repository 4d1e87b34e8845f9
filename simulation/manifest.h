// SPDX-License-Identifier: Apache-2.0
#pragma once

// manifest.json: what was run, with which hashes, and every file of the run with its moment, so that another
// program needs to guess nothing. All but "timing" is a function of the scene and the command line alone.

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "automaton/automaton.h"
#include "core/digest.h"
#include "simulation/run_folder.h"
#include "simulation/run_inputs.h"

namespace nephos {

// A file of the run and the checksums by which it is known.
struct FileRecord {
    std::string path;  // below the run's folder, with forward slashes
    FileDigest digest;
    std::string voxels;  // voxel_digest() of a density file; empty for others
};

// A frame that is in the folder. Small: a run keeps one for each frame, some hundred bytes beside a grid of
// kilobytes on disk.
struct FrameRecord {
    int number = 1;
    double time_s = 0;
    std::uint64_t step = 0;
    StateHash state_hash;
    std::vector<FileRecord> files;
};

// A rain area of a frame, as the manifest lists it.
struct RainRecord {
    std::uint64_t id = 0;  // as RainArea::id
    std::string layer;
    double x_m = 0, y_m = 0;            // centre, world
    double semi_a_m = 0, semi_b_m = 0;  // semi-axes of the ellipse
    double yaw_deg = 0;                 // of the first, counter-clockwise from east
    double intensity_mm_per_h = 0;
};

// What a run tells its manifest.
struct ManifestState {
    bool complete = false;
    std::uint64_t steps_reported = 0;
    std::string state_hash;  // at the last reported step
    std::vector<FrameRecord> frames;
    std::vector<FileRecord>
        tables;  // of statistics, up to the reported steps; a run that goes on has appended more since
    std::vector<FileRecord> run_files;  // of a complete run: those of no frame, but for the manifest
    std::vector<RunInput> inputs;       // files that the scene names
    std::map<int, std::vector<RainRecord>> rain;  // by number of the frame; frames without rain left out
    double wall_s = 0;
    std::string backend, device;  // that drew; empty without pictures
};

// Writes atomically, frame by frame. As JSON cannot be appended to, every call writes the whole list anew:
// some 400 bytes a frame, against seconds between two checkpoints. Throws Error(io).
void write_manifest(const RunSettings& settings, const ManifestState& state);

// Returns the rain areas of all layers of a frame.
std::vector<RainRecord> rain_of(const FrameResult& frame);

// Reads those that the manifest of an earlier run lists, exactly as they were. Throws Error(io) as
// read_manifest().
std::map<int, std::vector<RainRecord>> read_rain(const std::filesystem::path& path);

// Return the record of a file, and the number of a frame, as a manifest has them. Throw Error(io) naming the manifest
// when the value is impossible, or json::exception when it is of another kind.
FileRecord file_record(const nlohmann::ordered_json& json, const std::filesystem::path& manifest);
int frame_number(const nlohmann::ordered_json& json, const std::filesystem::path& manifest);

// Returns the tables of statistics that a manifest lists, as above; none where it is of an earlier version.
std::vector<FileRecord> tables_of(const nlohmann::ordered_json& manifest, const std::filesystem::path& path);

// Returns whether a path of a list leads to something below the list's folder, without detours.
bool is_inside_folder(const std::filesystem::path& path);

// Returns the scene of a manifest from its two texts: as it was given where that is the same scene, else from the canonical
// one, which spells out every key. Throws SceneErrors.
Scene scene_of_texts(const std::string& canonical, const std::string& given,
                     const std::filesystem::path& manifest);

// Returns the canonical text of the scene of an earlier run, with the files that it names where they are seen from here.
// Throws Error(io) as read_manifest(), and when the scene cannot be read.
std::string read_scene_text_of(const std::filesystem::path& path);

// Reads the files of the frames that the manifest of an earlier run lists; none for frames of a manifest that has no
// digests, as those of earlier versions. Throws Error(io) as read_manifest().
std::map<int, std::vector<FileRecord>> read_frame_files(const std::filesystem::path& path);

// What a later run must know about an earlier one.
struct EarlierRun {
    bool complete = false;
    std::string name, scene_file, scene_hash, frames_hash, simulation_hash;
    std::uint64_t scene_steps = 0;  // `time.steps` of its scene
    bool render = true;
    SimulationRange range;
    std::uint64_t steps_reported = 0;
    std::string state_hash;  // at the last of these
    // Of scenes/format/writer.h: keys of its scene that are not at their defaults.
    std::vector<std::pair<std::string, std::string>> parameters;
    std::vector<FileRecord> tables;     // of statistics; none in manifests of earlier versions
    std::vector<RunInput> inputs;       // none in manifests of earlier versions
    std::optional<BranchPoint> branch;  // of a run that branched off another one
};

// Returns the format of a manifest that is of something else than a run, such as "nephos sweep", shortened and without control
// characters; empty where it names none. Throws Error(io) as parsed_json().
std::string foreign_format(const std::filesystem::path& path);

// Throws Error(io) when the file cannot be read or is no manifest of a run.
EarlierRun read_manifest(const std::filesystem::path& path);

}  // namespace nephos
