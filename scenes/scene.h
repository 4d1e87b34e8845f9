// SPDX-License-Identifier: Apache-2.0
#pragma once

// A scene: everything that one run needs, as plain data. Read from a TOML file by reader.h, written back by
// writer.h; every key of the file, with unit, range and effect, is described once, in schema.h.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "automaton/options.h"
#include "density/options.h"
#include "render/options.h"
#include "scenes/layers.h"
#include "seeds/ground_cover.h"
#include "seeds/model.h"

namespace nephos {

// Which moments of the simulation become frames (a density file and a picture each), and what is written of
// them. Frame n, counted from 0, shows the simulated time start_s + n * time_scale / per_second, whatever the
// time step is: between two steps the density is interpolated.
struct FrameOptions {
    double per_second = 24.0;  // frames of one second of film, > 0, at most 1000
    double time_scale = 60.0;  // simulated seconds that pass in one second of film, > 0
    double start_s = 0.0;      // simulated time of the first frame, >= 0
    int count = 0;             // number of frames; 0: as many as the simulated time holds
    bool png = true;           // a tone-mapped picture of each frame
    bool exr = false;          // a linear picture of each frame with its layers
    bool video = false;        // an MP4 of all frames
    bool operator==(const FrameOptions&) const = default;
};

struct Scene {
    std::string name;  // base name of what is written; letters, digits, '-', '_' and '.'
    AutomatonOptions automaton;
    std::uint64_t steps = 240;  // length of the simulation
    // A VDB file whose bool grids hum, act and cld are the state at step 0, instead of automaton.initial.
    std::optional<std::filesystem::path> initial_state_file;
    // Clouds from base models (layers.h). With layers, `automaton` holds what they share: seed, time step,
    // wind, how lattices start, and the lattice and background of layers that say nothing else.
    std::vector<BaseModel> models;
    std::vector<NamedSky> skies;
    ClimateOptions climate;
    std::vector<LayerOptions> layers;
    GroundCoverOptions ground_cover;  // water and snow on the ground over time
    DensityOptions density;
    RenderOptions render;
    FrameOptions frames;
    bool operator==(const Scene&) const = default;
};

// Simulated time from the first to the last step, in seconds.
double simulated_time_s(const Scene& scene);

// Simulated time of frame `index`, in seconds; index counts from 0.
double frame_time_s(const FrameOptions& frames, int index);

// Number of frames of the scene: frames.count, or with 0 as many as lie within the simulated time (both ends
// included), at most kMaxFrames.
int frame_count(const Scene& scene);

inline constexpr int kMaxFrames = 1'000'000;

}  // namespace nephos
