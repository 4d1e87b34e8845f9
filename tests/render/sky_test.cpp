// SPDX-License-Identifier: Apache-2.0
// The physical sky in pictures: the same in every way of drawing, at every height of the sun.

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "render/atmosphere/atmosphere.h"
#include "render/renderer.h"
#include "tests/render/picture_checks.h"
#include "tests/render/reference_render.h"

namespace nephos {
namespace {

RenderOptions under_sky(double elevation_deg, Vec3 from = {0, -4000, 800}, Vec3 to = {0, 0, 1000}) {
    RenderOptions options;
    options.atmosphere.model = AirModel::physical;
    options.sun.elevation_deg = elevation_deg;
    options.sun.azimuth_deg = 20;
    options.camera.position_m = from;
    options.camera.target_m = to;
    options.camera.width = 48;
    options.camera.height = 36;
    options.shadow_map_size = 64;
    return options;
}

// From the side, from below, down from above, and towards the sun; some metaballs are integrated.
TEST(Sky, IsTheSameInEveryBackend) {
    Renderer processor(test::validated(Splatting::cpu)), tiles(test::validated(Splatting::vulkan)),
        billboards(test::validated(Splatting::blended));
    const std::vector<Metaball> balls = reference::random_metaballs(7, 150, 80, 250);
    const MetaballCloud cloud{balls, 0.01, 0.7};
    float of_processor = 0, of_tiles = 0;
    for (const double elevation : {-12.0, -3.0, 0.0, 4.0, 30.0, 90.0})
        for (const RenderOptions& options :
             {under_sky(elevation), under_sky(elevation, {100, 200, 10}, {400, 900, 1200}),
              under_sky(elevation, {-800, -500, 9000}, {0, 0, 800})}) {
            const Picture expected = billboards.draw(cloud, options);
            of_processor =
                std::max(of_processor,
                         test::largest_difference(processor.draw(cloud, options).beauty, expected.beauty));
            of_tiles = std::max(of_tiles,
                                test::largest_difference(tiles.draw(cloud, options).beauty, expected.beauty));
            EXPECT_LE(of_processor, 1.0f / 255) << "sun at " << elevation;
            EXPECT_LE(of_tiles, 1.0f / 255) << "sun at " << elevation;
            for (const float value : expected.beauty) ASSERT_TRUE(std::isfinite(value) && value >= 0);
        }
    std::printf("against billboards: processor %.5f, tiles %.5f\n", double(of_processor), double(of_tiles));
    for (const Renderer* renderer : {&processor, &tiles, &billboards}) test::expect_no_messages(*renderer);
}

// The ground melts into the sky: up a column of pixels across the horizon nothing jumps.
TEST(Sky, HasNoSeamAtTheHorizon) {
    Renderer renderer({{}, false, 2048, Splatting::cpu});
    for (const double elevation : {-4.0, 3.0, 50.0}) {
        RenderOptions options = under_sky(elevation, {0, 0, 200}, {0, 1000, 200});
        options.sun.azimuth_deg = 120;
        options.camera.vertical_fov_deg = 1;
        options.camera.width = 1;
        options.camera.height = 800;
        const Picture picture = renderer.draw({}, options);
        float most = 0;
        for (const float value : picture.beauty) most = std::max(most, value);
        for (std::size_t row = 390; row < 410; ++row)
            for (std::size_t c = 0; c < 3; ++c)
                EXPECT_LE(std::abs(picture.beauty[3 * row + c] - picture.beauty[3 * row + 3 + c]),
                          0.02f * most)
                    << "row " << row << ", sun at " << elevation;
    }
}

// A disc of the sun's size where the sun stands, and none when it is switched off.
TEST(Sky, ShowsTheDiscOfTheSun) {
    Renderer renderer({{}, false, 2048, Splatting::cpu});
    RenderOptions options = under_sky(10, {0, 0, 100}, {});
    const Vec3 sun = direction_to_sun(options.sun);
    options.camera.target_m = {1000 * sun.x, 1000 * sun.y, 100 + 1000 * sun.z};
    options.camera.vertical_fov_deg = 2;
    options.camera.width = options.camera.height = 100;
    const Picture with = renderer.draw({}, options);
    options.atmosphere.sun_disc = false;
    const Picture without = renderer.draw({}, options);
    double area = 0;
    for (std::size_t i = 0; i < with.pixels(); ++i)
        if (with.beauty[3 * i] > without.beauty[3 * i] + 0.5f) area += 1;
    const double radius = kSunRadius_deg / 2 * 100;
    EXPECT_NEAR(area / (std::numbers::pi * radius * radius), 1, 0.1);
    EXPECT_GT(with.beauty[3 * (50 * 100 + 50)], 3.0f);
}

}  // namespace
}  // namespace nephos
