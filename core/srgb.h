// SPDX-License-Identifier: Apache-2.0
#pragma once

// The transfer function of sRGB (IEC 61966-2-1), both ways. Numbers outside of 0..1 are cut. Pure.

#include <algorithm>
#include <cmath>

namespace nephos {

// Linear to encoded.
inline float encode_srgb(float linear) {
    const float x = std::clamp(linear, 0.0f, 1.0f);
    return x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1.0f / 2.4f) - 0.055f;
}

// Encoded to linear.
inline float decode_srgb(float encoded) {
    const float x = std::clamp(encoded, 0.0f, 1.0f);
    return x <= 0.04045f ? x / 12.92f : std::pow((x + 0.055f) / 1.055f, 2.4f);
}

}  // namespace nephos
