// SPDX-License-Identifier: Apache-2.0
#pragma once

// Clouds of voxels for tests, as metaballs() makes them of a grid: blocks of 8 x 8 x 8 by z, y, x, in a block
// x fastest.

#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "render/cloud/splats.h"

namespace nephos::test {

inline constexpr double kVoxelRadius = 1.5;  // of a voxel's metaball, edges
inline constexpr double kVoxelNormalisation =
    2835.0 / (736.0 * std::numbers::pi * kVoxelRadius * kVoxelRadius * kVoxelRadius);

struct VoxelBox {
    Vec3 origin_m{-480, -480, 600};
    double edge_m = 40;
    int x = 24, y = 24, z = 16;
};

// `density(x, y, z)` of voxel numbers; nothing where it is not above 0.
template <class Density>
std::vector<Metaball> voxel_metaballs(const VoxelBox& box, const Density& density) {
    std::vector<Metaball> balls;
    const auto add = [&](int x, int y, int z) {
        const double value = density(x, y, z);
        if (x >= box.x || y >= box.y || z >= box.z || !(value > 0)) return;
        balls.push_back(
            {float(box.origin_m.x + (x + 0.5) * box.edge_m), float(box.origin_m.y + (y + 0.5) * box.edge_m),
             float(box.origin_m.z + (z + 0.5) * box.edge_m), float(kVoxelRadius * box.edge_m), float(value)});
    };
    for (int z = 0; z < box.z; z += 8)
        for (int y = 0; y < box.y; y += 8)
            for (int x = 0; x < box.x; x += 8)
                for (int n = 0; n < 512; ++n) add(x + (n & 7), y + (n >> 3 & 7), z + (n >> 6));
    return balls;
}

// 0..1, without any pattern.
inline double voxel_noise(int x, int y, int z, int seed) {
    std::uint32_t h = std::uint32_t(x) * 0x9e3779b1u ^ std::uint32_t(y) * 0x85ebca77u ^
                      std::uint32_t(z) * 0xc2b2ae3du ^ std::uint32_t(seed) * 0x27d4eb2fu;
    h = (h ^ h >> 15) * 0x2c1b3c6du;
    h = (h ^ h >> 12) * 0x297a2d39u;
    return double(h ^ h >> 15) / 4294967296.0;
}

// A ragged heap like those of the automaton: faint at the rim, thicker and uneven within; `growth` makes
// every voxel denser.
inline std::vector<Metaball> ragged_cloud(const VoxelBox& box = {}, int seed = 1, double growth = 1) {
    return voxel_metaballs(box, [&](int x, int y, int z) {
        const double dx = (x + 0.5) / box.x - 0.5, dy = (y + 0.5) / box.y - 0.5, dz = (z + 0.5) / box.z - 0.4;
        const double inside = 1 - 4.4 * (dx * dx + dy * dy + dz * dz);
        const double noise = voxel_noise(x, y, z, seed);
        return noise < 0.15 ? 0.0 : growth * std::fmax(0.0, 0.35 * inside) * noise;
    });
}

}  // namespace nephos::test
