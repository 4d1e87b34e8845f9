// SPDX-License-Identifier: Apache-2.0
#pragma once

// What tests of pictures share: the camera, the three ways of drawing, and comparisons of pictures.

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "render/renderer.h"

namespace nephos::test {

// A small picture with a small shadow map.
inline RenderOptions view(Vec3 from, Vec3 to, double fov = 50, int width = 64, int height = 48,
                          int shadow_map_size = 128) {
    RenderOptions options;
    options.camera.position_m = from;
    options.camera.target_m = to;
    options.camera.vertical_fov_deg = fov;
    options.camera.width = width;
    options.camera.height = height;
    options.shadow_map_size = shadow_map_size;
    return options;
}

// A picture without clouds, of one radiance.
inline Picture grey(const Camera& camera, float value = 0.2f) {
    Picture picture;
    picture.width = camera.width;
    picture.height = camera.height;
    picture.beauty.assign(3 * picture.pixels(), value);
    picture.transmittance.assign(picture.pixels(), 1.0f);
    picture.depth_m.assign(picture.pixels(), std::numeric_limits<float>::infinity());
    return picture;
}

inline void expect_no_messages(const Renderer& renderer) {
    for (const std::string& message : renderer.validation_messages()) ADD_FAILURE() << message;
}

// With the validation layer on.
inline DeviceOptions validated(Splatting way, int part_size = 2048) {
    return {.device = {}, .validation = true, .part_size = part_size, .splatting = way};
}

// Tests that draw in every way, with the validation layer on, and fail when it says anything.
class AllBackends : public ::testing::TestWithParam<Splatting> {
  protected:
    void TearDown() override { expect_no_messages(renderer_); }
    Renderer renderer_{validated(GetParam())};
};

inline std::string way_name(const ::testing::TestParamInfo<Splatting>& way) {
    const char* const names[] = {"automatic", "cpu", "vulkan", "blended"};
    return names[std::size_t(way.param)];
}

inline float largest_difference(const std::vector<float>& a, const std::vector<float>& b) {
    EXPECT_EQ(a.size(), b.size());
    float largest = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        const float difference = a[i] == b[i] ? 0.0f : std::abs(a[i] - b[i]);  // infinities may be equal
        if (std::isnan(difference)) return difference;
        largest = std::max(largest, difference);
    }
    return largest;
}

inline bool draws_on_card(const Renderer& renderer) {
    return renderer.backend_name() != "cpu" && !renderer.device_name().starts_with("llvmpipe");
}

// Expects the pixels of two pipelines of one device to be the same. A card's driver compiles the arithmetic of each to
// roundings of its own: there they differ in the last bits.
inline void expect_same_pixels(const Renderer& renderer, const std::vector<float>& a, const std::vector<float>& b) {
    const float most = draws_on_card(renderer) ? 1e-5f * std::max(1.0f, *std::ranges::max_element(b)) : 0.0f;
    EXPECT_LE(largest_difference(a, b), most);
}

// Expects equal depths wherever both pictures have an opacity above `least_opacity`, within a relative `tolerance`
// divided by the opacity. Returns the number of pixels compared.
inline std::size_t expect_same_depths(const Picture& picture, const Picture& reference, float least_opacity,
                                      float tolerance) {
    EXPECT_EQ(picture.depth_m.size(), reference.depth_m.size());
    std::size_t compared = 0;
    for (std::size_t i = 0; i < picture.depth_m.size(); ++i) {
        const float opacity = 1.0f - reference.transmittance[i];
        if (opacity < least_opacity || 1.0f - picture.transmittance[i] < least_opacity) continue;
        EXPECT_NEAR(picture.depth_m[i] / reference.depth_m[i], 1.0f, tolerance / opacity)
            << "pixel " << i << ": " << picture.depth_m[i] << " m, expected " << reference.depth_m[i] << " m";
        ++compared;
    }
    return compared;
}

inline void expect_same_bits(const std::vector<float>& a, const std::vector<float>& b, const char* what) {
    ASSERT_EQ(a.size(), b.size()) << what;
    EXPECT_TRUE(std::ranges::equal(std::as_bytes(std::span(a)), std::as_bytes(std::span(b)))) << what;
}

inline void expect_same_bits(const Picture& a, const Picture& b) {
    expect_same_bits(a.beauty, b.beauty, "beauty");
    expect_same_bits(a.transmittance, b.transmittance, "transmittance");
    expect_same_bits(a.depth_m, b.depth_m, "depth");
    expect_same_bits(a.shadow, b.shadow, "shadow");
    expect_same_bits(a.light, b.light, "light");
}

}  // namespace nephos::test
