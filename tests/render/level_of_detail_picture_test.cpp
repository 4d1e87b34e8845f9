// SPDX-License-Identifier: Apache-2.0
// Pictures with level of detail: close to those without, the same in all ways of drawing, without popping.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "tests/render/renderer_test_access.h"
#include "tests/render/picture_checks.h"
#include "tests/render/voxel_cloud.h"

namespace nephos {
namespace {

class LevelOfDetailPicture : public test::AllBackends {
  protected:
    Picture draw(const RenderOptions& options, bool light = false) { return draw(renderer_, options, light); }
    Picture draw(Renderer& renderer, const RenderOptions& options, bool light = false) const {
        Splats splats;
        splats.metaballs = {balls_, 0.15, test::kVoxelNormalisation};
        splats.light = light;
        return renderer.draw_splats(splats, options);
    }
    std::vector<Metaball> balls_ = test::ragged_cloud();
};

RenderOptions from(const Vec3& eye, bool detail = true) {
    RenderOptions options;
    options.camera.position_m = eye;
    options.camera.target_m = {0, 0, 900};
    options.camera.width = 96;
    options.camera.height = 72;
    options.shadow_map_size = 256;
    if (!detail) options.level_of_detail.pixels = 0;
    return options;
}

struct Difference {
    double mean = 0, largest = 0;
};

Difference difference(const std::vector<float>& a, const std::vector<float>& b) {
    EXPECT_EQ(a.size(), b.size());
    Difference result;
    for (std::size_t i = 0; i < a.size(); ++i) {
        const double difference = std::abs(double(a[i]) - double(b[i]));
        result.mean += difference / double(a.size());
        result.largest = std::max(result.largest, difference);
    }
    return result;
}

// From the side, from above, from within and from afar.
std::vector<Vec3> eyes() { return {{0, -2200, 500}, {-700, -500, 2400}, {30, 40, 900}, {-4000, -9000, 400}}; }

TEST_P(LevelOfDetailPicture, IsCloseToFullDetail) {
    EXPECT_NE(draw(from(eyes().front())).beauty, draw(from(eyes().front(), false)).beauty);
    for (const Vec3& eye : eyes()) {
        const Picture less = draw(from(eye)), full = draw(from(eye, false));
        const Difference beauty = difference(less.beauty, full.beauty),
                         through = difference(less.transmittance, full.transmittance);
        std::printf("mean %.2f / 255, largest %.1f / 255; transmittance %.2f / 255\n", 255 * beauty.mean,
                    255 * beauty.largest, 255 * through.mean);
        EXPECT_LT(beauty.mean, 1.5 / 255) << "rougher than what the automaton grows";
        EXPECT_LT(through.mean, 1.0 / 255);
        std::size_t opaque = 0;
        for (std::size_t i = 0; i < full.pixels(); ++i) {
            if (full.transmittance[i] > 0.5f) continue;
            ASSERT_NEAR(less.depth_m[i], full.depth_m[i], 80) << "a block";
            ++opaque;
        }
        EXPECT_GE(opaque, 20u);
    }
}

TEST_P(LevelOfDetailPicture, AgreesWithBillboards) {
    Renderer reference(test::validated(Splatting::blended));
    for (const Vec3& eye : eyes()) {
        const Picture fast = draw(from(eye)), slow = draw(reference, from(eye));
        EXPECT_LE(difference(fast.beauty, slow.beauty).largest, 1.0 / 255);
        EXPECT_LE(difference(fast.transmittance, slow.transmittance).largest, 1.0 / 255);
    }
    test::expect_no_messages(reference);
}

// Whoever asks for the light gets that of the metaballs that he gave, and the same picture.
TEST_P(LevelOfDetailPicture, LightIsThatOfFullDetail) {
    for (const Lighting lighting : {Lighting::light_pass, Lighting::cfa}) {
        RenderOptions options = from(eyes().front()), whole = from(eyes().front(), false);
        options.light.lighting = whole.light.lighting = lighting;
        const Picture asked = draw(options, true), plain = draw(options), full = draw(whole, true);
        EXPECT_EQ(asked.beauty, plain.beauty);
        ASSERT_EQ(asked.light.size(), balls_.size());
        EXPECT_EQ(asked.light, full.light);
        EXPECT_EQ(asked.shadow, full.shadow);
        EXPECT_EQ(asked.shadow_frame.origin_m, full.shadow_frame.origin_m);
    }
}

// A still eye keeps the light, a moving one too if nothing is merged; else it is computed for what is.
TEST_P(LevelOfDetailPicture, LightIsKeptWhereNothingChanges) {
    const auto passes = [&](const Vec3& eye, double pixels) {
        const std::size_t before = RendererTestAccess::light_passes(renderer_);
        RenderOptions options = from(eye);
        options.level_of_detail.pixels = pixels;
        draw(options);
        return RendererTestAccess::light_passes(renderer_) - before;
    };
    for (const double pixels : {0.0, 0.01}) {
        EXPECT_EQ(passes({0, -1500, 900}, 50), 1u);
        EXPECT_EQ(passes({0, -1500, 900}, pixels), 1u);
        EXPECT_LE(passes({0, -1510, 900}, pixels), 1u) << "what the first did not see";
        EXPECT_EQ(passes({0, -1520, 900}, pixels), 0u);
    }
    EXPECT_EQ(passes({0, -3000, 900}, 2.5), 1u) << "merged";
    EXPECT_LE(passes({0, -3000, 900}, 2.5), 1u);
    EXPECT_EQ(passes({0, -3000, 900}, 2.5), 0u);
    EXPECT_EQ(passes({0, -3010, 900}, 2.5), 1u) << "merged otherwise";
}

// Metre by metre through the band in which blocks take the place of voxels: from picture to picture no pixel
// changes by more than without level of detail, but for the fade itself.
TEST_P(LevelOfDetailPicture, MovingEyeDoesNotPop) {
    Picture before, full_before;
    double largest = 0, largest_full = 0;
    for (int step = 0; step < 12; ++step) {
        const double y = -1300 - step;
        const Picture now = draw(from({0, y, 700})), full = draw(from({0, y, 700}, false));
        if (step > 0) {
            largest = std::max(largest, difference(now.beauty, before.beauty).largest);
            largest_full = std::max(largest_full, difference(full.beauty, full_before.beauty).largest);
        }
        before = now;
        full_before = full;
    }
    std::printf("largest change in a metre: %.3f / 255, at full detail %.3f / 255\n", 255 * largest,
                255 * largest_full);
    EXPECT_LT(largest, largest_full + 1.0 / 255);
}

INSTANTIATE_TEST_SUITE_P(Ways, LevelOfDetailPicture,
                         ::testing::Values(Splatting::cpu, Splatting::vulkan, Splatting::blended),
                         test::way_name);

}  // namespace
}  // namespace nephos
