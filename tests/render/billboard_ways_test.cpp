// SPDX-License-Identifier: Apache-2.0
// Each way of drawing T's billboards against the blended reference: alone, among metaballs, and in air.

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "tests/render/picture_checks.h"
#include "tests/render/random_billboards.h"
#include "tests/render/reference_render.h"

namespace nephos {
namespace {

class BillboardWays : public test::EveryWay {
  protected:
    void TearDown() override {
        EveryWay::TearDown();
        test::expect_no_messages(reference_);
    }

    // Close to lightning radiance is far above 1; there it is the share that counts.
    void expect_agreement(Splats splats, const RenderOptions& options) {
        const Picture fast = renderer_.draw_splats(splats, options);
        const Picture slow = reference_.draw_splats(splats, options);
        const float brightest = std::max(1.0f, *std::ranges::max_element(slow.beauty));
        EXPECT_LE(test::largest_difference(fast.beauty, slow.beauty), brightest / 255.0f);
        EXPECT_LE(test::largest_difference(fast.transmittance, slow.transmittance), 1.0f / 255.0f);
        for (std::size_t i = 0; i < fast.depth_m.size(); ++i) {
            if (slow.transmittance[i] > 0.9f || fast.transmittance[i] > 0.9f) continue;
            const float opacity = 1.0f - slow.transmittance[i];
            ASSERT_NEAR(fast.depth_m[i] / slow.depth_m[i], 1.0f, 0.01f / opacity) << i;
        }
        splats.light = splats.depth = false;
        EXPECT_EQ(renderer_.draw_splats(splats, options).beauty, fast.beauty);
    }

    Renderer reference_{test::validated(Splatting::billboards)};
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

// The clouds of T among those of D, with D's shells between all of them: light shafts, fog, and both; under
// either sky; and fog without any metaball.
TEST_P(BillboardWays, AgreesWithTheBlendedPassInAir) {
    const std::vector<CloudBillboard> billboards = test::random_billboards(18, 300, 2);
    const std::vector<Metaball> balls = reference::broken_layer(7, 300, 1100);
    for (RenderOptions options : views()) {
        options.air.extinction_per_m = {1e-4, 1.3e-4, 2e-4};
        options.sun.elevation_deg = 25;
        options.sun.azimuth_deg = 10;
        options.shells = {40, 40, 1.08};
        options.fog.height_m = 400;
        options.fog.patch_m = 300;
        for (const AirModel model : {AirModel::gradient, AirModel::physical}) {
            options.atmosphere.model = model;
            for (const bool shafts : {false, true}) {
                for (const bool fog : {false, true}) {
                    if (!shafts && !fog) continue;
                    options.light_shafts.strength = shafts ? 1 : 0;
                    options.fog.extinction_per_m = fog ? 0.002 : 0;
                    Splats splats = test::scene_of(test::kBillboardClouds, billboards);
                    if (shafts) splats.metaballs = {balls, 0.02, 0.7};
                    expect_agreement(splats, options);
                }
            }
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Ways, BillboardWays, ::testing::Values(Splatting::processor, Splatting::tiles),
                         test::way_name);

}  // namespace
}  // namespace nephos
