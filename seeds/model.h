// SPDX-License-Identifier: Apache-2.0
#pragma once

// Base models (T, chapter 3.1): the boxes that an artist sets, the roots by which they reproduce, and the
// clouds that this makes, any number of different ones from one model.
//
// Where the digest of T is silent, its text (3.1, figures 10, 12 and 13) decides:
// - All children of a root descend from the seed that owns the root; children have no roots. ("the remaining
// ones
//   were created from the roots that the progenitor has"; the level "defines the distance from the
//   progenitor".)
// - The numbers at the levels of figure 12 are children of the whole level, not of each seed of the level
// before.
// - The direction varies within the opening angle, half of it to each side; the region is a cone.
// Not in T: which radius a box has. It speaks of one "radius of the seed", like that of a cloud, which is the
// sphere around it: `RootRadius::sphere`. For flat boxes `RootRadius::box` keeps the spacing proportionate.
// Directions: yaw counter-clockwise from east seen from above, pitch up from the horizon.

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "automaton/field.h"
#include "core/vec.h"
#include "core/weather.h"
#include "seeds/cloud.h"
#include "seeds/genera.h"

namespace nephos {

// Integers from which a uniform one is drawn, both ends included.
struct CountRange {
    int min = 0, max = 0;
    bool operator==(const CountRange&) const = default;
};

// How far one reproduction level reaches.
enum class RootRadius {
    sphere,  // half the diagonal of the parent's box, in every direction
    box,     // from the parent's centre to the face of its box that the direction meets
};

struct Root {
    double pitch_deg = 0;            // -360..360
    double yaw_deg = 0;              // -360..360
    double open_pitch_deg = 90;      // full opening angle vertically, 0..360
    double open_yaw_deg = 90;        // and horizontally; less than 180: a cone, elliptic if the two differ
    int seeds_start = 1;             // children in the first reproduction, 0..10000
    int seeds_end = 1;               // and in the last; linear between, rounded
    CountRange reproductions{1, 1};  // number of levels, 0..10000, drawn for each cloud
    RootRadius radius = RootRadius::sphere;
    bool operator==(const Root&) const = default;
};

struct Seed {
    Vec3 position_m{};                 // of the box's centre, model space
    Vec3 size_m{100, 100, 100};        // width (x), depth (y), height (z), each > 0
    CountRange billboards{1, 1};       // scattered in each box of this seed, 0..10000
    Range billboard_width_m{30, 50};   // > 0
    Range billboard_height_m{30, 50};  // > 0
    BillboardTexture texture = BillboardTexture::soft;
    double strength = 1;  // effect on the probability field, 0..1
    std::vector<Root> roots;
    bool operator==(const Seed&) const = default;
};

struct BaseModel {
    std::string name;
    std::optional<Genus> genus;  // what kind of cloud it makes; rain may be attached to it
    std::vector<Seed> seeds;     // at least one
    double light_distance_m =
        std::numeric_limits<double>::infinity();  // > 0, way of light until it is absorbed
    bool operator==(const BaseModel&) const = default;
};

// No cloud has more boxes than this; a model whose largest cloud could is refused.
inline constexpr int kMaxBoxes = 1'000'000;

// Boxes of the largest cloud that a model can make. Pure.
std::int64_t largest_cloud(const BaseModel& model);

// Throws Error(usage) with the model's name, the value and what was expected.
void check(const BaseModel& model);

// The directions of a root, orthonormal: ahead, towards growing yaw, and towards growing pitch. Pure.
struct RootAxes {
    Vec3 ahead{}, side{}, up{};
};
RootAxes axes_of(const Root& root);

// Children of level 1..levels: start + (end - start) (level - 1) / (levels - 1), rounded half up; start if
// there is but one level.
int children_of_level(const Root& root, int level, int levels);

// Cloud `number` of the base model with index `model_index` (0..65535) in the scene: a pure function of its
// arguments. Boxes are listed seed by seed: its own box, then root by root and level by level.
// `model` must have passed check().
Cloud reproduce(const BaseModel& model, std::uint64_t scene_seed, std::uint32_t model_index,
                std::uint32_t number);

}  // namespace nephos
