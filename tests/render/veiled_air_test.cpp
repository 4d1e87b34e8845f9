// SPDX-License-Identifier: Apache-2.0
// Air and rain below veils that are drawn per pixel: shells of air and far rain have the sunlight that the veils leave, in every
// back-end.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "render/rain/precipitation_light.h"
#include "render/renderer.h"
#include "tests/render/picture_checks.h"
#include "tests/render/rain_scene.h"
#include "tests/render/reference_render.h"
#include "tests/render/voxel_cloud.h"

namespace nephos {
namespace {

constexpr double kBase_m = 4000, kThickness_m = 900;

// An even sheet that has an optical depth towards the zenith.
DrawnVeil sheet(double depth) {
    VeilOptions options;
    options.form = VeilForm::stratus;
    options.sheet = 1;
    options.coverage = 1;
    options.base_m = kBase_m;
    options.top_m = kBase_m + kThickness_m;
    options.soft_base_m = options.soft_top_m = 0;
    VeilView view;
    view.g = 0.6;
    return {std::make_shared<VeilSlab>(options, Wind{}, 0, 0, std::nullopt), depth / kThickness_m, view};
}

double left_below(double depth, double elevation_deg) {
    return std::exp(-0.4 * depth / std::sin(elevation_deg * std::numbers::pi / 180));
}

// Green light of thick fog at the eye, which has no other light than the sun's.
double fog_at(Renderer& renderer, const Vec3& eye, double elevation_deg, std::span<const DrawnVeil> veils) {
    RenderOptions options = test::view(eye, eye + Vec3(0, 100, 0.5), 5, 4, 4);
    options.light.ambient_base = options.light.ambient_top = {0, 0, 0};
    options.air.extinction_per_m = {0, 0, 0};
    options.sun.elevation_deg = elevation_deg;
    options.fog = {0.1, 0, 1000, 0, 300, {}, 1};
    options.light_shafts.strength = 1;
    options.shells = {40, 10, 1.1};
    const std::vector<Metaball> balls{{0, 0, 1500, 300, 1e-4f}, {1500, 0, 1500, 300, 1e-4f}};
    Splats splats;
    splats.metaballs = {balls, 0.001, 1};
    return double(renderer.draw_splats(splats, options, veils).beauty[1]);
}

TEST(VeiledAir, HasTheLightThatTheVeilLeaves) {
    const DrawnVeil veil = sheet(1.2);
    for (const Splatting way : {Splatting::cpu, Splatting::vulkan, Splatting::blended}) {
        Renderer renderer(test::validated(way));
        for (const double elevation : {80.0, 35.0}) {
            for (const double beside_m : {0.0, 9000.0}) {  // in the shadow map, and beyond it
                const Vec3 eye{beside_m, 0, 1};
                const double open = fog_at(renderer, eye, elevation, {}),
                             below = fog_at(renderer, eye, elevation, {&veil, 1});
                ASSERT_GT(open, 0.001);
                EXPECT_NEAR(below / open, left_below(1.2, elevation), 0.02) << elevation << ' ' << beside_m;
            }
        }
        test::expect_no_messages(renderer);
    }
}

RenderOptions below_clouds() {
    RenderOptions options = test::view({0, -2500, 100}, {0, 0, 900}, 60, 60, 45);
    options.air.extinction_per_m = {1e-4, 1.3e-4, 2e-4};
    options.sun.elevation_deg = 40;
    options.shells = {40, 100, 1};
    options.light_shafts.strength = 1;
    return options;
}

// What shells take of the air's light: more below a veil, the same in every back-end.
TEST(VeiledAir, IsDimmerWithShaftsInEveryBackend) {
    const std::vector<Metaball> balls = reference::broken_layer(7, 400, 1100);
    Splats splats;
    splats.metaballs = {balls, 0.02, 0.7};
    const DrawnVeil veil = sheet(1.2);
    const RenderOptions options = below_clouds();
    RenderOptions bare = options;
    bare.light_shafts.strength = 0;
    Renderer processor(test::validated(Splatting::cpu)), tiles(test::validated(Splatting::vulkan)),
        blended(test::validated(Splatting::blended));
    const auto taken = [&](std::span<const DrawnVeil> veils) {
        const Picture with = processor.draw_splats(splats, options, veils),
                      without = processor.draw_splats(splats, bare, veils);
        double sum = 0;
        for (std::size_t i = 0; i < with.beauty.size(); ++i)
            sum += double(without.beauty[i] - with.beauty[i]);
        return sum / double(with.beauty.size());
    };
    const double open = taken({}), below = taken({&veil, 1});
    std::printf("shells take %.4f, below a veil %.4f\n", open, below);
    EXPECT_GT(below, 1.1 * open);
    const Picture expected = processor.draw_splats(splats, options, {&veil, 1});
    for (Renderer* renderer : {&tiles, &blended}) {
        const Picture picture = renderer->draw_splats(splats, options, {&veil, 1});
        EXPECT_LE(test::largest_difference(picture.beauty, expected.beauty), 1.0f / 255);
    }
    // Without the veil it is as before: nothing of it stays in a cache.
    EXPECT_EQ(processor.draw_splats(splats, options).beauty,
              Renderer({.splatting = Splatting::cpu}).draw_splats(splats, options).beauty);
    for (const Renderer* each : {&processor, &tiles, &blended}) test::expect_no_messages(*each);
}

// The map that far rain reads is the shadow map times what the veil leaves; device and processor draw the same rain by it.
TEST(VeiledRain, HasTheLightThatTheVeilLeaves) {
    const std::vector<Metaball> balls = test::ragged_cloud({{-800, 100, 800}, 60, 32, 24, 12});
    Splats splats;
    splats.metaballs = {balls, 0.02, test::kVoxelNormalisation};
    splats.time_s = 3;
    RenderOptions options = test::rain_view({0, -3500, 60}, {0, 1000, 400}, 120, 88, 20'000);
    options.shadow_map_size = 128;
    options.sun.elevation_deg = 50;
    options.sun.azimuth_deg = 180;
    Weather weather;
    weather.seed = 3;
    weather.curtains = {test::rain_area()};
    const DrawnVeil veil = sheet(2.0);
    Renderer processor(test::validated(Splatting::cpu)), device(test::validated(Splatting::vulkan));
    const auto rain_of = [&](Renderer& renderer, std::span<const DrawnVeil> veils, bool rains) {
        std::optional<Rainfall> rain;
        if (rains) rain = Rainfall{options, weather, 3};
        return renderer.draw_splats(splats, options, veils, std::move(rain));
    };
    const Picture veiled = rain_of(processor, {&veil, 1}, true), dry = rain_of(processor, {&veil, 1}, false);
    const std::vector<float> map = shadow_with_veils(veiled, 0);
    ASSERT_EQ(map.size(), veiled.shadow.size());
    for (std::size_t i = 0; i < map.size(); ++i)
        ASSERT_NEAR(map[i], double(veiled.shadow[i]) * left_below(2.0, 50), 3e-3) << i;
    const Picture open = rain_of(processor, {}, true);
    EXPECT_TRUE(shadow_with_veils(open, 0).empty()) << "without a veil the map itself says all";

    const Picture other = rain_of(device, {&veil, 1}, true);
    std::size_t apart = 0, changed = 0;
    for (std::size_t i = 0; i < veiled.beauty.size(); ++i) {
        changed += std::abs(veiled.beauty[i] - dry.beauty[i]) > 2e-3f;
        apart += !(std::abs(other.beauty[i] - veiled.beauty[i]) <= std::max(1.0f, veiled.beauty[i]) / 255);
    }
    EXPECT_GT(changed, veiled.beauty.size() / 100);
    EXPECT_LE(apart, veiled.beauty.size() / 1000);
    test::expect_no_messages(device);
}

}  // namespace
}  // namespace nephos
