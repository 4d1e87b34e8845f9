// SPDX-License-Identifier: Apache-2.0
#pragma once

// A cloud of T (docs/sources.md): boxes (seeds) in which billboards are scattered, with bounding volumes for
// culling, and the weights of the boxes while it forms and dissolves.
//
// Model space: metres, axes as in the world, origin of the base model; z = 0 is the height of the cloud's
// base. World position = model position + position of the cloud.

#include <cstdint>
#include <vector>

#include "core/vec.h"

namespace nephos {

struct Sphere {
    Vec3 centre_m{};
    double radius_m = 0;
};

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

}  // namespace nephos
