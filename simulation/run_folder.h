// SPDX-License-Identifier: Apache-2.0
#pragma once

// A run on disk: which files the folder of a run has, and the run itself, which fills it.
//
//     DIR/density/NAME_0001.vdb ...    a density grid a frame; of layers, all together
//     DIR/density/LAYER/NAME_0001.vdb  a density grid a frame of each layer, with its own voxels
//     DIR/frames/NAME_0001.png ...     a picture a frame, and/or NAME_0001.exr; NAME.mp4 of them all
//     DIR/statistics.csv               a row a step
//     DIR/statistics/LAYER.csv         a row a step of each layer
//     DIR/manifest.json                what was run, and every file with its moment
//     DIR/checkpoint.nephos            where to go on; a complete run of statistics alone leaves none
//
// Every file appears complete or not at all, but for statistics.csv, to which each checkpoint appends whole
// rows. A run that was interrupted and resumed at any moment leaves the same content as one that was not;
// only the part "timing" of the manifest differs.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/file_stamp.h"
#include "render/renderer.h"
#include "scenes/format/scene.h"
#include "simulation/simulation.h"

namespace nephos {

struct RunFolder {
    std::filesystem::path folder;
    std::string name;

    std::filesystem::path density(int frame) const;  // frames count from 1
    std::filesystem::path density(int frame, const std::string& layer) const;
    std::filesystem::path picture(int frame, std::string_view extension) const;  // ".png" or ".exr"
    std::filesystem::path video() const;
    std::filesystem::path statistics() const { return folder / "statistics.csv"; }
    std::filesystem::path statistics(const std::string& layer) const {
        return folder / "statistics" / (layer + ".csv");
    }
    std::filesystem::path manifest() const { return folder / "manifest.json"; }
    std::filesystem::path checkpoint() const { return folder / "checkpoint.nephos"; }
};

// Return the files of a frame: its density files, those of all layers together first; its pictures.
std::vector<std::filesystem::path> density_files(const RunFolder& folder, const Scene& scene, int frame);
std::vector<std::filesystem::path> picture_files(const RunFolder& folder, const Scene& scene, int frame);

// The checkpoint of another run that a run branches off (simulation/branch.h), and by what it is known.
struct BranchPoint {
    std::filesystem::path checkpoint;  // as the command named it
    std::filesystem::path place;       // where it is seen from here; empty: there
    // Identify that checkpoint, and together all that is in it; empty and 0 in a manifest of an earlier version.
    std::string simulation_hash, state_hash;
    std::uint64_t steps = 0;
    int next_frame = 1;  // the first that the branch writes
};

struct RunInput;

struct RunSettings {
    Scene scene;
    std::optional<Lattice> initial;  // the state at step 0, when it is not the scene's own; taken by the run
    std::string scene_file;          // as the manifest names it
    std::string scene_text;          // canonical
    std::string scene_hash;          // of everything in the scene
    std::string simulation_hash;     // of what decides the automaton's bits
    FileStamps stamps;               // of the files that the scene names, before the first of them was read
    // The files with their checksums of then, where they may have changed since (keep_inputs()); null: they are read when the run
    // begins.
    std::shared_ptr<const std::vector<RunInput>> inputs{};
    SimulationRange range;
    bool statistics_only = false;  // no frames: statistics of every step (SimulationResults::statistics)
    bool render = true;            // pictures too
    DeviceOptions device{};        // what draws them, whatever scene.frames says
    std::filesystem::path folder;
    // Start from this checkpoint of another run; its state is part of simulation_hash.
    std::optional<BranchPoint> branch{};
    // Go on from the folder's checkpoint; start where there is none, of nothing or of the same scene; do nothing where the
    // same run is complete.
    bool resume = false;
    bool checkpoint = true;          // leave the checkpoint of a complete run, to lengthen it later
    bool overwrite = false;          // start anew although the folder holds what would be lost
    double checkpoint_every_s = 60;  // wall time between checkpoints; 0 = after every piece of work

    SimulationResults results() const;
};

// Reads the checksums of the files that the scene names into settings.inputs: for a run in several parts, all of which have what was
// read before the first. Throws Error(io) with the place of the key.
void keep_inputs(RunSettings& settings);

// Selects where a run starts.
enum class RunStart {
    first_state,  // at step 0: a file that the scene names its state in is read
    checkpoint,   // of a run to branch off: no such file is looked at
};

// Returns the settings of a run of the whole scene into out/NAME: its first state, text and hashes. `scene_file`
// is where the scene comes from. Throws as read_state().
RunSettings run_settings(Scene scene, const std::string& scene_file, RunStart from = RunStart::first_state);

struct RunProgress {
    std::uint64_t steps = 0, steps_in_all = 0;
    int frames = 0, frames_in_all = 0;
    std::string_view phase;  // "simulating", "encoding"
};

struct RunObserver {
    std::function<void(const RunProgress&)> progress;  // may be empty
    // Asked between pieces of work, and by any thread while it waits for ffmpeg; true ends the run with a checkpoint. May be
    // empty.
    std::function<bool()> stop;
};

// One kind of file that a run wrote.
struct RunFiles {
    std::string kind;  // "density", "png", "exr", "video", "statistics", "manifest", "checkpoint"
    std::vector<std::filesystem::path> files;
};

struct RunReport {
    std::string scene, scene_hash, simulation_hash;  // as in RunSettings
    std::filesystem::path folder;
    std::uint64_t last_step = 0;  // that the run has or will have
    bool complete = false;
    bool skipped = false;              // it was complete before: nothing was done
    bool restarted = false;            // there was an earlier run, but no checkpoint to go on from
    std::uint64_t first_step = 0;      // 0, or where it was resumed
    std::uint64_t steps_taken = 0;     // by the automaton, those ahead of the results included
    std::uint64_t steps_reported = 0;  // rows in statistics.csv
    int frames = 0;                    // in the folder
    std::string state_hash;            // at the last reported step
    double wall_s = 0;
    std::string backend, device;  // that drew, as Renderer names them; empty without pictures
    std::vector<RunFiles> files;
};

// Return what a run of this scene with pictures writes of them: PNG files, for themselves or beside the video; any, which
// takes a back-end; a video, which takes the ffmpeg command.
bool wants_png(const Scene& scene);
bool wants_pictures(const Scene& scene);
bool wants_video(const Scene& scene);

// Runs, or goes on. Throws Error(usage) when the settings contradict each other or the folder's checkpoint,
// or when files would be lost that are not of a complete run; Error(io) naming a file that could not be
// written or read, or when another run is writing into the folder. Before anything is simulated: Error(gpu)
// when pictures are wanted and the device that is asked for is not there, Error(io) when a video is wanted and
// there is no ffmpeg.
// After any exception the folder can be resumed from its last checkpoint.
RunReport run_scene(RunSettings settings, const RunObserver& observer);

}  // namespace nephos
