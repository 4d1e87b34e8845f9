// SPDX-License-Identifier: Apache-2.0
#include "render/image/tone_map.h"

#include <algorithm>
#include <cmath>

namespace nephos {
namespace {

constexpr float kShoulder = 0.5f;  // where the curve leaves the identity

// Thresholds of ordered dithering, 8x8 Bayer matrix: the bits of x^y and y, interleaved and reversed.
// Returns (-0.5, 0.5), mean 0.
float dither(int x, int y) {
    unsigned value = 0;
    const unsigned a = unsigned(x ^ y), b = unsigned(y);
    for (unsigned bit = 0; bit < 3; ++bit)
        value |= ((a >> bit & 1u) << (5 - 2 * bit)) | ((b >> bit & 1u) << (4 - 2 * bit));
    return (float(value) + 0.5f) / 64.0f - 0.5f;
}

}  // namespace

float tone_map(float radiance) {
    if (!(radiance > 0.0f)) return 0.0f;
    if (radiance <= kShoulder) return radiance;
    return kShoulder + (1.0f - kShoulder) * (1.0f - std::exp(-(radiance - kShoulder) / (1.0f - kShoulder)));
}

float encode_srgb(float linear) {
    const float x = std::clamp(linear, 0.0f, 1.0f);
    return x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1.0f / 2.4f) - 0.055f;
}

std::vector<std::uint8_t> to_srgb8(const Picture& picture, double exposure_ev) {
    const float gain = float(std::exp2(exposure_ev));
    std::vector<std::uint8_t> rgb(3 * picture.pixels());
    std::size_t at = 0;
    for (int y = 0; y < picture.height; ++y) {
        for (int x = 0; x < picture.width; ++x) {
            const float offset = dither(x, y);
            for (int channel = 0; channel < 3; ++channel, ++at) {
                const float encoded = 255.0f * encode_srgb(tone_map(gain * picture.beauty[at]));
                // Black stays black and white stays white: only what lies between is dithered.
                const bool end = encoded <= 0.0f || encoded >= 255.0f;
                rgb[at] = std::uint8_t(
                    std::clamp(std::floor(encoded + (end ? 0.0f : offset) + 0.5f), 0.0f, 255.0f));
            }
        }
    }
    return rgb;
}

}  // namespace nephos
