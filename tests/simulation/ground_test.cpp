// SPDX-License-Identifier: Apache-2.0

// The ground under a scene's rain: state of the simulation like the clouds, between steps, after a restart.

#include <algorithm>
#include <cmath>
#include <memory>

#include <gtest/gtest.h>

#include "scenes/format/writer.h"
#include "simulation/simulation.h"

namespace nephos {
namespace {

// A shower that drifts over a sky without clouds.
Scene showery_scene() {
    Scene scene;
    scene.name = "showery";
    scene.automaton.time_step_s = 20;
    scene.automaton.wind.keyframes = {{0, {{0, {6, 2}}, {1000, {9, -1}}}}};
    scene.steps = 9;
    scene.skies = {{"clear", 0, 0, {}, 1}};
    LayerOptions& layer = scene.layers.emplace_back();
    layer.name = "low";
    layer.skies = {"clear"};
    layer.automaton = false;
    layer.extent = {32, 32, 8};
    layer.placement.cell_size_m = 100;
    PlacedRain shower;
    shower.x_m = 800;
    shower.y_m = 1500;
    shower.semi_a_m = 700;
    shower.semi_b_m = 400;
    shower.intensity_mm_per_h = 20;
    shower.carried = true;
    layer.rain.placed = {shower};
    scene.frames.per_second = 1;
    scene.frames.time_scale = 15;
    scene.ground_cover.enabled = true;
    scene.ground_cover.texels = 24;
    scene.ground_cover.initial_snow_mm = 0.02;
    scene.ground_cover.melting_mm_per_h = 3;
    return scene;
}

struct Grounds : SimulationSink {
    void step(const StepResult&) override {}
    void frame(const FrameResult& result) override { maps.push_back(result.ground); }
    std::vector<std::shared_ptr<const GroundCoverMap>> maps;
};

Grounds run_to_end(Simulation& simulation) {
    Grounds grounds;
    while (!simulation.finished()) simulation.advance(grounds);
    return grounds;
}

Grounds run(const Scene& scene) {
    Simulation simulation(scene, full_range(scene), std::string(32, '0'));
    return run_to_end(simulation);
}

// Step by step with the rain areas that the scene places, the second way to the same maps.
TEST(SimulationGroundTest, IsTheCoverUnderTheScenesRain) {
    const Scene scene = showery_scene();
    const Grounds found = run(scene);
    ASSERT_EQ(int(found.maps.size()), frame_count(scene));
    GroundCover cover(scene.ground_cover, scene.render.precipitation.kind, whole_world(scene));
    SkySimulation sky(sky_options(scene, 0));
    const Vec2 drift = lag_m(scene.automaton.wind, 0, 1000, 0, scene.ground_cover.fall_speed_m_per_s);
    std::vector<GroundCoverMap> maps;
    for (std::uint64_t step = 0; step <= scene.steps; ++step) {
        const std::vector<RainArea> areas =
            placed_areas(scene.layers[0].rain.placed, sky.time_s(), sky.carried());
        const FallingRain falling[] = {{areas, drift}};
        cover.expose(falling);
        maps.push_back(cover.map());
        cover.advance(scene.automaton.time_step_s);
        sky.step();
    }
    float wettest = 0;
    for (std::size_t frame = 0; frame < found.maps.size(); ++frame) {
        const std::size_t step = frame * 15 / 20;
        const double rest = double(frame * 15 % 20) / 20;
        const GroundCoverMap expected = rest == 0 ? maps[step] : mix(maps[step], maps[step + 1], rest);
        ASSERT_TRUE(found.maps[frame]);
        for (std::size_t i = 0; i < expected.water_mm.size(); ++i) {
            ASSERT_NEAR(found.maps[frame]->water_mm[i], expected.water_mm[i], 1e-6) << frame;
            ASSERT_NEAR(found.maps[frame]->snow_mm[i], expected.snow_mm[i], 1e-6) << frame;
            ASSERT_NEAR(found.maps[frame]->rain_mm_per_h[i], expected.rain_mm_per_h[i], 1e-4) << frame;
            wettest = std::max(wettest, expected.water_mm[i]);
        }
    }
    EXPECT_GT(wettest, 0.3) << "a dry scene proves nothing";
}

TEST(SimulationGroundTest, RestartsAnywhereWithTheSameBits) {
    const Scene scene = showery_scene();
    const Grounds whole = run(scene);
    Simulation simulation(scene, full_range(scene), std::string(32, '0'));
    Grounds first;
    while (true) {
        Simulation again(scene, full_range(scene), std::string(32, '0'), simulation.save());
        Grounds rest = run_to_end(again);
        ASSERT_EQ(first.maps.size() + rest.maps.size(), whole.maps.size());
        for (std::size_t i = 0; i < rest.maps.size(); ++i)
            ASSERT_EQ(*rest.maps[i], *whole.maps[first.maps.size() + i]) << first.maps.size() << ' ' << i;
        if (simulation.finished()) break;
        simulation.advance(first);
    }
}

TEST(SimulationGroundTest, ARangeOfFramesIsThatPartOfTheWhole) {
    const Scene scene = showery_scene();
    const Grounds whole = run(scene);
    Simulation simulation(scene, range_of_frames(scene, 5, 7), std::string(32, '0'));
    const Grounds part = run_to_end(simulation);
    ASSERT_EQ(part.maps.size(), 3u);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(*part.maps[i], *whole.maps[4 + i]);
}

// Off by default: nothing is computed, no text or hash of a scene changes; on, it belongs to the simulation.
TEST(SimulationGroundTest, IsOffUnlessAskedFor) {
    Scene scene = showery_scene();
    const std::string with = simulation_hash(scene);
    EXPECT_NE(to_toml(scene).find("[wet_ground]"), std::string::npos);
    Scene higher = scene;
    higher.render.ground.height_m = 300;
    EXPECT_NE(simulation_hash(higher), with) << "drops drift less far";
    scene.ground_cover = {};
    for (const auto& map : run(scene).maps) EXPECT_EQ(map, nullptr);
    EXPECT_EQ(to_toml(scene).find("wet_ground"), std::string::npos);
    EXPECT_NE(simulation_hash(scene), with);
}

// The scene says once what falls; for the ground it need not be drawn.
TEST(SimulationGroundTest, TurnsWhiteWhereThePrecipitationIsSnow) {
    Scene scene = showery_scene();
    scene.ground_cover.initial_snow_mm = scene.ground_cover.melting_mm_per_h = 0;
    const std::string rainy = simulation_hash(scene);
    scene.render.precipitation.kind = PrecipitationKind::snow;
    EXPECT_NE(simulation_hash(scene), rainy);
    const auto map = run(scene).maps.back();
    EXPECT_GT(*std::max_element(map->snow_mm.begin(), map->snow_mm.end()), 0.3f);
    EXPECT_EQ(*std::max_element(map->water_mm.begin(), map->water_mm.end()), 0.0f);
    scene.ground_cover = {};
    const std::string dry = simulation_hash(scene);
    scene.render.precipitation.kind = PrecipitationKind::rain;
    EXPECT_EQ(simulation_hash(scene), dry) << "a matter of pictures alone";
}

// Without rain areas, and without layers, it dries from what lay there at the start.
TEST(SimulationGroundTest, DriesInASceneWithoutLayers) {
    Scene scene;
    scene.automaton.extent = {16, 16, 8};
    scene.steps = 4;
    scene.frames.per_second = 1;
    scene.frames.time_scale = 10;
    scene.ground_cover.enabled = true;
    scene.ground_cover.initial_water_mm = 2;
    const Grounds found = run(scene);
    ASSERT_GT(found.maps.size(), 3u);
    EXPECT_EQ(found.maps[0]->water_mm[0], 2);
    const double time_s = 10 * double(found.maps.size() - 1);
    EXPECT_NEAR(found.maps.back()->water_mm[77], 2 * std::exp(-time_s / scene.ground_cover.drying_s), 1e-5);
}

}  // namespace
}  // namespace nephos
