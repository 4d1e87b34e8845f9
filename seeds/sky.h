// SPDX-License-Identifier: Apache-2.0
#pragma once

// Skies (T, chapter 3.4), the clouds of an atmospheric state, and SkyOptions, all inputs of the simulation of
// one layer of clouds. Each layer of a scene has its own SkyOptions with its own `layer` number, heights and
// wind.

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/wind.h"
#include "seeds/model.h"

namespace nephos {

// Clouds from one base model: its clouds 0..generated-1 (reproduce()), all equally likely.
struct SkyModel {
    std::size_t model = 0;  // index in SkyOptions::models
    int generated = 10;     // 1..65536
    bool operator==(const SkyModel&) const = default;
};

// The clouds of one atmospheric state.
struct Sky {
    std::string name;
    double state = 0;              // 0 clear .. 1 storm; no two skies of a layer share one
    int clouds = 0;                // in the world at this state, 0..100000
    std::vector<SkyModel> models;  // equally likely; may be empty when clouds = 0
    bool operator==(const Sky&) const = default;
};

// The state of the atmosphere at one time.
struct StatePoint {
    double time_s = 0;
    double state = 0;  // 0..1
    bool operator==(const StatePoint&) const = default;
};

// The horizontal domain of the clouds, in world metres; min < max.
struct WorldRectangle {
    double min_x_m = 0, min_y_m = 0, max_x_m = 12800, max_y_m = 12800;
    bool operator==(const WorldRectangle&) const = default;
};

struct SkyOptions {
    std::string name;         // of the layer, for messages
    std::uint64_t seed = 1;   // the scene's
    std::uint32_t layer = 0;  // 0..65535; layers of one scene differ
    WorldRectangle world;
    Range base_height_m{1000, 1000};  // world z of a cloud's base, drawn for each cloud
    std::vector<BaseModel> models;    // shared by all layers: index = identity of the model in all draws
    std::vector<Sky> skies;           // in any order, at least one
    std::vector<StatePoint> schedule{{0, 0}};  // times rise strictly; any piecewise linear course
    Wind wind;                                 // each cloud moves with the wind at its centre's height
    double time_step_s = 10;                   // > 0
    double formation_s = 300;                  // duration of phase 0 to 1, >= 0
    double dissolution_s = 300;                // duration of phase 1 to 0, >= 0
    double formation_softness = 0.5;           // `softness` of phase_weight(), > 0; small: box after box
    // True: clouds cross the edge of the world whole. False: they form there while they enter and dissolve
    // once they have left, for images that show the edge.
    bool cross_edges_whole = true;
    // True: the world repeats. A cloud whose centre crosses an edge goes on at the opposite one, none leaves or enters, and
    // those of a new state form inside.
    bool periodic = false;
    bool operator==(const SkyOptions&) const = default;
};

// Largest number of boxes of all the different clouds that the skies of a layer use (memory), and of all the
// clouds of one sky (time of a step).
inline constexpr std::int64_t kMaxShapeBoxes = 4'000'000;
inline constexpr std::int64_t kMaxSkyBoxes = 1'000'000;

// Throws Error(usage) naming the layer, the value and the expected range: no sky, two skies with one state, a
// state outside 0..1, an unknown model index, clouds without models, a schedule that does not rise, bad
// models. SkySimulation refuses a cloud larger than the world when it generates the clouds.
void check(const SkyOptions& options);

}  // namespace nephos
