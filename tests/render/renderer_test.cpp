// SPDX-License-Identifier: Apache-2.0
// The promises of renderer.h: the same bits, cameras and light the right way round, limits.

#include "render/renderer.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/reference/with_threads.h"
#include "tests/render/picture_checks.h"
#include "tests/render/reference_render.h"
#include "tests/render/renderer_views.h"

namespace nephos {
namespace {

class RendererTest : public test::AllBackends {};

TEST_P(RendererTest, TwoRunsGiveTheSameBits) {
    const std::vector<Metaball> balls = reference::lattice_cloud(20, 50);
    const MetaballCloud cloud{balls, 0.02, reference::kNormalisationTwoCells};
    const RenderOptions options = test::view({0, -2000, 800}, {0, 0, 1000}, 50, 160, 120);
    const Picture first = renderer_.draw(cloud, options);
    renderer_.draw(
        {}, test::view({0, -2000, 800}, {0, 0, 1000}, 50, 32, 200));  // what is kept in between must not show
    test::expect_same_bits(first, renderer_.draw(cloud, options));
    Renderer other(test::validated(GetParam()));
    test::expect_same_bits(first, other.draw(cloud, options));
}

TEST_P(RendererTest, ThreadsDoNotChangeTheBits) {
    const std::vector<Metaball> balls = reference::lattice_cloud(20, 50);
    const MetaballCloud cloud{balls, 0.02, reference::kNormalisationTwoCells};
    for (const RenderOptions& options : {test::view({0, -2000, 800}, {0, 0, 1000}, 50, 160, 120),
                                         test::view({0, -300, 800}, {0, 0, 1000}, 80, 160, 120)}) {
        const auto draw = [&](std::size_t threads) {
            return test::with_threads(threads, [&] { return renderer_.draw(cloud, options); });
        };
        const Picture one = draw(1);
        test::expect_same_bits(one, draw(2));
        test::expect_same_bits(one, draw(7));
    }
}

// No metaballs, metaballs without density, and a cloud without extinction: all the bare background, bit for
// bit.
TEST_P(RendererTest, EmptyCloudGivesTheBareBackground) {
    for (const test::View& each : test::views()) {
        const Picture background = renderer_.draw({}, each.options);
        std::vector<Metaball> balls = reference::random_metaballs(4, 50);
        const Picture transparent = renderer_.draw({balls, 0.0, 1.0}, each.options);
        for (Metaball& ball : balls) ball.density = 0;
        const Picture empty = renderer_.draw({balls, 0.02, 1.0}, each.options);
        test::expect_same_bits(background.beauty, empty.beauty, each.name);
        test::expect_same_bits(background.beauty, transparent.beauty, each.name);
        for (const Picture* picture : {&background, &empty, &transparent}) {
            for (const float value : picture->transmittance) ASSERT_EQ(value, 1.0f) << each.name;
            for (const float value : picture->depth_m)
                ASSERT_EQ(value, std::numeric_limits<float>::infinity());
            for (const float value : picture->shadow) ASSERT_EQ(value, 1.0f) << each.name;
        }
        for (const float value : empty.light) ASSERT_EQ(value, 1.0f);
    }
}

// Octaves light what single scattering leaves dark, and no table is left over from another light.
TEST_P(RendererTest, OctavesBrightenThickClouds) {
    const std::vector<Metaball> balls = reference::lattice_cloud(20, 50);
    const MetaballCloud cloud{balls, 0.1, reference::kNormalisationTwoCells};
    RenderOptions options = test::view({0, -2000, 800}, {0, 0, 1000}, 50, 64, 48);
    options.light.multiple = MultipleScattering::octaves;
    options.light.ambient_base = options.light.ambient_top = {0, 0, 0};
    const auto total = [&](int octaves) {
        options.light.octaves.count = octaves;
        const Picture picture = renderer_.draw(cloud, options);
        double sum = 0;
        for (std::size_t i = 0; i < picture.pixels(); ++i)
            if (picture.transmittance[i] < 0.1f) sum += double(picture.beauty[3 * i]);
        return sum;
    };
    const double one = total(1), two = total(2), eight = total(8);
    EXPECT_GT(one, 0);
    EXPECT_GT(two, 1.1 * one);
    EXPECT_GT(eight, 1.1 * two);
    EXPECT_EQ(total(1), one);
}

// The background itself, against its formulas: sky gradient above, ground below, the horizon at the eye's
// height.
TEST_P(RendererTest, HorizonLiesAtTheHeightOfTheEye) {
    RenderOptions options = test::view({0, 0, 2}, {0, 1000, 2}, 40, 11, 400);
    options.air.extinction_per_m = {0, 0, 0};
    const Picture picture = renderer_.draw({}, options);
    const auto is_ground = [&](int row) {
        const float* pixel = &picture.beauty[3 * (std::size_t(row) * 11 + 5)];
        const double expected =
            options.ground.albedo[0] * 0.5 * (options.air.horizon[0] + options.air.zenith[0]) +
            options.ground.albedo[0] * options.sun.colour[0] *
                std::sin(options.sun.elevation_deg * std::numbers::pi / 180);
        return std::abs(double(pixel[0]) - expected) < 1e-5;
    };
    for (int row = 0; row < 200; ++row) ASSERT_FALSE(is_ground(row)) << row;
    for (int row = 200; row < 400; ++row) ASSERT_TRUE(is_ground(row)) << row;
    // Looking up, the sky's zenith is in the middle.
    RenderOptions up = test::view({0, 0, 2}, {0, 0, 1000}, 40, 33, 33);
    const Picture sky = renderer_.draw({}, up);
    for (std::size_t c = 0; c < 3; ++c)
        EXPECT_NEAR(double(sky.beauty[3 * (16 * 33 + 16) + c]), up.air.zenith[c], 1e-3);
    // With air, the ground takes on the horizon's colour, seamlessly.
    RenderOptions hazy = test::view({0, 0, 2}, {0, 1000, 2}, 0.1 * 50, 3, 401);
    hazy.air.extinction_per_m = {1e-2, 1e-2, 1e-2};
    const Picture haze = renderer_.draw({}, hazy);
    for (std::size_t c = 0; c < 3; ++c)
        EXPECT_NEAR(double(haze.beauty[3 * (202 * 3 + 1) + c]), hazy.air.horizon[c], 1e-2);
}

// Looking north, a metaball in the east is on the right, one above the axis in the upper half.
TEST_P(RendererTest, EastIsRightAndUpIsUp) {
    const auto centroid = [&](const std::vector<Metaball>& balls, const RenderOptions& options) {
        const Picture picture = renderer_.draw({balls, 0.05, 1.0}, options);
        double x = 0, y = 0, weight = 0;
        for (int row = 0; row < picture.height; ++row) {
            for (int column = 0; column < picture.width; ++column) {
                const double opacity =
                    1 - double(picture.transmittance[std::size_t(row * picture.width + column)]);
                x += opacity * (column + 0.5);
                y += opacity * (row + 0.5);
                weight += opacity;
            }
        }
        return Vec3{x / weight, y / weight, weight};
    };
    RenderOptions north = test::view({0, 0, 1000}, {0, 5000, 1000}, 90, 200, 100);
    const Vec3 east = centroid({{500, 1000, 1000, 50, 1}}, north);
    EXPECT_NEAR(east.x, 125, 0.5);  // tan = 1/2 of a half width of 2
    EXPECT_NEAR(east.y, 50, 0.5);
    const Vec3 high = centroid({{0, 1000, 1500, 50, 1}}, north);
    EXPECT_NEAR(high.x, 100, 0.5);
    EXPECT_NEAR(high.y, 25, 0.5);
    RenderOptions down = test::view({0, 0, 5000}, {0, 0, 0}, 90, 100, 100);
    const Vec3 north_east = centroid({{1000, 500, 3000, 50, 1}}, down);
    EXPECT_NEAR(north_east.x, 75, 0.5);
    EXPECT_NEAR(north_east.y, 37.5, 0.5);
}

// The shadow of a metaball lies on the ground where the sun's ray through its centre ends.
TEST_P(RendererTest, ShadowFallsAwayFromTheSun) {
    const std::vector<Metaball> ball{{300, -200, 1000, 150, 1}};
    RenderOptions options = test::view({0, 0, 6000}, {0, 0, 0}, 60, 121, 121);
    options.sun.elevation_deg = 45;
    options.sun.azimuth_deg = 90;  // in the east: the shadow moves 1000 m to the west
    const Picture with = renderer_.draw({ball, 0.05, 1.0}, options);
    const Picture without = renderer_.draw({}, options);
    double x = 0, y = 0, weight = 0;
    for (int row = 0; row < 121; ++row) {
        for (int column = 0; column < 121; ++column) {
            const std::size_t i = std::size_t(row * 121 + column);
            if (with.transmittance[i] < 1.0f) continue;
            const double darker = double(without.beauty[3 * i]) - double(with.beauty[3 * i]);
            ASSERT_GE(darker, -1e-6);
            x += darker * (column + 0.5);
            y += darker * (row + 0.5);
            weight += darker;
        }
    }
    const double pixels_per_m = 60.5 / (6000 * std::tan(30 * std::numbers::pi / 180));
    EXPECT_NEAR(x / weight, 60.5 - 700 * pixels_per_m, 0.5);
    EXPECT_NEAR(y / weight, 60.5 + 200 * pixels_per_m, 0.5);
}

TEST_P(RendererTest, DepthIsTheDistanceToTheCloud) {
    const RenderOptions options = test::view({0, 0, 1000}, {0, 3000, 1000}, 60, 33, 33);
    const std::vector<Metaball> near_and_far{{0, 1000, 1000, 100, 1}, {0, 2000, 1000, 100, 1}};
    const std::size_t middle = 16 * 33 + 16;
    // Opaque: the near one hides the far one. Thin: the mean of both.
    EXPECT_NEAR(renderer_.draw({near_and_far, 1.0, 1.0}, options).depth_m[middle], 1000, 1);
    EXPECT_NEAR(renderer_.draw({near_and_far, 1e-4, 1.0}, options).depth_m[middle], 1500, 10);
    EXPECT_EQ(renderer_.draw({near_and_far, 1.0, 1.0}, options).depth_m[0],
              std::numeric_limits<float>::infinity());
}

// A picture of many tiles is the picture of one.
TEST_P(RendererTest, TilesDoNotShow) {
    const std::vector<Metaball> balls = reference::lattice_cloud(20, 50);
    const MetaballCloud cloud{balls, 0.02, reference::kNormalisationTwoCells};
    const RenderOptions options = test::view({0, -1500, 800}, {0, 0, 1000}, 60, 150, 101);
    const Picture whole = renderer_.draw(cloud, options);
    Renderer tiled(test::validated(GetParam(), 32));
    const Picture parts = tiled.draw(cloud, options);
    for (std::size_t i = 0; i < whole.beauty.size(); ++i)
        ASSERT_NEAR(whole.beauty[i], parts.beauty[i], 1e-4) << i;
    for (std::size_t i = 0; i < whole.pixels(); ++i)
        ASSERT_NEAR(whole.transmittance[i], parts.transmittance[i], 1e-4) << i;
    test::expect_no_messages(tiled);
}

// Flying into and through a cloud: the picture changes little between neighbouring frames, whatever metaballs
// the eye enters or leaves on the way.
TEST_P(RendererTest, FlyingThroughACloudDoesNotPop) {
    const std::vector<Metaball> balls = reference::lattice_cloud(12, 50);
    const MetaballCloud cloud{balls, 0.01, reference::kNormalisationTwoCells};
    Picture before;
    for (int step = 0; step < 60; ++step) {
        const double y = -270.0 + 1.0 * step;
        const Picture now = renderer_.draw(cloud, test::view({13, y, 1010}, {13, y + 100, 1015}, 60, 40, 30));
        if (step > 0) {
            for (std::size_t i = 0; i < now.pixels(); ++i)
                ASSERT_NEAR(now.transmittance[i], before.transmittance[i], 0.015) << step << ' ' << i;
            for (std::size_t i = 0; i < now.beauty.size(); ++i)
                ASSERT_NEAR(now.beauty[i], before.beauty[i], 0.015) << step << ' ' << i;
        }
        before = now;
    }
}

// White where the sun shines on it, grey-blue at its base, never black and never beyond the tone curve's
// reach.
TEST_P(RendererTest, ThickCloudIsWhiteAboveAndGreyBelow) {
    const std::vector<Metaball> balls = reference::lattice_cloud(24, 50);
    const MetaballCloud cloud{balls, 0.02, reference::kNormalisationTwoCells};
    const auto middle = [&](const RenderOptions& options) {
        const Picture picture = renderer_.draw(cloud, options);
        EXPECT_LT(picture.transmittance[12 * 25 + 12], 0.01f);
        const float* pixel = &picture.beauty[3 * (12 * 25 + 12)];
        return Vec3{pixel[0], pixel[1], pixel[2]};
    };
    RenderOptions above = test::view({0, -1500, 3500}, {0, 0, 1100}, 20, 25, 25);
    above.sun.azimuth_deg = 180;  // behind the camera
    const Vec3 top = middle(above);
    EXPECT_GT(top.x, 0.7);
    EXPECT_LT(top.x, 1.5);
    EXPECT_NEAR(top.z / top.x, 1.0, 0.2);
    const Vec3 base = middle(test::view({0, 0, 2}, {0, 0, 1000}, 20, 25, 25));
    EXPECT_GT(base.x, 0.15);
    EXPECT_LT(base.x, 0.5 * top.x);
    EXPECT_GT(base.z, base.x);
}

// The sun below the horizon: no direct light, a dark sky, but finite values everywhere.
TEST_P(RendererTest, NightIsDarkAndFinite) {
    const std::vector<Metaball> balls = reference::lattice_cloud(12, 50);
    RenderOptions options = test::view({0, -1500, 800}, {0, 0, 1000});
    double brighter = std::numeric_limits<double>::infinity();
    for (const double elevation : {90.0, 5.0, 0.0, -6.0, -18.0}) {
        options.sun.elevation_deg = elevation;
        const Picture picture = renderer_.draw({balls, 0.02, reference::kNormalisationTwoCells}, options);
        double sum = 0;
        for (const float value : picture.beauty) {
            ASSERT_TRUE(std::isfinite(value) && value >= 0);
            sum += double(value);
        }
        EXPECT_LT(sum, brighter) << elevation;
        brighter = sum;
    }
}

TEST_P(RendererTest, BadInputIsAnErrorAndTheRendererLivesOn) {
    const RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000});
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const auto fails = [&](const Metaball& ball) {
        const std::vector<Metaball> balls{ball};
        EXPECT_THROW(renderer_.draw({balls, 0.02, 1.0}, options), Error);
    };
    fails({0, 0, nan, 10, 1});
    fails({0, 0, 0, 0, 1});
    fails({0, 0, 0, -1, 1});
    fails({0, 0, 0, 10, nan});
    EXPECT_THROW(renderer_.draw({{}, -1.0, 1.0}, options), Error);
    RenderOptions wrong = options;
    wrong.camera.width = 0;
    EXPECT_THROW(renderer_.draw({}, wrong), Error);
    EXPECT_NO_THROW(renderer_.draw({}, options));
}

TEST_P(RendererTest, OnePixelAndExtremeShapes) {
    const std::vector<Metaball> balls = reference::random_metaballs(9, 20);
    for (const auto& [width, height] : {std::pair{1, 1}, {1, 300}, {5000, 1}}) {
        const Picture picture =
            renderer_.draw({balls, 0.02, 1.0}, test::view({0, -4000, 800}, {0, 0, 1000}, 50, width, height));
        EXPECT_EQ(picture.pixels(), std::size_t(width) * std::size_t(height));
        for (const float value : picture.beauty) ASSERT_TRUE(std::isfinite(value));
    }
}

INSTANTIATE_TEST_SUITE_P(Ways, RendererTest,
                         ::testing::Values(Splatting::cpu, Splatting::vulkan, Splatting::blended),
                         test::way_name);

}  // namespace
}  // namespace nephos
