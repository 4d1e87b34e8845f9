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
#include "render/options/options.h"
#include "scenes/format/layers.h"
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

// Simulated time of frame `index`, in seconds; index counts from 0. Correct to 2 units in the last place:
// where a frame lies between the steps, and whether it lies beyond the last, is asked of moment_of_frame()
// alone.
double frame_time_s(const FrameOptions& frames, int index);

// A moment in steps: `step` <= moment < step + 1, `fraction` the rest. A quotient within four units in the
// last place (2^-52 of the number) of a whole number is that number. So a frame whose decimal inputs put it
// exactly on a step is on it: the seven roundings up to the quotient (start, time_scale, per_second and step
// as doubles, of which a frame's time takes three and the quotient one; product, quotient and sum of
// frame_time_s(); the quotient by the step; all numbers are >= 0, so errors do not grow in the sum) are at
// most half a unit each, 3.5 in all. And a frame that they put between steps stays there if their digits are
// few: with the moment as a fraction p / q of whole numbers, q times per_second and step_s in units of their
// last decimal, it is at least 1 / q away from any step, more than the 7.5 units for p < 2^49. Only beyond
// that, about 14 digits, is it moved onto a step, by 2 parts in 10^15 at most.
struct Moment {
    std::uint64_t step = 0;
    double fraction = 0;
};

// Both times in seconds, time_s >= 0, time_step_s > 0. After 2^63 steps the moment is step 2^63.
Moment moment_of(double time_s, double time_step_s);

// That of frame `index`, which counts from 0: the one place that decides between which steps a frame lies.
Moment moment_of_frame(const Scene& scene, int index);

// Steps that a moment needs: the first that is not before it.
std::uint64_t steps_up_to(const Moment& moment);

// Number of frames of the scene: frames.count, or with 0 as many as need no more than its steps (so that one
// on the last step counts), at most kMaxFrames.
int frame_count(const Scene& scene);

inline constexpr int kMaxFrames = 1'000'000;

}  // namespace nephos
