// SPDX-License-Identifier: Apache-2.0

// A sea as ground: what it mirrors and the sun's glint against exact integrals over normally distributed slopes, where a
// pixel resolves no wave; waves that move; and the three ways of drawing against each other.

#include "render/ground/water.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "core/error.h"
#include "render/ground/wet_ground.h"
#include "render/renderer.h"
#include "tests/reference/with_threads.h"
#include "tests/render/shared_renderers.h"

namespace nephos {
namespace {

RenderOptions sea(double wind) {
    RenderOptions options;
    options.camera = {{0, 0, 20}, {0, 100, 12}, 60, 96, 72, 0};
    options.air.extinction_per_m = {0, 0, 0};
    options.shadow_map_size = 64;
    options.ground.pattern = GroundPattern::water;
    options.water.wind_m_per_s = wind;
    options.water.whitecaps = 0;
    options.sun.elevation_deg = 30;
    options.sun.azimuth_deg = 180;  // behind the eye
    return options;
}

// So high that no wave and no gust is seen by itself.
RenderOptions from_space(double wind) {
    RenderOptions options = sea(wind);
    options.camera.position_m = {0, 0, 300'000};
    options.camera.target_m = {0, 400'000, 0};
    return options;
}

Picture draw(const RenderOptions& options, double time_s = 0, Splatting way = Splatting::cpu) {
    Splats splats;
    splats.time_s = time_s;
    return test::renderer(way).draw_splats(splats, options);
}

Rgb pixel(const Picture& picture, int x, int y) {
    const float* at = &picture.beauty[3 * std::size_t(y * picture.width + x)];
    return {at[0], at[1], at[2]};
}

double normal(double t) { return std::exp(-t * t / 2) / std::sqrt(2 * std::numbers::pi); }
double normal_integral(double t) { return std::erfc(-t / std::sqrt(2.0)) / 2; }

TEST(SeaTest, SlopesAreThoseOfCoxAndMunk) {
    EXPECT_EQ(slope_variance_of_sea(0), 0);
    EXPECT_NEAR(slope_variance_of_sea(10), 0.0542, 1e-4);
    EXPECT_NEAR(whitecaps_of_sea(10), 0.0098, 1e-4);
    for (const double wind : {2.0, 7.0, 15.0}) {
        const Water water = water_of(sea(wind), {12'345.6, -789, 50}, 77);
        ASSERT_FALSE(water.waves.empty());
        double drawn = 0;
        for (std::size_t n = 0; n < water.waves.size(); ++n) {
            const WaterWave& wave = water.waves[n];
            drawn += wave.variance;
            EXPECT_NEAR(std::hypot(wave.x, wave.y), 2 * std::numbers::pi / wave.wavelength_m, 1e-4 * std::hypot(wave.x, wave.y));
            EXPECT_GE(wave.phase, 0);
            EXPECT_LE(wave.phase, 6.2832f);
        }
        EXPECT_LT(drawn, water.slope_variance);
        EXPECT_GT(drawn, 0.3 * water.slope_variance) << "the rest is shorter than what is drawn";
    }
    EXPECT_FALSE(water_of(RenderOptions{}, {}, 0).enabled);
}

TEST(SeaTest, StillWaterMirrorsTheSky) {
    RenderOptions options = sea(0);
    options.air.horizon = options.air.zenith = {0.4, 0.6, 0.9};
    RenderOptions plain = options;
    plain.ground.pattern = GroundPattern::plain;
    const Picture dry = draw(plain), wet = draw(options);
    const CameraFrame frame = camera_frame(options.camera);
    int seen = 0;
    for (int y = 40; y < 72; y += 3) {
        for (int x = 0; x < 96; x += 7) {
            const Vec3 ray = pixel_ray(frame, options.camera, x + 0.5, y + 0.5);
            if (ray.z > -0.04) continue;
            const double share = water_reflectance(-ray.z, 0);
            for (std::size_t c = 0; c < 3; ++c)
                ASSERT_NEAR(pixel(wet, x, y)[c], share * options.air.horizon[c] + (1 - share) * pixel(dry, x, y)[c], 4e-3)
                    << x << ' ' << y << ' ' << c;
            ++seen;
        }
    }
    EXPECT_GT(seen, 100);
}

// Black water under a white sky: the mean reflectance of the facets that are seen.
TEST(SeaTest, RoughWaterHasTheMeanReflectanceOfItsFacets) {
    for (const double wind : {3.0, 8.0, 15.0}) {
        RenderOptions options = from_space(wind);
        options.ground.albedo = {0, 0, 0};
        options.air.horizon = options.air.zenith = {1, 1, 1};
        const Picture picture = draw(options);
        const CameraFrame frame = camera_frame(options.camera);
        const double sigma = std::sqrt(slope_variance_of_sea(wind) / 2);
        for (const int y : {20, 36, 50, 70}) {
            const Vec3 ray = pixel_ray(frame, options.camera, 48.5, y + 0.5);
            const double level = std::hypot(ray.x, ray.y), elevation = -ray.z / level;
            double sum = 0, weights = 0;
            for (double t = -5; t < 5; t += 0.01) {
                for (double aside = -5; aside < 5; aside += 0.05) {
                    const double slope = t * sigma, across = aside * sigma;
                    const double weight = normal(t) * normal(aside) * std::max(0.0, elevation + slope);
                    const double cosine = level * (elevation + slope) / std::sqrt(1 + slope * slope + across * across);
                    if (weight == 0) continue;
                    sum += weight * water_reflectance(std::min(cosine, 1.0), 0);
                    weights += weight;
                }
            }
            const double expected = sum / weights;
            EXPECT_NEAR(pixel(picture, 48, y)[1], expected, 0.06 * expected + 0.002) << wind << ' ' << elevation;
        }
    }
}

// Black water under a black sky: Cox and Munk's glint, and its irradiance from that of white ground.
TEST(SeaTest, GlintIsThatOfCoxAndMunk) {
    const double wind = 8;
    RenderOptions options = from_space(wind);
    options.sun.azimuth_deg = 0;
    options.sun.elevation_deg = 40;
    options.air.horizon = options.air.zenith = {0, 0, 0};
    options.ground.albedo = {0, 0, 0};
    const Picture picture = draw(options);
    RenderOptions white = options, shaded = options;
    white.ground.pattern = shaded.ground.pattern = GroundPattern::plain;
    white.ground.albedo = shaded.ground.albedo = {1, 1, 1};
    shaded.sun.colour = {0, 0, 0};
    const double height = std::sin(40 * std::numbers::pi / 180);
    const double sunlight = std::numbers::pi * (pixel(draw(white), 48, 60)[1] - pixel(draw(shaded), 48, 60)[1]) / height;
    ASSERT_GT(sunlight, 0);
    const Vec3 to_sun{0, std::cos(40 * std::numbers::pi / 180), height};
    const CameraFrame frame = camera_frame(options.camera);
    const double variance = slope_variance_of_sea(wind) / 2, sigma = std::sqrt(variance);
    double brightest = 0;
    for (int y = 16; y < 72; y += 4) {
        for (int x = 24; x < 72; x += 6) {
            const Vec3 ray = pixel_ray(frame, options.camera, x + 0.5, y + 0.5);
            const Vec3 half = glm::normalize(to_sun - ray);
            const double zx = half.x / half.z, zy = half.y / half.z;
            const double density = std::exp(-(zx * zx + zy * zy) / (2 * variance)) / (2 * std::numbers::pi * variance);
            const double level = std::hypot(ray.x, ray.y), u = -ray.z / level / sigma;
            const double area = level * sigma * (u * normal_integral(u) + normal(u));
            const double expected = sunlight * water_reflectance(-glm::dot(half, ray), 0) * density / (4 * std::pow(half.z, 4) * area);
            EXPECT_NEAR(pixel(picture, x, y)[1], expected, 0.05 * expected + 1e-4) << x << ' ' << y;
            brightest = std::max(brightest, expected);
        }
    }
    EXPECT_GT(brightest, 0.1);
}

TEST(SeaTest, WavesMoveAndTheSameTimeGivesTheSameWaves) {
    RenderOptions options = sea(7);
    options.air.zenith = {0.1, 0.2, 0.5};
    options.air.horizon = {0.8, 0.9, 1};
    const Picture one = draw(options, 5), again = draw(options, 5), later = draw(options, 5.4);
    EXPECT_EQ(one.beauty, again.beauty);
    double most = 0;
    for (std::size_t i = 0; i < one.beauty.size(); ++i)
        most = std::max(most, double(std::abs(one.beauty[i] - later.beauty[i])));
    EXPECT_GT(most, 0.02);
    const Picture alone = test::with_threads(1, [&] { return draw(options, 5); });
    EXPECT_EQ(one.beauty, alone.beauty);
}

TEST(SeaTest, FoamWhitensTheMeanAsMuchAsItsCover) {
    RenderOptions options = from_space(12);
    options.air.horizon = options.air.zenith = {0, 0, 0};
    options.ground.albedo = {0, 0, 0};
    options.sun.azimuth_deg = 180;
    const double without = pixel(draw(options), 48, 30)[1];
    options.water.whitecaps = 1;
    const double with = pixel(draw(options), 48, 30)[1];
    RenderOptions white = options;
    white.ground.pattern = GroundPattern::plain;
    white.ground.albedo = {1, 1, 1};
    const double expected = 0.22 * whitecaps_of_sea(12) * pixel(draw(white), 48, 30)[1];
    EXPECT_NEAR(with - without, expected, 0.1 * expected);
}

// Rings of drops on a still sea near the eye: they come and go with the rain, and more rain makes steeper ones.
TEST(SeaTest, DropsMakeRings) {
    RenderOptions options = sea(0);
    options.camera.position_m = {3, 2, 1.3};
    options.camera.target_m = {3, 5, 0};
    const auto picture_of = [&](double rain_mm_per_h, double time_s) {
        Splats splats;
        splats.time_s = time_s;
        splats.ground_cover.emplace().outside_rain_mm_per_h = rain_mm_per_h;
        return test::renderer(Splatting::cpu).draw_splats(splats, options);
    };
    const Picture still = picture_of(0, 5);
    const auto roughness = [&](double rain_mm_per_h, double time_s) {  // what rain adds from pixel to pixel along rows
        const Picture picture = picture_of(rain_mm_per_h, time_s);
        const auto added = [&](int x, int y) { return pixel(picture, x, y)[1] - pixel(still, x, y)[1]; };
        double sum = 0;
        for (int y = 36; y < 72; ++y)
            for (int x = 1; x < 96; ++x) sum += std::abs(added(x, y) - added(x - 1, y));
        return sum;
    };
    EXPECT_EQ(roughness(0, 5.1), 0);
    const double drizzle = roughness(2, 5), rain = roughness(20, 5);
    EXPECT_GT(rain, 0.2);
    EXPECT_GT(rain, 1.2 * drizzle);
    EXPECT_GT(drizzle, 0.01);
    EXPECT_NE(roughness(20, 5.1), rain);
    EXPECT_EQ(roughness(20, 5), rain);
}

TEST(SeaTest, BackEndsAgree) {
    RenderOptions options = sea(9);
    options.water.whitecaps = 1;
    const Picture ours = draw(options, 3);
    for (const Splatting way : {Splatting::vulkan, Splatting::blended}) {
        const Picture other = draw(options, 3, way);
        for (std::size_t i = 0; i < ours.beauty.size(); ++i) ASSERT_NEAR(ours.beauty[i], other.beauty[i], 2.0 / 255) << i;
    }
}

TEST(SeaTest, BadOptionsAreNamed) {
    for (const double wind : {-1.0, 26.0, std::nan("")}) {
        RenderOptions options = sea(wind);
        EXPECT_THROW(draw(options), Error) << wind;
    }
}

}  // namespace
}  // namespace nephos
