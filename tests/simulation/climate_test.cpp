// SPDX-License-Identifier: Apache-2.0
// Scenes with layers, from the file to the frames: the bits of every layer are those of that layer alone, on
// any number of threads and after any interruption; the weather follows the skies.

#include "seeds/climate.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "core/error.h"
#include "density/combine.h"
#include "density/vdb/vdb_file.h"
#include "scenes/format/reader.h"
#include "scenes/format/writer.h"
#include "simulation/layer_simulation.h"
#include "simulation/run_folder.h"
#include "simulation/simulation.h"
#include "tests/reference/with_threads.h"
#include "tests/simulation/file_content.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

const fs::path kGolden = fs::path(NEPHOS_SOURCE_DIR) / "tests/golden";

Scene climate(const std::vector<std::string>& overrides = {}) {
    return read_scene(kGolden / "climate.toml", overrides);
}

void step_all(std::vector<LayerSimulation>& layers) {
    for (LayerSimulation& layer : layers) layer.step();
}

std::uint64_t cloudy_cells(const LayerSimulation& layer) {
    const BitPlaneView cld = layer.automaton()->cld();
    std::uint64_t count = 0;
    for (std::size_t w = 0; w < cld.word_count(); ++w) count += std::uint64_t(std::popcount(cld.words[w]));
    return count;
}

// Lines "step hash", as `nephos hash tests/golden/climate.toml` prints them. To change one is a decision
// about the random stream (docs/adr/0002) or about how skies drive the automaton.
std::map<std::uint64_t, std::string> golden_hashes() {
    std::ifstream in(kGolden / "climate_hashes.txt");
    std::map<std::uint64_t, std::string> hashes;
    std::string hash;
    for (std::uint64_t step = 0; in >> step >> hash;) hashes[step] = hash;
    return hashes;
}

TEST(Climate, HasTheGoldenHashesOnAnyNumberOfThreads) {
    const std::map<std::uint64_t, std::string> golden = golden_hashes();
    ASSERT_GE(golden.size(), 5u);
    ASSERT_EQ(golden.rbegin()->first, 500u);
    for (std::size_t threads = 1; threads <= 8; ++threads) {
        test::with_threads(threads, [&] {
            std::vector<LayerSimulation> layers = make_layers(climate());
            for (const auto& [step, hash] : golden) {
                while (layers.front().steps() < step) step_all(layers);
                EXPECT_EQ(combined_hash(layers).hex(), hash)
                    << "step " << step << ", " << threads << " threads";
            }
        });
    }
}

// The run is no empty sky: clouds of every layer, rain of every kind, and the water that each needs.
TEST(Climate, TheGoldenRunHasCloudsAndRainOfEveryKind) {
    std::vector<LayerSimulation> layers = make_layers(climate());
    std::vector<std::uint64_t> most(3, 0);
    std::map<std::uint64_t, std::size_t> sources;
    for (int n = 0; n < 300; ++n) {
        step_all(layers);
        for (std::size_t l = 0; l < 3; ++l) {
            most[l] = std::max(most[l], cloudy_cells(layers[l]));
        }
        for (const RainArea& area : layers[0].rain()) ++sources[area.id >> 62];
    }
    for (std::size_t l = 0; l < 3; ++l) EXPECT_GT(most[l], 30u) << "layer " << l;
    EXPECT_EQ(sources.size(), 3u) << "placed, attached and found";
}

// A layer depends on its number and its own keys, not on its neighbours.
TEST(Climate, ALayerHasTheSameBitsWithoutTheLayersAfterIt) {
    Scene one = climate();
    one.layers.resize(1);
    std::vector<LayerSimulation> alone = make_layers(one), all = make_layers(climate());
    for (int n = 0; n < 60; ++n) {
        step_all(alone);
        step_all(all);
    }
    EXPECT_EQ(alone[0].hash(), all[0].hash());
    EXPECT_EQ(combined_hash(alone), alone[0].hash()) << "one layer has the hash of its bits";
    EXPECT_NE(combined_hash(all), all[0].hash());
}

// Without coupling the clouds do not touch the automaton: layer 0 then has the bits of the scene without
// layers.
TEST(Climate, LayerZeroHasTheStreamOfASceneWithoutLayers) {
    const std::vector<std::string> humid{"field.background={ hum = 0.1, act = 0.002, ext = 0.1 }",
                                         "layer[0].coupling.strength=0", "layer[0].rain.column.strength=0"};
    const Scene scene = climate(humid);
    std::vector<LayerSimulation> layers = make_layers(scene);
    Automaton alone(scene.automaton);
    for (int n = 0; n < 30; ++n) {
        step_all(layers);
        alone.step();
    }
    EXPECT_EQ(layers[0].hash(), alone.hash());
    EXPECT_NE(layers[1].hash(), alone.hash());
}

// Everything that a run writes of a result, as text.
class Listing : public SimulationSink {
  public:
    void step(const StepResult& r) override {
        std::ostringstream out;
        out << "step " << r.step << ' ' << r.hash.hex() << ' ' << r.statistics.mean_density;
        for (const LayerStep& l : r.layers) {
            out << " | " << l.name << ' ' << l.state << ' ' << l.clouds << ' ' << l.rain_areas << ' '
                << l.rain_mm_per_h << ' ' << l.hash.hex() << ' ' << l.statistics.mean_density;
        }
        events.push_back(out.str());
    }
    void frame(const FrameResult& r) override {
        std::ostringstream out;
        out.precision(17);
        out << "frame " << r.number << ' ' << r.step << ' ' << r.hash.hex() << ' ' << r.density.sum();
        for (const LayerFrame& l : r.layers) {
            out << " | " << l.name << ' ' << l.density.sum() << ' ' << l.hash.hex();
            for (const SkyCloud& c : l.clouds)
                out << ' ' << c.serial << ' ' << l.sky->position_m(c).x << ' ' << c.phase;
            for (const RainArea& a : l.rain)
                out << ' ' << a.id << ' ' << a.x_m << ' ' << a.intensity_mm_per_h;
        }
        events.push_back(out.str());
    }
    std::vector<std::string> events;
};

TEST(Climate, GoesOnWithTheSameResultsAfterAnyInterruption) {
    // A frame every 7 s, so that most lie between two steps; rain is there from the start.
    const Scene scene = climate({"time.steps=12", "climate.schedule=[{ time_s = 0, state = 1 }]",
                                 "frames.per_second=1", "frames.time_scale=7", "density.write_state=true"});
    const SimulationRange range = full_range(scene);
    const std::string hash(32, '0');
    Listing whole;
    for (Simulation simulation(scene, range, hash); !simulation.finished();) simulation.advance(whole);
    ASSERT_GT(whole.events.size(), 25u);
    Listing first;
    Simulation simulation(scene, range, hash);
    for (std::size_t restarts = 0;; ++restarts) {
        Listing joined = first;
        for (Simulation again(scene, range, hash, simulation.save()); !again.finished();)
            again.advance(joined);
        ASSERT_EQ(joined.events, whole.events) << "restart " << restarts;
        if (simulation.finished()) break;
        simulation.advance(first);
    }
}

TEST(Climate, ACheckpointOfOtherLayersIsRefused) {
    const Scene scene = climate({"time.steps=3"});
    const std::string hash(32, '0');
    Simulation simulation(scene, full_range(scene), hash);
    const Checkpoint good = simulation.save();
    Scene fewer = scene;
    fewer.layers.resize(2);
    EXPECT_THROW(Simulation(fewer, full_range(scene), hash, good), Error);
    for (std::size_t size = 0; size < good.automaton.size(); size += 997) {
        Checkpoint cut = good;
        cut.automaton.resize(size);
        EXPECT_THROW(Simulation(scene, full_range(scene), hash, cut), Error) << size;
    }
    for (std::size_t size = 0; size < good.history.size(); size += 997) {
        Checkpoint cut = good;
        cut.history.resize(size);
        EXPECT_THROW(Simulation(scene, full_range(scene), hash, cut), Error) << size;
    }
}

class FrameKeeper : public SimulationSink {
  public:
    void step(const StepResult&) override {}
    void frame(const FrameResult& r) override { frames.push_back(r); }
    std::vector<FrameResult> frames;
};

TEST(Climate, FramesHoldTheLayersTogether) {
    const Scene scene = climate({"time.steps=20", "frames.start_s=195", "frames.count=1",
                                 "climate.schedule=[{ time_s = 0, state = 0.5 }]"});
    Simulation simulation(scene, full_range(scene), std::string(32, '0'));
    FrameKeeper sink;
    while (!simulation.finished()) simulation.advance(sink);
    ASSERT_EQ(sink.frames.size(), 1u);
    const FrameResult& frame = sink.frames[0];
    ASSERT_EQ(frame.layers.size(), 3u);
    std::vector<DensityGrid> grids;
    for (const LayerFrame& layer : frame.layers) {
        EXPECT_GT(layer.density.max_value(), 0) << layer.name;
        EXPECT_FALSE(layer.clouds.empty()) << layer.name;
        grids.push_back(layer.density);
    }
    EXPECT_EQ(frame.density.to_dense(), combine(grids).to_dense());
    EXPECT_EQ(frame.density.placement().cell_size_m, 100);
    EXPECT_LE(frame.layers[1].density.max_value(), 0.5f) << "the opacity of the layer";
    EXPECT_LE(frame.layers[2].density.max_value(), 0.2f);
}

// T: P_Si = 1 - |St - Si| / Diff. The skies of clouds that enter a scene's layer, counted at the state of T's
// example.
TEST(Climate, CloudsEnterWithTheSharesOfTheirSkies) {
    const char* const text = R"(
[lattice]
cells = [40, 40, 10]
[time]
step_s = 10
[[wind]]
levels = [{ height_m = 0, east_m_per_s = 20, north_m_per_s = 10 }]
[[model]]
name = "a"
seeds = [{}]
[[sky]]
name = "1"
state = 0
clouds = 60
models = "a"
[[sky]]
name = "2"
state = 0.25
clouds = 60
models = "a"
[[sky]]
name = "3"
state = 0.75
clouds = 60
models = "a"
[[sky]]
name = "4"
state = 1
clouds = 60
models = "a"
[climate]
initial_state = 0
final_state = 1
duration_s = 1800
[[layer]]
name = "only"
skies = ["1", "2", "3", "4"]
base_height_m = 100
automaton = false
)";
    // T's worked example: halfway through 30 minutes St = 0.5, and the second and third sky have half each.
    const Scene moving = read_scene_text(text, "shares.toml");
    const SkyOptions options = sky_options(moving, 0);
    EXPECT_EQ(state_at(options.schedule, 900), 0.5);
    const SkyShares half = shares_at(options.skies, 0.5);
    EXPECT_EQ(half.lower, 1u);
    EXPECT_EQ(half.upper, 2u);
    EXPECT_EQ(half.lower_fraction, 0.5);

    for (const double state : {0.5, 0.35, 0.9}) {
        const Scene scene =
            read_scene_text(text, "shares.toml", {},
                            std::vector<std::string>{"climate.duration_s=0", "climate.initial_state=0",
                                                     "climate.final_state=" + std::to_string(state)});
        LayerSimulation layer(scene, 0);
        const SkyShares shares = shares_at(layer.sky()->options().skies, state);
        std::uint32_t seen = 60;  // those scattered at the start come from one sky
        double lower = 0, entered = 0;
        for (int n = 0; n < 4000; ++n) {
            layer.step();
            for (const SkyCloud& cloud : layer.sky()->clouds()) {
                if (cloud.serial < seen) continue;
                ASSERT_TRUE(cloud.sky == shares.lower || cloud.sky == shares.upper);
                ++entered;
                lower += cloud.sky == shares.lower;
            }
            for (const SkyCloud& cloud : layer.sky()->clouds()) seen = std::max(seen, cloud.serial + 1);
        }
        ASSERT_GT(entered, 10000);
        const double sigma = std::sqrt(entered * shares.lower_fraction * shares.upper_fraction);
        EXPECT_NEAR(lower, entered * shares.lower_fraction, 4 * sigma) << "state " << state;
    }
}

// No cloud stays for more than the step that brings it in and the one that takes it out; nothing hangs, and
// their number stays that of the sky.
TEST(Climate, WindMayCrossTheWorldInOneStep) {
    const Scene scene =
        climate({"wind=[{ levels = [{ height_m = 0, east_m_per_s = 1000, north_m_per_s = -900 }] }]",
                 "time.steps=20"});
    std::vector<LayerSimulation> layers = make_layers(scene);
    std::vector<std::uint32_t> youngest{0, 0, 0};
    for (int n = 0; n < 20; ++n) {
        step_all(layers);
        const SkySimulation& sky = *layers[0].sky();
        EXPECT_EQ(sky.count(), std::size_t(clouds_at(sky.options().skies, sky.state())));
        youngest.push_back(sky.clouds().back().serial);
        for (const SkyCloud& cloud : sky.clouds())
            EXPECT_GT(cloud.serial, youngest[youngest.size() - 4]) << n;
    }
}

// A layer that is drawn directly has clouds and rain, and no density.
TEST(Climate, ALayerWithoutAutomatonIsASkyAlone) {
    Scene scene = climate({"time.steps=5", "frames.start_s=15", "frames.count=1"});
    for (LayerOptions& layer : scene.layers) {
        layer.automaton = false;
        layer.rain.find = false;
    }
    EXPECT_FALSE(has_density(scene));
    Simulation simulation(scene, full_range(scene), std::string(32, '0'));
    FrameKeeper sink;
    while (!simulation.finished()) simulation.advance(sink);
    ASSERT_EQ(sink.frames.size(), 1u);
    EXPECT_EQ(sink.frames[0].density.active_voxels(), 0u);
    const LayerFrame& low = sink.frames[0].layers[0];
    EXPECT_TRUE(low.direct);
    EXPECT_EQ(low.clouds.size(), 12u);
    // 15 s is the middle of the second step.
    SkySimulation sky(sky_options(scene, 0));
    sky.step();
    ASSERT_EQ(sky.clouds().size(), 12u);
    for (std::size_t n = 0; n < 12; ++n) {
        EXPECT_EQ(sky.ahead(sky.clouds()[n], 10, 5), low.clouds[n]);
    }
    EXPECT_NE(make_layers(scene)[0].hash(), sink.frames[0].hash);
}

// The shipped climate: fair weather without rain, then a cloudy sky that rains below clouds and where rain is
// found. No area flickers: each is listed without a gap, drifts no faster than the wind and the growth of its
// patch, and sets in and fades by small steps.
TEST(Climate, TheShippedSceneGoesFromFairWeatherToRainWithoutFlicker) {
    const Scene scene = read_scene(fs::path(NEPHOS_SOURCE_DIR) / "scenes/climate.toml");
    std::vector<LayerSimulation> layers;
    layers.emplace_back(scene, 0);
    const LayerSimulation& low = layers[0];
    std::map<std::uint64_t, std::pair<std::uint64_t, RainArea>> last;  // step and area by id
    std::map<std::uint64_t, std::size_t> sources;
    std::uint64_t fair = 0;
    for (std::uint64_t step = 1; step <= std::uint64_t(scene.steps); ++step) {
        step_all(layers);
        if (step == 60) fair = cloudy_cells(low);
        for (const RainArea& area : low.rain()) {
            EXPECT_GT(step, 60u) << "rain in fair weather";
            if (const auto known = last.find(area.id); known != last.end()) {
                const auto& [when, before] = known->second;
                EXPECT_EQ(when + 1, step) << "area " << area.id << " was gone for a while";
                EXPECT_LT(std::hypot(area.x_m - before.x_m, area.y_m - before.y_m), 600);
                EXPECT_LT(std::abs(area.intensity_mm_per_h - before.intensity_mm_per_h), 0.5);
            } else {
                ++sources[area.id >> 62];
            }
            last[area.id] = {step, area};
        }
    }
    EXPECT_GT(fair, 1000u);
    EXPECT_GT(cloudy_cells(low), 10 * fair);
    EXPECT_GT(sources[1], 20u) << "attached to nimbostratus";
    EXPECT_GT(sources[2], 5u) << "found in the automaton";
}

// Every shipped scene with layers is stepped: all its skies live, and what has an automaton grows cloud.
TEST(Climate, EveryShippedSceneCanBeStepped) {
    std::size_t scenes = 0;
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(NEPHOS_SOURCE_DIR) / "scenes")) {
        if (entry.path().extension() != ".toml") continue;
        const Scene scene = read_scene(entry.path());
        if (scene.layers.empty()) continue;
        SCOPED_TRACE(entry.path().string());
        std::vector<LayerSimulation> layers = make_layers(scene);
        for (int n = 0; n < 12; ++n) step_all(layers);
        for (const LayerSimulation& layer : layers) {
            if (layer.is_veil()) continue;  // tests/simulation/veil_layer_test.cpp
            const auto& of_layer = *std::ranges::find(scene.layers, layer.name(), &LayerOptions::name);
            const bool has_clouds = !layer.sky()->clouds().empty();
            if (!has_clouds && of_layer.scatters.empty() && !of_layer.rain.placed.empty()) continue;  // that of veils
            EXPECT_EQ(has_clouds, of_layer.scatters.empty()) << layer.name();
            if (layer.automaton()) {
                const BitPlaneView cld = layer.automaton()->cld();
                EXPECT_TRUE(std::any_of(cld.words, cld.words + cld.word_count(), [](auto w) {
                    return w != 0;
                })) << layer.name();
            }
        }
        ++scenes;
    }
    EXPECT_GE(scenes, 18u);
}

// A run with layers on disk: its files, and that an interruption leaves no trace.
TEST(Climate, ARunHasFilesOfEveryLayerAndCanBeResumed) {
    const fs::path base = fs::temp_directory_path() / ("nephos climate " + std::to_string(::getpid()));
    RunSettings settings;
    settings.scene = climate({"time.steps=8", "frames.per_second=1", "frames.time_scale=25",
                              "climate.schedule=[{ time_s = 0, state = 1 }]", "density.write_velocity=true"});
    settings.scene_text = to_toml(settings.scene);
    settings.scene_hash = scene_hash(settings.scene);
    settings.simulation_hash = simulation_hash(settings.scene);
    settings.range = full_range(settings.scene);
    settings.render = false;
    settings.folder = base / "whole";
    ASSERT_TRUE(run_scene(settings, {}).complete);

    RunSettings parts = settings;
    parts.folder = base / "parts";
    parts.checkpoint_every_s = 0;
    int interruptions = 0;
    for (bool complete = false; !complete; ++interruptions) {
        ASSERT_LT(interruptions, 50);
        int pieces = 4;
        RunObserver observer;
        observer.stop = [&pieces] { return --pieces < 0; };
        parts.resume = interruptions > 0;
        complete = run_scene(parts, observer).complete;
    }
    EXPECT_GT(interruptions, 3);

    auto whole = nlohmann::json::parse(content(settings.folder / "manifest.json"));
    auto joined = nlohmann::json::parse(content(parts.folder / "manifest.json"));
    for (const char* own : {"timing", "xxh3"}) whole.erase(own);
    for (const char* own : {"timing", "xxh3"}) joined.erase(own);
    EXPECT_EQ(nlohmann::json::diff(whole, joined).dump(), "[]");
    for (const char* file : {"statistics.csv", "statistics/low.csv", "statistics/middle.csv",
                             "statistics/high.csv", "checkpoint.nephos"}) {
        EXPECT_EQ(content(settings.folder / file), content(parts.folder / file)) << file;
    }
    ASSERT_EQ(whole["layers"].size(), 3u);
    ASSERT_EQ(whole["frames"].size(), 4u);
    const auto& frame = whole["frames"][3];
    ASSERT_FALSE(frame["rain"].empty());
    EXPECT_EQ(frame["rain"][0]["layer"], "low");
    EXPECT_GT(frame["rain"][0]["intensity_mm_per_h"], 0);
    for (const auto& [layer, voxel] :
         std::map<std::string, double>{{"low", 100}, {"middle", 150}, {"high", 200}}) {
        const LoadedDensity loaded =
            load_density(settings.folder / frame["layers"][layer].get<std::string>(), VdbReadOptions{});
        EXPECT_EQ(loaded.density.placement().cell_size_m, voxel);
    }
    const LoadedDensity together =
        load_density(settings.folder / frame["density"].get<std::string>(), VdbReadOptions{});
    EXPECT_EQ(together.density.placement().cell_size_m, 100);
    EXPECT_EQ(together.density.placement().origin_m, (Vec3{-2400, -2400, 500}));

    // A run without layers in the same folder leaves nothing of them between its own files.
    RunSettings plain = settings;
    plain.scene.layers.clear();
    plain.scene.skies.clear();
    ASSERT_TRUE(run_scene(plain, {}).complete);
    EXPECT_FALSE(fs::exists(settings.folder / "density/low/climate_0001.vdb"));
    EXPECT_FALSE(fs::exists(settings.folder / "statistics/low.csv"));
    EXPECT_TRUE(fs::exists(settings.folder / "density/climate_0001.vdb"));
    fs::remove_all(base);
}

}  // namespace
}  // namespace nephos
