// SPDX-License-Identifier: Apache-2.0
// Each way of drawing T's billboards against the blended reference: alone, among metaballs, and in air.

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "tests/render/picture_checks.h"
#include "tests/render/random_billboards.h"
#include "tests/render/reference_render.h"

namespace nephos {
namespace {

class BillboardWays : public test::AllBackends {
  protected:
    void TearDown() override {
        AllBackends::TearDown();
        test::expect_no_messages(reference_);
    }

    // Close to lightning radiance is far above 1; there it is the share that counts.
    void expect_agreement(Splats splats, const RenderOptions& options) {
        const Picture fast = renderer_.draw_splats(splats, options);
        const Picture slow = reference_.draw_splats(splats, options);
        const float brightest = std::max(1.0f, *std::ranges::max_element(slow.beauty));
        // Cards filter textures with 8 bits of a texel.
        const float levels = test::draws_on_card(reference_) ? 1.25f : 1.0f;
        EXPECT_LE(test::largest_difference(fast.beauty, slow.beauty), levels * brightest / 255.0f);
        EXPECT_LE(test::largest_difference(fast.transmittance, slow.transmittance), levels / 255.0f);
        const std::size_t depths = test::expect_same_depths(fast, slow, 0.1f, 0.01f);
        EXPECT_GT(depths, slow.pixels() / 10);
        splats.light = splats.depth = false;
        test::expect_same_pixels(renderer_, renderer_.draw_splats(splats, options).beauty, fast.beauty);
    }

    Renderer reference_{test::validated(Splatting::blended)};
};

RenderOptions view(Vec3 from, Vec3 to, int width = 65, int height = 65, double fov = 40) {
    return test::view(from, to, fov, width, height, 64);
}

// From outside, from among them, from so far that all are widened, and from above.
std::vector<RenderOptions> views() {
    return {view({0, -3000, 900}, {0, 0, 1000}, 90, 70), view({0, -600, 1000}, {0, 0, 1000}, 90, 70, 60),
            view({20000, -30000, 4000}, {0, 0, 1000}, 61, 47, 5), view({0, -300, 3000}, {0, 0, 900}, 50, 75)};
}

// Of large and small textures; by day and by lightning; with metaballs between them.
TEST_P(BillboardWays, AgreesWithTheBlendedPass) {
    const std::vector<CloudBillboard> billboards = test::random_billboards(8, 400, 2);
    const std::vector<Metaball> balls = reference::random_metaballs(9, 200);
    for (const RenderOptions& options : views()) {
        for (const bool lightning : {false, true}) {
            for (const bool voxels : {false, true}) {
                Splats splats = test::scene_of(test::kBillboardClouds, billboards);
                if (voxels) splats.metaballs = {balls, 0.01, 0.7};
                if (lightning) splats.flash = Flash{{100, -200, 1000}, {0.7, 0.8, 1.0}, 2.0};
                expect_agreement(splats, options);
            }
        }
    }
}

// The clouds of T among those of D, with D's shells between all of them: light shafts, fog without any
// metaball, and both under either sky.
TEST_P(BillboardWays, AgreesWithTheBlendedPassInAir) {
    const std::vector<CloudBillboard> billboards = test::random_billboards(18, 300, 2);
    const std::vector<Metaball> balls = reference::broken_layer(7, 300, 1100);
    Splats fog_only = test::scene_of(test::kBillboardClouds, billboards), all = fog_only;
    all.metaballs = {balls, 0.02, 0.7};
    for (RenderOptions options : views()) {
        options.air.extinction_per_m = {1e-4, 1.3e-4, 2e-4};
        options.sun.elevation_deg = 25;
        options.sun.azimuth_deg = 10;
        options.shells = {24, 60, 1.12};
        options.fog.height_m = 400;
        options.fog.patch_m = 300;
        options.fog.extinction_per_m = 0.002;
        expect_agreement(fog_only, options);
        options.light_shafts.strength = 1;
        for (const AirModel model : {AirModel::gradient, AirModel::physical}) {
            options.atmosphere.model = model;
            expect_agreement(all, options);
        }
        options.fog.extinction_per_m = 0;
        expect_agreement(all, options);
    }
}

// More splats, of both kinds, than compute tiles draw at once on a processor, or let a shader loop over.
TEST_P(BillboardWays, BatchesDoNotShow) {
    std::vector<CloudBillboard> billboards = test::random_billboards(28, 60'000, 2);
    for (CloudBillboard& each : billboards) {
        each.width_m = each.height_m = 60;
        each.opacity *= 0.02f;
    }
    std::vector<Metaball> balls = reference::random_metaballs(29, 30'000, 30, 60);
    for (Metaball& ball : balls) ball.y += 1800;  // few billboards among them: the reference is slow there
    Splats splats = test::scene_of(test::kBillboardClouds, billboards);
    splats.metaballs = {balls, 1e-4, 0.7};
    splats.depth = splats.light = false;
    const RenderOptions options = view({0, -30000, 900}, {0, 0, 1000}, 8, 8, 4);
    const Picture fast = renderer_.draw_splats(splats, options),
                  slow = reference_.draw_splats(splats, options);
    EXPECT_LE(test::largest_difference(fast.beauty, slow.beauty), 1.0f / 255.0f);
    EXPECT_LE(test::largest_difference(fast.transmittance, slow.transmittance), 1.0f / 255.0f);
    const float least = *std::ranges::min_element(slow.transmittance);
    EXPECT_GT(least, 0.01f);  // the last batch is seen
    EXPECT_LT(least, 0.8f);
}

// Parts of the picture do not show, in air neither.
TEST_P(BillboardWays, PartsOfThePictureDoNotShow) {
    const std::vector<CloudBillboard> billboards = test::random_billboards(38, 300, 2);
    const std::vector<Metaball> balls = reference::broken_layer(17, 300, 1100);
    Splats splats = test::scene_of(test::kBillboardClouds, billboards);
    splats.metaballs = {balls, 0.02, 0.7};
    Renderer parts(test::validated(GetParam(), 32));
    RenderOptions options = views()[0];
    for (const double strength : {0.0, 1.0}) {
        options.light_shafts.strength = strength;
        EXPECT_LE(test::largest_difference(renderer_.draw_splats(splats, options).beauty,
                                           parts.draw_splats(splats, options).beauty),
                  5e-4f);
    }
    test::expect_no_messages(parts);
}

INSTANTIATE_TEST_SUITE_P(Ways, BillboardWays, ::testing::Values(Splatting::cpu, Splatting::vulkan),
                         test::way_name);

}  // namespace
}  // namespace nephos
