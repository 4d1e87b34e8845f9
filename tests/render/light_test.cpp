// SPDX-License-Identifier: Apache-2.0
// Closed forms and conventions: line integral, attenuation textures, dusk, tone curve.

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "render/blended/attenuation_texture.h"
#include "render/frame/frame_data.h"
#include "render/image/tone_map.h"
#include "render/shared/shared.h"
#include "tests/render/reference_render.h"

namespace nephos {
namespace {

constexpr double kPi = std::numbers::pi;

float line_integral(float w) { return shader::line_integral(w, std::sqrt(w)); }

TEST(LineIntegral, IsThatOfTheField) {
    for (double b = 0; b < 1; b += 0.05) {
        const Metaball ball{0, 0, 0, 1, 1};
        const double numeric = reference::column_m(ball, {{b, 0, -5}, {0, 0, 1}});
        EXPECT_NEAR(line_integral(float(1 - b * b)), numeric, 1e-6) << "b = " << b;
        const double half = reference::column_m(ball, {{b, 0, 0.3}, {0, 0, 1}});
        const float w = float(1 - b * b);
        if (w > 0.09f) {
            EXPECT_NEAR(
                shader::partial_line_integral(w, std::sqrt(w)) - shader::partial_line_integral(w, 0.3f), half,
                1e-6)
                << b;
        }
    }
}

// The polynomial of the tiles, for every depth scale that they use it for.
TEST(OpacityFit, IsTheOpacity) {
    for (float depth_scale = 1e-4f; depth_scale <= shader::kMaxFittedDepth; depth_scale *= 1.05f) {
        const float s = shader::fit_parameter(depth_scale);
        const float c[] = {shader::opacity_c0(s), shader::opacity_c1(s), shader::opacity_c2(s),
                           shader::opacity_c3(s), shader::opacity_c4(s), shader::opacity_c5(s)};
        for (float w = 0; w <= 1; w += 1.0f / 512) {
            const float fitted =
                w * w * (c[0] + w * (c[1] + w * (c[2] + w * (c[3] + w * (c[4] + w * c[5])))));
            const double exact = -std::expm1(-double(depth_scale) * double(line_integral(w)));
            EXPECT_NEAR(double(fitted), exact, 0.0006 * std::min(1.0, double(depth_scale)))
                << "depth scale " << depth_scale << ", w " << w;
        }
    }
}

TEST(AttenuationTextures, HoldTheOpacityOfEachLevel) {
    const std::vector<float> texels = attenuation_textures();
    constexpr std::size_t kSide = shader::kAttenuationTexels, kLevels = shader::kAttenuationLevels;
    ASSERT_EQ(texels.size(), 2 * kSide * kSide * kLevels);
    EXPECT_EQ(attenuation_depth_scale(0), 0.0f);
    EXPECT_EQ(attenuation_depth_scale(kLevels - 1), shader::kMaxDepthScale);
    for (const std::size_t layer : {std::size_t(1), std::size_t(20), std::size_t(63)}) {
        for (const std::size_t i : {std::size_t(0), std::size_t(30), std::size_t(50), std::size_t(63)}) {
            const double x = double(i) / 63, y = 20.0 / 63;
            const double column = reference::column_m({0, 0, 0, 1, 1}, {{x, y, -5}, {0, 0, 1}});
            const double expected = 1 - std::exp(-double(attenuation_depth_scale(int(layer))) * column);
            EXPECT_NEAR(texels[2 * ((layer * kSide + 20) * kSide + i)], expected, 1e-6) << layer << ' ' << i;
        }
    }
    for (std::size_t layer = 0; layer + 1 < kLevels; ++layer) {  // the second value is the next layer's first
        const std::size_t texel = (layer * kSide + 5) * kSide + 7;
        EXPECT_EQ(texels[2 * texel + 1], texels[2 * (texel + kSide * kSide)]) << layer;
    }
}

TEST(Daylight, FadesThroughDusk) {
    EXPECT_EQ(daylight(40).sun, 1.0);
    EXPECT_EQ(daylight(40).sky, 1.0);
    EXPECT_NEAR(daylight(0).sun, 0.5, 1e-12);
    EXPECT_EQ(daylight(-3).sun, 0.0);
    EXPECT_LT(daylight(-18).sky, 0.01);
    EXPECT_GT(daylight(-18).sky, 0.0);
    for (double e = -18; e < 90; e += 0.25) {
        EXPECT_LE(daylight(e).sun, daylight(e + 0.25).sun) << e;
        EXPECT_LE(daylight(e).sky, daylight(e + 0.25).sky) << e;
    }
}

TEST(ToneMap, IsTheIdentityThenRollsOff) {
    EXPECT_EQ(tone_map(0.0f), 0.0f);
    EXPECT_EQ(tone_map(-1.0f), 0.0f);
    EXPECT_EQ(tone_map(std::numeric_limits<float>::quiet_NaN()), 0.0f);
    EXPECT_EQ(tone_map(0.3f), 0.3f);
    EXPECT_EQ(tone_map(0.5f), 0.5f);
    EXPECT_NEAR((tone_map(0.501f) - tone_map(0.5f)) / 0.001f, 1.0f, 0.01f);
    EXPECT_LE(tone_map(1e30f), 1.0f);
    for (float x = 0; x < 4; x += 0.01f) EXPECT_LT(tone_map(x), tone_map(x + 0.01f)) << x;
    EXPECT_NEAR(encode_srgb(0.0031308f), 0.04045f, 1e-5);
    EXPECT_NEAR(encode_srgb(0.5f), 0.735357f, 1e-5);
    EXPECT_FLOAT_EQ(encode_srgb(1.0f), 1.0f);
}

// Over an 8x8 block the dither is without bias: the mean of the bytes is the exact value.
TEST(ToneMap, DitherKeepsTheMean) {
    Picture picture;
    picture.width = picture.height = 8;
    picture.beauty.assign(3 * 64, 0.2f);
    double sum = 0;
    for (const std::uint8_t byte : to_srgb8(picture, 0)) sum += byte;
    EXPECT_NEAR(sum / (3 * 64), 255.0 * double(encode_srgb(0.2f)), 0.02);
    picture.beauty.assign(3 * 64, 0.0f);
    for (const std::uint8_t byte : to_srgb8(picture, 0)) ASSERT_EQ(byte, 0);
}

// Ordered dithering: each matrix is four of half its size, with their thresholds between each other.
int bayer(int x, int y, int size) {
    constexpr int kSmallest[2][2] = {{0, 2}, {3, 1}};
    if (size == 1) return 0;
    return 4 * bayer(x % (size / 2), y % (size / 2), size / 2) + kSmallest[y / (size / 2)][x / (size / 2)];
}

// Bytes come from a table where there is no doubt about them: all are those of the formulas.
TEST(ToneMap, BytesAreThoseOfTheFormulas) {
    Picture picture;
    picture.width = 640;
    picture.height = 512;
    std::uint32_t state = 12345;  // seed
    for (std::size_t i = 0; i < 3 * picture.pixels(); ++i) {
        state = state * 1664525u + 1013904223u;
        const float random = float(state >> 8) * 0x1p-24f;
        picture.beauty.push_back(i % 3 == 0 ? random * 0.02f : i % 3 == 1 ? random : 3 * random);
    }
    const std::vector<std::uint8_t> bytes = to_srgb8(picture, 0);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < bytes.size(); ++i) {
        const int x = int(i / 3) % picture.width % 8, y = int(i / 3) / picture.width % 8;
        const float value = 255.0f * encode_srgb(tone_map(picture.beauty[i])),
                    offset = (float(bayer(x, y, 8)) + 0.5f) / 64.0f - 0.5f;
        wrong += int(bytes[i]) != int(std::clamp(std::floor(value + offset + 0.5f), 0.0f, 255.0f)) ? 1 : 0;
    }
    EXPECT_EQ(wrong, 0u);
}

TEST(ToneMap, AppliesTheExposure) {
    Picture picture;
    picture.width = picture.height = 1;
    picture.beauty = {0.05f, 0.1f, 0.2f};
    Picture doubled = picture;
    for (float& value : doubled.beauty) value *= 2;
    EXPECT_EQ(to_srgb8(picture, 1.0), to_srgb8(doubled, 0.0));
}

}  // namespace
}  // namespace nephos
