// SPDX-License-Identifier: Apache-2.0
// Light that is computed only where it is seen, and only when it has changed, gives the same pictures.

#include <vector>

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "tests/render/renderer_test_access.h"
#include "tests/reference/with_threads.h"
#include "tests/render/picture_checks.h"
#include "tests/render/reference_render.h"
#include "tests/render/voxel_cloud.h"

namespace nephos {
namespace {

RenderOptions from(const Vec3& eye) {
    RenderOptions options;
    options.camera.position_m = eye;
    options.camera.target_m = {0, 0, 700};
    options.camera.width = 160;
    options.camera.height = 120;
    options.shadow_map_size = 256;
    return options;
}

// From the side with the ground in view, from within, and from above.
std::vector<RenderOptions> cameras() {
    return {from({0, -4000, 400}), from({50, 60, 1000}), from({-900, -700, 3500})};
}

Picture draw(Renderer& renderer, const MetaballCloud& cloud, const RenderOptions& options, bool light) {
    Splats splats;
    splats.metaballs = cloud;
    splats.light = light;
    return renderer.draw_splats(splats, options);
}

void expect_same_pixels(const Picture& a, const Picture& b) {
    EXPECT_EQ(a.beauty, b.beauty);
    EXPECT_EQ(a.transmittance, b.transmittance);
    EXPECT_EQ(a.depth_m, b.depth_m);
}

class CachedLight : public ::testing::TestWithParam<Splatting> {
  protected:
    static DeviceOptions device() { return {.device = {}, .splatting = GetParam()}; }
    std::vector<Metaball> balls_ = reference::random_metaballs(21, 900);
};

// In a thin cloud nearly everything is seen, in an opaque one little. Each camera twice: first with a
// renderer that sees the cloud for the first time, then with one that has seen it from elsewhere.
TEST_P(CachedLight, WhatIsNotSeenDoesNotShow) {
    for (const double extinction : {0.001, 0.02, 3.0}) {
        const MetaballCloud cloud{balls_, extinction, 0.7};
        Renderer is_pending(device());
        for (const RenderOptions& options : cameras()) {
            SCOPED_TRACE(extinction);
            Renderer first(device()), whole(device());
            const Picture expected = draw(whole, cloud, options, true);
            const Picture seen = draw(first, cloud, options, false);
            EXPECT_TRUE(seen.light.empty() && seen.shadow.empty());
            expect_same_pixels(seen, expected);
            expect_same_pixels(draw(is_pending, cloud, options, false), expected);
            const Picture all = draw(is_pending, cloud, options, true);
            EXPECT_EQ(all.light, expected.light);
            EXPECT_EQ(all.shadow, expected.shadow);
        }
    }
}

TEST_P(CachedLight, ThreadsDoNotChangeTheBits) {
    const MetaballCloud cloud{balls_, 0.02, 0.7};
    const RenderOptions options = cameras().front();
    const auto drawn = [&] {
        Renderer renderer(device());
        return draw(renderer, cloud, options, false);
    };
    const Picture expected = drawn();
    for (const int threads : {1, 3, 8})
        expect_same_pixels(test::with_threads(std::size_t(threads), drawn), expected);
}

TEST_P(CachedLight, IsComputedWhenSomethingChanged) {
    Renderer renderer(device());
    const auto passes = [&](const MetaballCloud& cloud, const RenderOptions& options) {
        const std::size_t before = RendererTestAccess::light_passes(renderer);
        const Picture picture = draw(renderer, cloud, options, false);
        Renderer fresh(device());
        expect_same_pixels(picture, draw(fresh, cloud, options, true));
        return RendererTestAccess::light_passes(renderer) - before;
    };
    RenderOptions options = cameras()[0];
    const MetaballCloud cloud{balls_, 0.02, 0.7};
    EXPECT_EQ(passes(cloud, options), 1u);
    EXPECT_EQ(passes(cloud, options), 0u) << "nothing changed";
    EXPECT_LE(passes(cloud, cameras()[1]), 1u) << "the rest, when the camera moves for the first time";
    EXPECT_EQ(passes(cloud, cameras()[2]), 0u) << "then nothing any more";
    const std::vector<Metaball> copy = balls_;
    EXPECT_EQ(passes({copy, 0.02, 0.7}, options), 0u) << "the same values elsewhere";

    balls_[450].density *= 0.5f;
    EXPECT_EQ(passes(cloud, options), 1u) << "density";
    balls_[3].x += 20;
    EXPECT_EQ(passes(cloud, options), 1u) << "place";
    EXPECT_EQ(passes({balls_, 0.03, 0.7}, options), 1u) << "extinction";
    options.sun.elevation_deg += 5;
    EXPECT_EQ(passes({balls_, 0.03, 0.7}, options), 1u) << "sun";
    options.shadow_map_size = 128;
    EXPECT_EQ(passes({balls_, 0.03, 0.7}, options), 1u) << "shadow map";
    options.light.lighting = Lighting::cfa;
    EXPECT_EQ(passes({balls_, 0.03, 0.7}, options), 1u) << "lighting";
    EXPECT_EQ(passes({balls_, 0.03, 0.7}, options), 0u);
    options.light.light_distance_m = 50;
    EXPECT_EQ(passes({balls_, 0.03, 0.7}, options), 1u) << "light distance";
    options.light.phase.g = 0.3;
    EXPECT_EQ(passes({balls_, 0.03, 0.7}, options), 0u) << "the phase function is the view's";
}

// From another eye level of detail merges other metaballs. Fog between billboards looks at the shadow map on
// the device, in every way of drawing.
TEST_P(CachedLight, OtherMergedMetaballsHaveAnotherShadow) {
    const std::vector<Metaball> voxels = test::ragged_cloud();
    const BillboardCloud billboards{{0, 0, 1000}, 600, 1400};
    CloudBillboard billboard;
    billboard.centre_m = {500, -300, 900};
    billboard.width_m = billboard.height_m = 200;
    Splats splats;
    splats.metaballs = {voxels, 0.15, test::kVoxelNormalisation};
    splats.clouds = {&billboards, 1};
    splats.billboards = {&billboard, 1};
    splats.light = false;
    for (const Lighting lighting : {Lighting::light_pass, Lighting::cfa}) {
        Renderer is_pending(device());
        for (const double y : {-9000, -1500}) {
            RenderOptions options = from({0, y, 900});
            options.level_of_detail.pixels = 8;
            options.light.lighting = lighting;
            options.fog.extinction_per_m = 0.0005;
            options.fog.height_m = 2000;
            Renderer fresh(device());
            expect_same_pixels(is_pending.draw_splats(splats, options), fresh.draw_splats(splats, options));
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Ways, CachedLight,
                         ::testing::Values(Splatting::cpu, Splatting::vulkan, Splatting::blended),
                         test::way_name);

}  // namespace
}  // namespace nephos
