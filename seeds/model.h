// SPDX-License-Identifier: Apache-2.0
#pragma once

// Base models (T, docs/sources.md, chapter 3.1): boxes (seeds) placed by an artist and the roots by which
// they reproduce. One model generates any number of different clouds.
//
// Reproduction, by T's chapter 3.1 and its figures 10, 12 and 13:
// - All children of a root descend from the seed that owns the root; children have no roots. ("the remaining
//   ones were created from the roots that the progenitor has"; the level "defines the distance from the
//   progenitor".)
// - The numbers at the levels of figure 12 count the children of the whole level, not of each seed of the
//   level before.
// - The direction varies within the opening angle, half of it to each side; the region is a cone.
// T leaves the radius of a box open: its one "radius of the seed" is read as that of the sphere around the
// box, as for clouds (`RootRadius::sphere`). For flat boxes `RootRadius::box` makes the spacing proportional
// to the edges. Directions: yaw counter-clockwise from east seen from above, pitch up from the horizon.

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

// A range of integers, both ends included, from which a uniform one is drawn.
struct CountRange {
    int min = 0, max = 0;
    bool operator==(const CountRange&) const = default;
};

// The distance between successive levels of reproduction.
enum class RootRadius {
    sphere,  // half the diagonal of the parent's box, in every direction
    box,     // from the parent's centre to the face of its box that the direction meets
};

// A direction of growth of a seed.
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

inline constexpr double kSmallestSize_m = 0.001,
                        kLargestBillboard_m = 60'000;  // which can be drawn (render/cloud/splats.h)

// A box that the artist placed.
struct Seed {
    Vec3 position_m{};                 // of the box's centre, model space
    Vec3 size_m{100, 100, 100};        // width (x), depth (y), height (z), each from kSmallestSize_m
    CountRange billboards{1, 1};       // scattered in each box of this seed, 0..10000
    Range billboard_width_m{30, 50};   // kSmallestSize_m to kLargestBillboard_m
    Range billboard_height_m{30, 50};  // likewise
    BillboardTexture texture = BillboardTexture::soft;
    double strength = 1;  // effect on the probability field, 0..1
    std::vector<Root> roots;
    bool operator==(const Seed&) const = default;
};

struct BaseModel {
    std::string name;
    std::optional<Genus> genus;  // of its clouds; rain areas may be attached by genus
    std::vector<Seed> seeds;     // at least one
    // PNG files with alpha, of which each billboard has one, in place of its seed's texture; none: of that texture.
    std::vector<std::string> textures;
    // Path length in the cloud after which light is absorbed, > 0.
    double light_distance_m = std::numeric_limits<double>::infinity();
    // Of the ellipsoids of its boxes, instead of CouplingOptions::centre and rim where they are its own.
    bool own_centre = false, own_rim = false;
    Probabilities centre{0.1, 0.001, 0.1};
    Probabilities rim{0, 0, 0.1};
    bool operator==(const BaseModel&) const = default;
};

// Largest number of boxes of a cloud; check() refuses a model that could exceed it.
inline constexpr int kMaxBoxes = 1'000'000;

// Returns the number of boxes of the largest cloud that a model can generate. Pure.
std::int64_t largest_cloud(const BaseModel& model);

// Throws Error(usage) with the model's name, the value and the expected range.
void check(const BaseModel& model);

// The directions of a root, orthonormal: ahead, towards growing yaw, and towards growing pitch. Pure.
struct RootAxes {
    Vec3 ahead{}, side{}, up{};
};
RootAxes axes_of(const Root& root);

// Returns the number of children at a level in 1..levels: start + (end - start) (level - 1) / (levels - 1),
// rounded half up; start if there is but one level.
int children_of_level(const Root& root, int level, int levels);

// Generates cloud `number` of the base model with index `model_index` (0..65535) in the scene. Boxes are
// ordered seed by seed: its own box, then root by root and level by level. Precondition: `model` has passed
// check(). Pure.
Cloud reproduce(const BaseModel& model, std::uint64_t scene_seed, std::uint32_t model_index,
                std::uint32_t number);

// A billboard of T, scattered in a box of a cloud: for pictures of clouds without an automaton.
struct Billboard {
    Vec3 centre_m{};  // model space; uniform in its box
    double width_m = 0, height_m = 0;
    std::uint32_t box = 0;  // index in Cloud::boxes: its absorbed light, its phase
    BillboardTexture texture = BillboardTexture::soft;
    std::uint32_t variant = 0;  // random word: which of the texture's pictures, which turn
    bool operator==(const Billboard&) const = default;
};

// Returns all billboards, box by box, of the cloud that reproduce() makes from the same arguments. Pure.
std::vector<Billboard> scatter_billboards(const BaseModel& model, const Cloud& cloud,
                                          std::uint64_t scene_seed, std::uint32_t model_index,
                                          std::uint32_t number);

}  // namespace nephos
