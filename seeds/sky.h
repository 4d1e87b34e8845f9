// SPDX-License-Identifier: Apache-2.0
#pragma once

// Skies and layers (T, chapter 3.4): which clouds belong to an atmospheric state, and everything that decides
// one layer's simulation. Several layers are several of these, each with its own `layer` number, heights and
// wind.

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/wind.h"
#include "seeds/model.h"

namespace nephos {

// Clouds from one base model: the models 0..generated-1 of it, all equally likely.
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

// The state that the atmosphere has at a time.
struct StatePoint {
    double time_s = 0;
    double state = 0;  // 0..1
    bool operator==(const StatePoint&) const = default;
};

// Where clouds live, in world metres; min < max.
struct WorldRectangle {
    double min_x_m = 0, min_y_m = 0, max_x_m = 12800, max_y_m = 12800;
    bool operator==(const WorldRectangle&) const = default;
};

struct SkyOptions {
    std::string name;         // of the layer, for messages
    std::uint64_t seed = 1;   // of the scene
    std::uint32_t layer = 0;  // 0..65535; layers of one scene differ
    WorldRectangle world;
    Range base_height_m{1000, 1000};  // world z of a cloud's base, drawn for each cloud
    std::vector<BaseModel> models;    // shared by all layers: index = identity of the model in all draws
    std::vector<Sky> skies;           // in any order, at least one
    std::vector<StatePoint> schedule{{0, 0}};  // times rise strictly; any piecewise linear course
    Wind wind;                                 // each cloud moves with the wind at its centre's height
    double time_step_s = 10;                   // > 0
    double formation_s = 300;                  // from nothing to the whole cloud, >= 0
    double dissolution_s = 300;                // and back, >= 0
    double formation_softness = 0.5;  // > 0: fraction over which one box appears; small: box after box
    // Clouds cross the edge of the world whole. False: they form there while they enter and dissolve once
    // they have left, for pictures that look beyond the edge.
    bool cross_edges_whole = true;
    bool operator==(const SkyOptions&) const = default;
};

// Most boxes of all the different clouds that the skies of a layer use, and of all the clouds of one sky:
// what memory and a step's time grow with.
inline constexpr std::int64_t kMaxShapeBoxes = 4'000'000;
inline constexpr std::int64_t kMaxSkyBoxes = 1'000'000;

// Throws Error(usage) naming the layer, the value and what was expected: no sky, two skies with one state, a
// state outside 0..1, an unknown model index, clouds without models, a schedule that does not rise, bad
// models. A cloud larger than the world is found when the clouds are made (SkySimulation).
void check(const SkyOptions& options);

}  // namespace nephos
