// SPDX-License-Identifier: Apache-2.0
#pragma once

// Gradient noise in three dimensions (Perlin 1985, 2002), the N of S's clouds, with gradients from an integer
// hash instead of a table:
//
//     N(p) = 2/3 * sum over the 8 lattice points l around p of  s(x) s(y) s(z)  g(l) . (p - l)
//     s(d) = 1 - (6 |d|^5 - 15 |d|^4 + 10 |d|^3),   g(l) three numbers of 10 bits, each in -1 .. 1
//
// N lies in -1..1 (standard deviation 0.13, rarely beyond 0.5), has mean 0 and continuous second derivatives,
// and is 0 at integer points. Its features are about one lattice cell large.
//
// S looks up a 2-D texture twice and mixes (a "virtual" third dimension), because a 3-D texture takes memory.
// A hash takes none, repeats only with the requested period, is smooth in all three directions instead of
// linear in one, and needs no look-up, so that it runs in vector units (docs/veils.md).
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
    // Period in lattice cells along x, y, z, up to 2^20; 0 = none (2^32, where the integer hash repeats).
    std::array<int, 3> period{0, 0, 0};
    bool operator==(const NoiseOptions&) const = default;
};

// Evaluates N at many points: out[n] = N(x[n], y[n], z[n]), in lattice cells from the origin. Coordinates are
// finite and within +-2^20, beyond which a float has fewer than 3 fractional bits. Throws Error(usage) when
// the spans differ in length, or when a coordinate or a period is out of range.
void gradient_noise(std::span<const float> x, std::span<const float> y, std::span<const float> z,
                    const NoiseOptions& options, std::span<float> out);

// A cube of octave noise that tiles space in all three directions, as fog density needs it.
struct NoiseVolumeOptions {
    std::uint32_t seed = 0;
    int voxels = 32;           // along an edge, 2..512
    int cells = 4;             // lattice cells of the first octave along an edge, 1..voxels / 2
    int octaves = 3;           // 1..8; cell size halves with each, at least 2 voxels in the last
    double persistence = 0.5;  // ratio of the weights of successive octaves, above 0, at most 1
    bool operator==(const NoiseVolumeOptions&) const = default;
};

// Returns voxels^3 values in 0..1 at the voxels' centres, x fastest: 1/2 + sum w_k N_k / (2 sum w_k), scaled
// about 1/2 to a standard deviation of 1/5, then clamped. Throws Error(usage) when an option is out of range.
std::vector<float> noise_volume(const NoiseVolumeOptions& options);

}  // namespace nephos
