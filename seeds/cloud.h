// SPDX-License-Identifier: Apache-2.0
#pragma once

// A cloud of T: boxes (seeds) in which billboards are scattered, its centre and its radius; how it forms and
// dissolves; and which clouds a camera can see.
//
// Model space: metres, axes as in the world, origin where the base model has it; z = 0 is the height of the
// cloud's base. A cloud in a sky stands at a world position that is added to everything here.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/vec.h"

namespace nephos {

// One box, axis-parallel in the world as well: T never turns boxes, which is what its slab test rests on.
struct SeedBox {
    Vec3 centre_m{};         // model space
    Vec3 size_m{};           // edges, > 0
    std::uint32_t seed = 0;  // index in BaseModel::seeds whose texture, sizes and strength it has
    int level = 0;           // 0: the artist's own seed; n: made in reproduction n
    int billboards = 0;      // drawn for this box
    double distance = 0;     // of its centre from the cloud's, 1 = the farthest box; decides when it forms
    bool operator==(const SeedBox&) const = default;
};

struct Cloud {
    std::vector<SeedBox> boxes;
    Vec3 centre_m{};              // of the bounding box of all boxes, model space
    double radius_m = 0;          // of the smallest sphere about centre_m that holds all boxes (T, figure 14)
    Vec3 low_m{}, high_m{};       // bounding box, model space
    double light_distance_m = 0;  // way of light in the cloud after which it is absorbed; may be infinite
    bool operator==(const Cloud&) const = default;
};

// Sets centre, radius, bounding box and the boxes' distances from the boxes; all 0 without boxes.
void enclose(Cloud& cloud);

// How much of a box is there while its cloud forms or dissolves (Wang, after T): phase 0 = no cloud, 1 =
// whole. Growing phase: the boxes at the centre come first; falling: those at the edge go first. Each box
// goes from 0 to 1 linearly over the fraction softness / (1 + softness) of the phase; continuous in both
// arguments. `distance` as in SeedBox; softness > 0.
inline double phase_weight(double distance, double phase, double softness) {
    const double weight = (phase * (1 + softness) - distance) / softness;
    return weight <= 0 ? 0 : weight >= 1 ? 1 : weight;
}

struct Sphere {
    Vec3 centre_m{};
    double radius_m = 0;
};

// Points p with dot(normal, p) + offset >= 0 are inside; |normal| = 1.
struct Plane {
    Vec3 normal{};
    double offset_m = 0;
};

// What a camera sees: six planes facing inwards, and the smallest sphere around them whose centre lies on the
// axis.
struct Frustum {
    std::array<Plane, 6> planes;  // near, far, left, right, bottom, top
    Sphere sphere;
};

struct FrustumView {
    Vec3 eye_m{};
    Vec3 forward{0, 1, 0};              // any length > 0
    Vec3 up{0, 0, 1};                   // not parallel to forward
    double fov_y_deg = 60;              // full vertical angle, 0 < fov < 180
    double aspect = 4.0 / 3.0;          // width / height, > 0
    double near_m = 1, far_m = 100000;  // 0 < near < far
};

// Throws Error(usage) on values outside the ranges above.
Frustum frustum_of(const FrustumView& view);

// T's test: sphere against the frustum's sphere, then against its six planes. False only if nothing of the
// sphere is inside the frustum; near edges it may be true for a sphere just outside. Pure.
bool may_see(const Frustum& frustum, const Sphere& sphere);

// Indices of the spheres that may be seen, rising.
std::vector<std::uint32_t> cull(const Frustum& frustum, std::span<const Sphere> spheres);

}  // namespace nephos
