// SPDX-License-Identifier: Apache-2.0
#pragma once

// The integer hash behind core/noise.h (not installed). A lattice point (x, y, z) has the hash
//
//     mix(mix(x S + seed_x) + mix(y S + seed_y) + mix(z S + seed_z))   modulo 2^32
//
// so that a row of points shares two of the inner hashes, and no shift of the lattice maps the noise onto
// itself, as it does when coordinates are multiplied and added without the inner mix.

#include <array>
#include <cstdint>

namespace nephos {

// Multiplicative constants of a mixing function of two rounds whose bias is small (C. Wellons, "Prospecting
// for hash functions", 2018: "lowbias32").
inline constexpr std::uint32_t kMixFirst = 0x7feb352dU, kMixSecond = 0x846ca68bU;
inline constexpr std::uint32_t kAxisStep = 0x9e3779b1U;  // 2^32 / golden ratio, odd

// Scales the largest possible sum, 1023 * 3/2 in the middle of a cell, to 1.
inline constexpr float kNoiseScale = 2.0f / (3.0f * 1023.0f);

constexpr std::uint32_t mix_bits(std::uint32_t h) {
    h = (h ^ h >> 16) * kMixFirst;
    h = (h ^ h >> 15) * kMixSecond;
    return h ^ h >> 16;
}

// Returns one seed for each axis.
constexpr std::array<std::uint32_t, 3> axis_seeds(std::uint32_t seed) {
    const std::uint32_t x = mix_bits(seed + kAxisStep), y = mix_bits(x + kAxisStep);
    return {x, y, mix_bits(y + kAxisStep)};
}

}  // namespace nephos
