// SPDX-License-Identifier: Apache-2.0
#pragma once

// The formulas of detailed density and its noise for one place at a time (not installed).

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

namespace nephos {
namespace detail_text {
#define NEPHOS_FUNCTION inline
using Real = float;
using Truth = bool;
inline float min(float a, float b) { return b < a ? b : a; }
inline float max(float a, float b) { return a < b ? b : a; }
inline float mul_add(float a, float b, float c) { return a * b + c; }
inline float select(bool condition, float a, float b) { return condition ? a : b; }
#include "density/detail_formulas.h"
#undef NEPHOS_FUNCTION
}  // namespace detail_text

// Interpolates a cube of noise, words as in DetailNoise, between its voxels; place in voxels; 0..1.
inline float scalar_noise(std::span<const std::uint32_t> words, int edge, float x, float y, float z) {
    const float at[3] = {x - 0.5f, y - 0.5f, z - 0.5f};
    int whole[3];
    float rest[3];
    for (int n = 0; n < 3; ++n) {
        const float below = std::floor(at[n]);
        rest[n] = at[n] - below;
        whole[n] = int(below) & (edge - 1);
    }
    const auto plane = [&](int k) {
        const std::uint32_t word =
            words[(std::size_t(k & (edge - 1)) * std::size_t(edge) + std::size_t(whole[1])) * std::size_t(edge) +
                  std::size_t(whole[0])];
        const auto byte = [word](int shift) { return float(word >> shift & 255); };
        const float low = byte(0) + rest[0] * (byte(8) - byte(0)), high = byte(16) + rest[0] * (byte(24) - byte(16));
        return low + rest[1] * (high - low);
    };
    const float low = plane(whole[2]), high = plane(whole[2] + 1);
    return (low + rest[2] * (high - low)) / 255.0f;
}

}  // namespace nephos
