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

// In hazy air the ground melts into the sky: up a column of pixels across the horizon, which lies 0.45 degrees
// low, nothing jumps.
TEST(Sky, HasNoSeamAtTheHorizon) {
    Renderer renderer({{}, false, 2048, Splatting::cpu});
    for (const double elevation : {-4.0, 3.0, 50.0}) {
        RenderOptions options = under_sky(elevation, {0, 0, 200}, {0, 1000, 200});
        options.atmosphere.haze = 30;
        options.sun.azimuth_deg = 120;
        options.camera.vertical_fov_deg = 1;
        options.camera.width = 1;
        options.camera.height = 800;
        const Picture picture = renderer.draw({}, options);
        float most = 0;
        for (const float value : picture.beauty) most = std::max(most, value);
        for (std::size_t row = 700; row < 799; ++row)
            for (std::size_t c = 0; c < 3; ++c)
                EXPECT_LE(std::abs(picture.beauty[3 * row + c] - picture.beauty[3 * row + 3 + c]),
                          0.02f * most)
                    << "row " << row << ", sun at " << elevation;
    }
}

// The horizon dips as on a sphere of the Earth's radius: below it there is ground, above it sky.
TEST(Sky, HorizonDipsWithHeight) {
    Renderer renderer({{}, false, 2048, Splatting::cpu});
    for (const double altitude : {100.0, 3'000.0, 11'000.0}) {
        RenderOptions options = under_sky(40, {0, 0, altitude}, {0, 0, 0});
        const double dip = std::acos(6'360'000 / (6'360'000 + altitude));
        options.camera.target_m = {0, 1000, altitude - 1000 * std::tan(dip)};
        options.camera.vertical_fov_deg = 1;
        options.camera.width = 1;
        options.camera.height = 200;
        options.atmosphere.haze = 0;
        options.ground.albedo = {1, 0, 0};
        const Picture red = renderer.draw({}, options);
        options.ground.albedo = {0, 0, 0};
        const Picture black = renderer.draw({}, options);
        // The ground also lights the sky.
        const auto of_ground = [&](std::size_t row) { return red.beauty[3 * row] - black.beauty[3 * row]; };
        std::printf("ground from %g m: %.4f above, %.4f below the horizon\n", altitude, double(of_ground(97)),
                    double(of_ground(104)));
        EXPECT_GT(of_ground(104), 1.2f * of_ground(97)) << altitude;
        EXPECT_NEAR(of_ground(97) / of_ground(90), 1, 0.05) << altitude;
    }
}

// Country is the same in every back-end, keeps the mean of the albedo, and does not shimmer: a picture is hardly
// different from the mean of one with sixteen times the pixels.
TEST(Sky, CountryIsFilteredAndTheSameInEveryBackend) {
    Renderer processor(test::validated(Splatting::cpu)), tiles(test::validated(Splatting::vulkan)),
        billboards(test::validated(Splatting::blended));
    const std::vector<Metaball> balls = reference::random_metaballs(7, 50, 80, 250);
    const MetaballCloud cloud{balls, 0.01, 0.7};
    for (const double altitude : {40.0, 400.0, 4'000.0}) {
        RenderOptions options = under_sky(40, {0, -4000, altitude}, {0, 0, 0.5 * altitude});
        const Picture plain = processor.draw(cloud, options);
        options.ground.pattern = GroundPattern::country;
        const Picture picture = processor.draw(cloud, options);
        EXPECT_LE(test::largest_difference(tiles.draw(cloud, options).beauty, picture.beauty), 1.0f / 255);
        EXPECT_LE(test::largest_difference(billboards.draw(cloud, options).beauty, picture.beauty), 1.0f / 255);
        EXPECT_GT(test::largest_difference(plain.beauty, picture.beauty), 0.01f);
        options.camera.width *= 4;
        options.camera.height *= 4;
        options.light_shafts.strength = 0;
        const Picture fine = processor.draw({}, options);
        options.camera.width /= 4;
        options.camera.height /= 4;
        const Picture coarse = processor.draw({}, options);
        double square = 0, mean_fine = 0, mean_coarse = 0;
        std::size_t count = 0;
        for (std::size_t y = 22; y < std::size_t(coarse.height); ++y)  // below the horizon
            for (std::size_t x = 0; x < std::size_t(coarse.width); ++x, ++count) {
                double mean = 0;
                for (std::size_t k = 0; k < 16; ++k)
                    mean += double(fine.beauty[3 * ((4 * y + k / 4) * std::size_t(fine.width) + 4 * x + k % 4) + 1]) / 16;
                const double here = double(coarse.beauty[3 * (y * std::size_t(coarse.width) + x) + 1]);
                square += (here - mean) * (here - mean);
                mean_fine += mean;
                mean_coarse += here;
            }
        const double deviation = std::sqrt(square / double(count));
        std::printf("country from %g m: deviation of a pixel %.5f, means %.5f and %.5f\n", altitude, deviation,
                    mean_fine / double(count), mean_coarse / double(count));
        EXPECT_LT(deviation, 0.015);
        EXPECT_NEAR(mean_coarse / mean_fine, 1, 0.02);
    }
    for (const Renderer* renderer : {&processor, &tiles, &billboards}) test::expect_no_messages(*renderer);
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
