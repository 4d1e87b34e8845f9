// SPDX-License-Identifier: Apache-2.0
#pragma once

// A scene: the complete input of a run, as plain data. reader.h reads it from a TOML file, writer.h writes
// it; schema.h describes every key of the file with unit, range and effect.

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "automaton/options.h"
#include "core/place.h"
#include "density/options.h"
#include "render/options/device_options.h"
#include "render/options/options.h"
#include "render/options/sun_path.h"
#include "scenes/format/errors.h"
#include "scenes/format/layers.h"
#include "seeds/ground_cover.h"
#include "seeds/model.h"

namespace nephos {

// The frames of a run, each a density file and a picture, and their output formats. Frame n, counted from 0,
// shows the simulated time start_s + n * time_scale / per_second, independent of the time step: between two
// steps the density is interpolated.
struct FrameOptions {
    bool enabled = true;       // false: no frames, whatever `count` is
    double per_second = 24.0;  // frames of one second of film, > 0, at most 1000
    double time_scale = 60.0;  // simulated seconds that pass in one second of film, > 0
    double start_s = 0.0;      // simulated time of the first frame, >= 0
    int count = 0;             // number of frames; 0: as many as the simulated time holds
    bool png = true;           // a tone-mapped picture of each frame
    bool exr = false;          // a linear picture of each frame with its layers
    bool video = false;        // an MP4 of all frames
    // The back-end that draws the pictures; without effect on the simulation.
    Splatting splatting = Splatting::automatic;
    std::string device;  // of Vulkan, as DeviceOptions::device
    bool operator==(const FrameOptions&) const = default;
};

// Which density files a run writes, and what they have beside density.
struct DensityFileOptions {
    bool per_layer = true;              // of a scene with layers: a file for each, with its own voxels
    bool combined = true;               // of a scene with layers: one of all together; of others always
    std::string velocity_name = "vel";  // of the grid of the wind: letters, digits and '_'
    bool operator==(const DensityFileOptions&) const = default;
};

// Where the text of a scene names files: by the path of a key ("wind_field[0].files[1]"), a problem without its message.
// For messages alone: scenes that differ in it are equal.
struct FilePlaces {
    std::string scene_file;  // the scene's own
    std::map<std::string, Problem> of_key;
    bool operator==(const FilePlaces&) const { return true; }
};

struct Node;

// The keys that the scene was given (given_keys.h); none where it was made without a text. Scenes that differ in it are equal.
struct GivenKeys {
    std::shared_ptr<const Node> root;
    bool operator==(const GivenKeys&) const { return true; }
};

struct Scene {
    std::string name;  // base name of output files; letters, digits, '-', '_' and '.'
    // True: the density repeats along x and y. Lattices are periodic over one common rectangle, clouds re-enter it where
    // they leave it, and veils are periodic noise without margins.
    bool tile = false;
    AutomatonOptions automaton;
    std::uint64_t steps = 240;  // length of the simulation
    // A VDB file with bool grids hum, act and cld for the state at step 0; none: automaton.initial.
    std::optional<std::filesystem::path> initial_state_file;
    // Clouds from base models (layers.h). With layers, `automaton` holds their common options: seed, time
    // step, wind, initial state, ellipsoids and scatters of every field, and the defaults of lattice and background.
    std::vector<BaseModel> models;
    std::vector<NamedSky> skies;
    ClimateOptions climate;
    std::vector<LayerOptions> layers;
    GroundCoverOptions ground_cover;  // water and snow on the ground over time
    DensityOptions density;
    DensityFileOptions density_files;
    Georeference georeference;
    RenderOptions render;
    std::vector<SunKey> sun_path;  // key frames of render.sun, which then has no date; empty: none
    FrameOptions frames;
    FilePlaces file_places;
    GivenKeys given;
    bool operator==(const Scene&) const = default;
};

// Returns the simulated time from the first to the last step, in seconds.
double simulated_time_s(const Scene& scene);

// Returns the simulated time of frame `index` (from 0) in seconds, correct to 3 units in the last place. To
// locate a frame between steps, or beyond the last one, use moment_of_frame(), which rounds consistently.
double frame_time_s(const FrameOptions& frames, int index);

// A time in units of steps: step + fraction, 0 <= fraction < 1. A quotient time / time step within four units
// in the last place (ulp, 2^-52 of the number) of an integer is rounded to it.
//
// Why four: a frame whose decimal inputs put it exactly on a step must be on it. The quotient has seven
// roundings of at most half an ulp, 3.5 in all: time_scale and per_second as doubles, their product with the
// index and quotient, the sum with start_s, the time step as a double, and the division by it. (The error of
// start_s does not add: the relative error of a sum of non-negative terms is at most the larger of theirs.)
// Conversely, a frame between steps stays there if its inputs have few digits: as a fraction p / q of
// integers it is at least 1 / q away from any step, more than 7.5 ulp for p < 2^49. Only inputs of about 14
// digits or more are moved onto a step, by 2 parts in 10^15 at most.
struct Moment {
    std::uint64_t step = 0;
    double fraction = 0;
};

// Returns the moment of a time; both in seconds, time_s >= 0, time_step_s > 0. Saturates at step 2^63. Pure.
Moment moment_of(double time_s, double time_step_s);

// Returns the moment of frame `index`, which counts from 0. The only function that locates frames between
// steps.
Moment moment_of_frame(const Scene& scene, int index);

// Returns the number of steps needed for a moment: the first step that is not before it.
std::uint64_t steps_up_to(const Moment& moment);

// Returns the number of frames: 0 without frames.enabled, frames.count, or if that is 0 all frames up to and including the last step,
// at most kMaxFrames.
int frame_count(const Scene& scene);

// Returns the sun of the scene at a simulated time, its azimuth relative to the world's y axis: that of its key frames;
// of its date and place, turned by the georeference's heading; or as the scene says. Throws as sun_at(). Pure.
Sun scene_sun_at(const Scene& scene, double time_s);

// The same for a sun of its own: `heading_deg` is the true bearing of the y axis.
Sun turned_sun_at(const Sun& sun, std::span<const SunKey> path, double heading_deg, double time_s);

inline constexpr int kMaxFrames = 1'000'000;

}  // namespace nephos
