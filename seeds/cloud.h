// SPDX-License-Identifier: Apache-2.0
#pragma once

// A cloud of T (docs/sources.md): boxes (seeds) in which billboards are scattered, with bounding volumes for
// culling, and the weights of the boxes while it forms and dissolves.
//
// Model space: metres, axes as in the world, origin of the base model; z = 0 is the height of the cloud's
// base. World position = model position + position of the cloud.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/vec.h"

namespace nephos {

// One box, parallel to the axes in the world as well: T never rotates boxes, so that its slab test holds.
struct SeedBox {
    Vec3 centre_m{};         // model space
    Vec3 size_m{};           // edges, > 0
    std::uint32_t seed = 0;  // index in BaseModel::seeds, of its texture, sizes and strength
    int level = 0;           // 0: a seed of the model; n: made in reproduction n
    int billboards = 0;      // number of its billboards
    double distance = 0;     // of its centre from the cloud's, 1 = the farthest box; see phase_weight()
    bool operator==(const SeedBox&) const = default;
};

struct Cloud {
    std::vector<SeedBox> boxes;
    Vec3 centre_m{};              // of the bounding box of all boxes, model space
    double radius_m = 0;          // of the smallest sphere about centre_m that holds all boxes (T, figure 14)
    Vec3 low_m{}, high_m{};       // bounding box, model space
    double light_distance_m = 0;  // path length in the cloud after which light is absorbed; may be infinite
    bool operator==(const Cloud&) const = default;
};

// Computes centre, radius, bounding box and the boxes' distances; all 0 without boxes.
void enclose(Cloud& cloud);

// Returns the weight of a box, 0..1, while its cloud forms or dissolves (Wang, after T). phase: 0 = no cloud,
// 1 = the whole cloud. With growing phase boxes appear from the centre outwards, with falling phase they
// disappear from the edge inwards. Each weight is linear over the fraction softness / (1 + softness) of the
// phase, and continuous in both arguments. `distance` as in SeedBox; softness > 0. Pure.
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

// A view frustum: six planes facing inwards, and the smallest enclosing sphere with its centre on the axis.
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

// Returns the frustum of a camera. Throws Error(usage) on values outside the ranges above.
Frustum frustum_of(const FrustumView& view);

// Tests a sphere against the frustum's sphere, then against its six planes (T). Conservative: false only if
// the sphere is entirely outside the frustum; near edges true for some spheres just outside. Pure.
bool may_see(const Frustum& frustum, const Sphere& sphere);

}  // namespace nephos
