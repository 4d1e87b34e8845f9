// SPDX-License-Identifier: Apache-2.0
#include "render/image/tone_map.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

#include "render/image/exposure.h"
#include "render/image/glare.h"

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

// Of ToneCurve::neutral.
constexpr float kNeutralShoulder = 0.6f, kFading = 0.15f;

std::array<float, 3> toned(const std::array<float, 3>& radiance, ToneCurve curve) {
    if (curve == ToneCurve::neutral) return neutral_tone(radiance);
    return {tone_map(radiance[0]), tone_map(radiance[1]), tone_map(radiance[2])};
}

std::vector<std::uint8_t> encoded(std::span<const float> beauty, int width, double exposure_ev,
                                  ToneCurve curve) {
    const float gain = float(std::exp2(exposure_ev));
    std::vector<std::uint8_t> rgb(beauty.size());
    const std::size_t pixels = beauty.size() / 3;
    for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
        const std::size_t at = 3 * pixel;
        const float offset = dither(int(pixel % std::size_t(width)), int(pixel / std::size_t(width)));
        const std::array<float, 3> shown =
            toned({gain * beauty[at], gain * beauty[at + 1], gain * beauty[at + 2]}, curve);
        for (std::size_t channel = 0; channel < 3; ++channel) {
            const float value = 255.0f * encode_srgb(shown[channel]);
            // Black stays black and white stays white: only what lies between is dithered.
            const bool end = value <= 0.0f || value >= 255.0f;
            rgb[at + channel] =
                std::uint8_t(std::clamp(std::floor(value + (end ? 0.0f : offset) + 0.5f), 0.0f, 255.0f));
        }
    }
    return rgb;
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

std::array<float, 3> neutral_tone(const std::array<float, 3>& radiance) {
    std::array<float, 3> colour{};
    for (std::size_t c = 0; c < 3; ++c) colour[c] = radiance[c] > 0.0f ? radiance[c] : 0.0f;
    // Infinite light is white.
    const float peak = std::min(std::max({colour[0], colour[1], colour[2]}), 1e30f);
    if (peak <= kNeutralShoulder) return colour;
    const float rest = 1.0f - kNeutralShoulder;
    const float top = 1.0f - rest * rest / (peak + rest - kNeutralShoulder);
    const float white = 1.0f - 1.0f / (kFading * (peak - top) + 1.0f);
    for (float& channel : colour) {
        const float scaled = std::min(channel, 1e30f) * (top / peak);
        channel = scaled + white * (top - scaled);
    }
    return colour;
}

std::vector<std::uint8_t> to_srgb8(const Picture& picture, double exposure_ev, ToneCurve curve) {
    return encoded(picture.beauty, picture.width, exposure_ev, curve);
}

std::vector<std::uint8_t> to_srgb8(const Picture& picture, const Camera& camera) {
    const double ev = exposure_ev(picture, camera);
    if (!(camera.glare > 0)) return to_srgb8(picture, ev, camera.tone_curve);
    return encoded(with_glare(picture, camera), picture.width, ev, camera.tone_curve);
}

}  // namespace nephos
