// SPDX-License-Identifier: Apache-2.0
#include "render/image/tone_map.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
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

// Thresholds of the matrix, rows from the top.
std::array<float, 64> dither_matrix() {
    std::array<float, 64> matrix{};
    for (int y = 0; y < 8; ++y)
        for (int x = 0; x < 8; ++x) matrix[std::size_t(8 * y + x)] = dither(x, y);
    return matrix;
}

// A channel as a byte. Black stays black and white stays white: only what lies between is dithered.
std::uint8_t byte_of(float shown, float offset) {
    const float value = 255.0f * encode_srgb(shown);
    const bool end = value <= 0.0f || value >= 255.0f;
    return std::uint8_t(std::clamp(std::floor(value + (end ? 0.0f : offset) + 0.5f), 0.0f, 255.0f));
}

// byte_of() without a power for nearly all numbers: 255 encode_srgb() between points whose mantissas have eight bits, to
// within 2e-4, unless that leaves a doubt about the byte.
class ByteTable {
  public:
    ByteTable() {
        for (std::uint32_t n = 0; n < kPoints; ++n) {
            const float x = point(n);
            values_[n] = 255.0f * encode_srgb(x);
            slopes_[n] = (255.0f * encode_srgb(point(n + 1)) - values_[n]) / (point(n + 1) - x);
        }
    }

    std::uint8_t byte_of(float shown, float offset) const {
        if (!(shown >= kLowest && shown < kHighest)) return nephos::byte_of(shown, offset);
        const std::uint32_t n = (std::bit_cast<std::uint32_t>(shown) >> kDropped) - kFirst;
        const float raised = values_[n] + slopes_[n] * (shown - point(n)) + offset + 0.5f, whole = std::floor(raised);
        if (std::abs(raised - whole - 0.5f) > 0.5f - kDoubt) return nephos::byte_of(shown, offset);
        return std::uint8_t(whole);
    }

  private:
    static constexpr float kLowest = 1.0f / 256, kHighest = 0.999f, kDoubt = 1e-3f;
    static constexpr std::uint32_t kDropped = 15, kFirst = std::bit_cast<std::uint32_t>(kLowest) >> kDropped,
                                   kPoints = (std::bit_cast<std::uint32_t>(1.0f) >> kDropped) - kFirst;
    static float point(std::uint32_t n) { return std::bit_cast<float>((n + kFirst) << kDropped); }

    std::array<float, kPoints> values_{}, slopes_{};
};

std::vector<std::uint8_t> encoded(std::span<const float> beauty, int width, double exposure_ev,
                                  ToneCurve curve) {
    const float gain = float(std::exp2(exposure_ev));
    std::vector<std::uint8_t> rgb(beauty.size());
    const std::size_t pixels = beauty.size() / 3;
    static const std::array<float, 64> matrix = dither_matrix();
    static const ByteTable bytes;
    for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
        const std::size_t at = 3 * pixel;
        const float offset = matrix[pixel / std::size_t(width) % 8 * 8 + pixel % std::size_t(width) % 8];
        const std::array<float, 3> shown =
            toned({gain * beauty[at], gain * beauty[at + 1], gain * beauty[at + 2]}, curve);
        for (std::size_t channel = 0; channel < 3; ++channel)
            rgb[at + channel] = bytes.byte_of(shown[channel], offset);
    }
    return rgb;
}

}  // namespace

float tone_map(float radiance) {
    if (!(radiance > 0.0f)) return 0.0f;
    if (radiance <= kShoulder) return radiance;
    return kShoulder + (1.0f - kShoulder) * (1.0f - std::exp(-(radiance - kShoulder) / (1.0f - kShoulder)));
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
