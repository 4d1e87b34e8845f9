// SPDX-License-Identifier: Apache-2.0
#pragma once

// Gradient noise in three dimensions (Perlin 1985, 2002), the N of S's clouds, with gradients from an integer
// hash instead of a table:
//
//     N(p) = 2/3 * sum over the 8 lattice points l around p of  s(x) s(y) s(z)  g(l) . (p - l)
//     s(d) = 1 - (6 |d|^5 - 15 |d|^4 + 10 |d|^3),   g(l) three numbers of 10 bits, each in -1 .. 1
//
// N lies in -1..1 (its standard deviation is 0.13, beyond 0.5 it hardly comes), has mean 0 and continuous
// second derivatives, and is 0 at whole-numbered points. Its features are about one lattice cell large.
//
// S looks up a 2-D texture twice and mixes (a "virtual" third dimension), because a 3-D texture takes memory.
// A hash takes none, has no period but that which is asked for, changes smoothly in all three directions
// instead of linearly in one, and needs no look-up, so that vector units compute it (docs/veils.md).
//
// Only sums and products of IEEE numbers without contraction, and 32-bit integers: the same bits on every
// machine, with any vector width. Functions are pure and thread-safe.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace nephos {

struct NoiseOptions {
    std::uint32_t seed = 0;
    // Lattice cells after which the noise repeats towards x, y, z: 0 (never, but for 2^32) to 2^20.
    std::array<int, 3> period{0, 0, 0};
    bool operator==(const NoiseOptions&) const = default;
};

// N at many points: out[n] = N(x[n], y[n], z[n]), in lattice cells from the origin. Coordinates are finite
// and within +-2^20: beyond that floats have no fraction left worth the name. Throws Error(usage) when the
// spans differ in length, or when a coordinate or a period is out of range.
void gradient_noise(std::span<const float> x, std::span<const float> y, std::span<const float> z,
                    const NoiseOptions& options, std::span<float> out);

// A cube of octave noise that repeats in all three directions: for fog and other fillings that are looked up
// anywhere, modulo the cube.
struct NoiseVolumeOptions {
    std::uint32_t seed = 0;
    int voxels = 32;           // along an edge, 2..512
    int cells = 4;             // lattice cells of the first octave along an edge, 1..voxels / 2
    int octaves = 3;           // each with half the cells of the one before; 1..8, the last at least 2 voxels
    double persistence = 0.5;  // weight of an octave per weight of the one before, above 0, at most 1
    bool operator==(const NoiseVolumeOptions&) const = default;
};

// voxels^3 values in 0..1, x fastest, of the voxels' centres: 1/2 + sum w_k N_k / (2 sum w_k), stretched
// about 1/2 so that the values' standard deviation is 1/5, and clamped. Throws Error(usage) when an option is
// out of range.
std::vector<float> noise_volume(const NoiseVolumeOptions& options);

}  // namespace nephos
