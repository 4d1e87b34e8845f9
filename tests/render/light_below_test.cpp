// SPDX-License-Identifier: Apache-2.0
// Scattered light below clouds with detail (render/cloud/light_below.h).

#include "render/cloud/light_below.h"
#include "render/options/phase_function.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <glm/trigonometric.hpp>
#include <gtest/gtest.h>

#include "density/density_grid.h"
#include "density/metaballs.h"
#include "render/renderer.h"
#include "tests/render/voxel_cloud.h"

namespace nephos {
namespace {

constexpr double kCell_m = 40, kBase_m = 400;
constexpr Extent kSheet{96, 96, 8};
constexpr Vec2 kMiddle{0.5 * kSheet.x * kCell_m, 0.5 * kSheet.y* kCell_m};

// A sheet of an optical depth, or with holes; without erosion.
DetailedVoxels sheet(double depth, bool holes = false) {
    std::vector<float> values(kSheet.cells(), 1.0f);
    for (int z = 0; z < kSheet.z && holes; ++z)
        for (int y = 0; y < kSheet.y; ++y)
            for (int x = 0; x < kSheet.x; ++x)
                if (test::voxel_noise(x / 6, y / 6, 0, 3) < 0.5) values[linear_index(kSheet, x, y, z)] = 0;
    DetailedVoxels part{.density = DensityGrid::from_dense(values, kSheet, {{0, 0, kBase_m}, kCell_m})};
    part.setting.options.strength = part.setting.options.thermals = 0;
    part.setting.options.apron_cells = 0;
    part.setting.metaball_radius_cells = 1.5;
    part.setting.extinction_per_m = depth / (kSheet.z * kCell_m);
    return part;
}

CloudLight light_with(double g) {
    CloudLight light;
    light.phase = {.kind = Phase::henyey_greenstein, .g = g};
    return light;
}

GroundLight below(const DetailedVoxels& part, const Vec3& to_sun, const CloudLight& light, bool repeats = false) {
    const std::vector<Metaball> balls = metaballs(part.density, part.setting.metaball_radius_cells);
    const PreparedCloud cloud = prepare({balls, part.setting.extinction_per_m,
                                         metaball_normalisation(part.setting.metaball_radius_cells), {}});
    return light_below(cloud, {{0, 0}, repeats ? 2.0 * kMiddle : Vec2(0, 0)}, to_sun, mean_cosine(light.phase), 0);
}

// What a layer without absorption does not send back, by Eddington's approximation in the form of W. E. Meador and W. R.
// Weaver 1980 ("Two-Stream Approximations to Radiative Transfer in Planetary Atmospheres", equation 24).
double transmitted(double depth, double g, double mu) {
    const double rest = g / (1 + g), scaled = (1 - g * g) * depth;
    const double gamma1 = 0.75 * (1 - rest), gamma3 = (2 - 3 * rest * mu) / 4;
    return 1 -
           (gamma1 * scaled + (gamma3 - gamma1 * mu) * (1 - std::exp(-scaled / mu))) / (1 + gamma1 * scaled);
}

TEST(LightBelow, SheetsTransmitTheTwoStreamSolution) {
    for (const double g : {0.0, 0.5, 0.85}) {
        for (const double depth : {0.5, 5.0, 20.0, 80.0}) {
            for (const double mu : {1.0, 0.5, 0.1}) {
                const GroundLight::Fractions at =
                    below(sheet(depth), {0, std::sqrt(1 - mu * mu), mu}, light_with(g)).at(kMiddle);
                const double expected = transmitted(depth, g, mu);
                EXPECT_NEAR(at.sun + std::exp(-depth / mu), expected, 0.05 * expected + 1e-3)
                    << "g " << g << ", depth " << depth << ", mu " << mu;
                EXPECT_NEAR(at.sky, 1 / (1 + 0.75 * (1 - g) * depth), 0.02);
            }
        }
    }
}

TEST(LightBelow, IsThatOfOpenGroundFarAway) {
    const GroundLight light = below(sheet(20), {0, 0.6, 0.8}, light_with(0.85));
    for (const Vec2 place : {Vec2(-9e3, 0), Vec2(2e3, 9e3), Vec2(1e6, -1e6)}) {
        EXPECT_EQ(light.at(place).sun, 0);
        EXPECT_EQ(light.at(place).sky, 1);
    }
    // In between it changes steadily.
    double before = 0;
    for (double x = -1000; x < kMiddle.x; x += 10) {
        const double sun = light.at({x, kMiddle.y}).sun;
        EXPECT_LT(std::abs(sun - before), 0.03);
        before = sun;
    }
    EXPECT_EQ(GroundLight{}.at(kMiddle).sky, 1);
    EXPECT_TRUE(light_below({}, {}, {0, 0, 1}, 0.85, 0).words.empty());
}

// Beyond the first period of what repeats there is its mean.
TEST(LightBelow, GoesOnBelowCloudsThatRepeat) {
    const GroundLight light = below(sheet(20, true), {0, 0.6, 0.8}, light_with(0.85), true);
    const GroundLight::Fractions beyond = light.at({5e5, 5e5});
    EXPECT_GT(beyond.sun, 0.2 * transmitted(20, 0.85, 0.8));
    EXPECT_LT(beyond.sun, 0.95 * transmitted(20, 0.85, 0.8));
    double sum = 0;
    constexpr int kSide = 64;
    for (int n = 0; n < kSide * kSide; ++n)
        sum +=
            light.at(2.0 * kMiddle * Vec2((n % kSide + 0.5) / kSide, (double(n / kSide) + 0.5) / kSide)).sun;
    EXPECT_NEAR(sum / (kSide * kSide), beyond.sun, 0.05 * beyond.sun);
    EXPECT_EQ(light.at({1e6, 0}).sky, beyond.sky);
}

Picture picture_below(const DetailedVoxels& detailed, bool with_detail, RenderOptions& options) {
    options.sun.elevation_deg = 50;
    options.sun.azimuth_deg = 30;
    options.sun.colour = {1, 0.9, 0.8};
    options.light = light_with(0.85);
    options.air = {.extinction_per_m = {0, 0, 0}, .horizon = {0.5, 0.6, 0.7}, .zenith = {0.1, 0.2, 0.3}};
    options.ground.albedo = {0.3, 0.2, 0.1};
    options.shadow_map_size = 256;
    options.camera = {.position_m = Vec3(kMiddle, 100), .target_m = Vec3(kMiddle + 1.0, 0)};
    options.camera.vertical_fov_deg = 20;
    options.camera.width = options.camera.height = 8;
    const std::vector<Metaball> balls = metaballs(detailed.density, detailed.setting.metaball_radius_cells);
    std::vector<DetailedVoxels> parts{detailed};
    parts[0].count = balls.size();
    Splats splats;
    splats.metaballs = {balls,
                        detailed.setting.extinction_per_m,
                        metaball_normalisation(detailed.setting.metaball_radius_cells),
                        {}};
    if (with_detail) splats.metaballs.detailed = parts;
    options.precipitation.enabled = true;
    splats.light = true;
    Renderer renderer{DeviceOptions{.splatting = Splatting::cpu}};
    return renderer.draw_splats(splats, options);
}

// The ground below a thick sheet is lit by what comes through, and so is the rain.
TEST(LightBelow, LightsTheGround) {
    RenderOptions options;
    const Picture picture = picture_below(sheet(8), true, options);
    const GroundLight::Fractions at = picture.ground_light.at(kMiddle);
    const double mu = std::sin(glm::radians(50.0));
    EXPECT_NEAR(at.sun, transmitted(8, 0.85, mu), 0.02);
    for (std::size_t c = 0; c < 3; ++c) {
        const double sky = 0.5 * (options.air.horizon[c] + options.air.zenith[c]);
        const double expected =
            options.ground.albedo[c] * (at.sky * sky + at.sun * mu * options.sun.colour[c]);
        EXPECT_NEAR(double(picture.beauty[c]), expected, 0.01 * expected);
    }
    // Metaballs alone leave the ground as it was; their rain has the same light.
    const Picture plain = picture_below(sheet(8), false, options);
    EXPECT_NEAR(plain.ground_light.at(kMiddle).sun, at.sun, 0.01 * at.sun);
    EXPECT_NEAR(plain.ground_light.at(kMiddle).sky, at.sky, 0.01 * at.sky);
    EXPECT_NEAR(double(plain.beauty[0]), 0.3 * 0.5 * (0.5 + 0.1), 1e-3);
}

}  // namespace
}  // namespace nephos
