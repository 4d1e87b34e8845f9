// SPDX-License-Identifier: Apache-2.0

// Layers that are veils, beside one with an automaton: frames are the veil at their own time whatever the
// steps, an interruption leaves no trace, and every file of a layer is there.

#include <bit>
#include <cmath>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "core/error.h"
#include "core/wind.h"
#include "density/combine.h"
#include "density/vdb/vdb_file.h"
#include "density/veil.h"
#include "scenes/format/reader.h"
#include "scenes/format/writer.h"
#include "simulation/frame_detail.h"
#include "simulation/layer_simulation.h"
#include "simulation/memory.h"
#include "simulation/run_folder.h"
#include "simulation/simulation.h"
#include "tests/reference/with_threads.h"
#include "tests/simulation/file_content.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

const char* const kScene = R"(
name = "veils"
seed = 11
[time]
step_s = 10
steps = 6
[[wind]]
levels = [{ height_m = 0, east_m_per_s = 5, north_m_per_s = 3 }, { height_m = 8000, east_m_per_s = 20, north_m_per_s = 8 }]
[[model]]
name = "Cu"
seeds = [{ size_m = [400, 400, 200] }]
[[sky]]
name = "fair"
state = 0
clouds = 6
models = "Cu"
[[layer]]
name = "Ci"
opacity = 0.25
lattice = { cells = [40, 30, 9], cell_size_m = 200, origin_m = [-4000, -3000, 7000] }
[layer.veil]
form = "cirrus"
wavelength_m = 2000
octaves = 2
fallstreak_m = 3000
[[layer]]
name = "low"
skies = "fair"
base_height_m = 900
lattice = { cells = [32, 32, 12], cell_size_m = 100, origin_m = [-1600, -1600, 500] }
coupling = { centre = { hum = 0.2, act = 0.02, ext = 0.05 } }
[frames]
per_second = 1
time_scale = 7
)";

Scene scene_of(const std::vector<std::string>& overrides = {}) {
    return read_scene_text(kScene, "veils.toml", {}, overrides);
}

// All results in order, as text, and the frames themselves.
class Listing : public SimulationSink {
  public:
    void step(const StepResult& r) override {
        std::string text = "step " + std::to_string(r.step) + " " + r.hash.hex();
        for (const LayerStep& layer : r.layers) {
            text += " " + layer.name + " " + layer.hash.hex() + " " + std::to_string(layer.statistics.cld) +
                    " " + std::to_string(std::bit_cast<std::uint64_t>(layer.statistics.mean_density));
        }
        events.push_back(text);
        steps.push_back(r);
    }
    void frame(const FrameResult& r) override {
        std::uint64_t sum = 0;
        for (const float value : r.density.to_dense())
            sum = sum * 1000003 + std::bit_cast<std::uint32_t>(value);
        events.push_back("frame " + std::to_string(r.number) + " " + std::to_string(r.step) + " " +
                         r.hash.hex() + " " + std::to_string(sum));
        frames.push_back(r);
    }
    std::vector<std::string> events;
    std::vector<StepResult> steps;
    std::vector<FrameResult> frames;
};

Listing listing_of(const Scene& scene, const SimulationRange& range) {
    Listing listing;
    for (Simulation p(scene, range, std::string(32, '0')); !p.finished();) p.advance(listing);
    return listing;
}

TEST(VeilLayer, FramesAreTheVeilAtTheirOwnTime) {
    const Scene scene = scene_of();
    const Listing listing = listing_of(scene, full_range(scene));
    ASSERT_EQ(listing.frames.size(), 9u);  // 0, 7 .. 56 s, steps of 10 s
    const LayerOptions& layer = scene.layers[0];
    for (const FrameResult& frame : listing.frames) {
        const DensityGrid expected = scaled(veil_density(veil_options(scene, 0), scene.automaton.wind,
                                                         layer.extent, layer.placement, frame.time_s),
                                            0.25);
        ASSERT_EQ(frame.layers.size(), 2u);
        EXPECT_EQ(frame.layers[0].density.to_dense(), expected.to_dense()) << frame.time_s;
        EXPECT_LE(frame.layers[0].density.max_value(), 0.25f);
        EXPECT_GT(frame.layers[0].density.active_voxels(), 1000u);
        EXPECT_FALSE(frame.layers[0].direct);
        EXPECT_EQ(frame.layers[0].sky, nullptr);
        // Both layers in the voxels of the finer one.
        EXPECT_EQ(frame.density.placement().cell_size_m, 100);
        EXPECT_NEAR(frame.density.sum(), 8 * expected.sum() + frame.layers[1].density.sum(),
                    0.03 * frame.density.sum());
    }
    EXPECT_NE(listing.frames[0].density.to_dense(), listing.frames[8].density.to_dense());
}

// Only a table of its own gives a veil detail: along its fibres, carried by the wind of its top; its bits are those
// without.
TEST(VeilLayer, HasDetailByATableOfItsOwn) {
    const Scene plain = scene_of();
    EXPECT_FALSE(layer_detail(plain, 0).enabled);
    EXPECT_TRUE(layer_detail(plain, 1).enabled);
    EXPECT_EQ(count_detailed(plain), 1u);
    const Scene scene = scene_of({"layer[0].detail.stretch=12", "layer[0].veil.direction_deg=30"});
    EXPECT_TRUE(layer_detail(scene, 0).enabled);
    EXPECT_EQ(count_detailed(scene), 2u);
    const DensityGrid density = LayerSimulation(scene, 0).veil_at(40);
    const DetailSetting setting = detail_setting(scene, 0, density, 40);
    EXPECT_EQ(setting.options.stretch, 12);
    EXPECT_EQ(setting.opacity, 0.25);
    EXPECT_NEAR(setting.along.x, std::sqrt(0.75), 1e-12);
    EXPECT_NEAR(setting.along.y, 0.5, 1e-12);
    const Vec3 carried = wind_displacement_m(scene.automaton.wind, scene.layers[0].veil.top_m, 40);
    EXPECT_TRUE(setting.bands.apart_m.empty());  // a veil has one wind
    EXPECT_EQ(setting.drift_m.x, carried.x);
    EXPECT_EQ(setting.drift_m.y, carried.y);
    const Scene turned = scene_of({"layer[0].veil.direction_deg=30"});
    EXPECT_EQ(LayerSimulation(scene, 0).hash(), LayerSimulation(turned, 0).hash());
    EXPECT_GT(memory_estimate(scene, RunParts::pictures).pictures,
              memory_estimate(turned, RunParts::pictures).pictures);
}

// A slab is only another way of drawing the same state: runs go on with it, and files are the same.
TEST(VeilLayer, IsTheSameStateWhenItIsDrawnPerPixel) {
    const Scene lattice = scene_of(), slab = scene_of({"layer[0].slab.samples=24"});
    EXPECT_FALSE(lattice.layers[0].is_slab);
    ASSERT_TRUE(slab.layers[0].is_slab);
    EXPECT_EQ(LayerSimulation(lattice, 0).hash(), LayerSimulation(slab, 0).hash());
    EXPECT_EQ(simulation_hash(lattice, ""), simulation_hash(slab, ""));
    EXPECT_EQ(read_scene_text(to_toml(slab), "again.toml"), slab);
}

TEST(VeilLayer, StepsHaveItsStatisticsAndAHashOfTheirOwn) {
    const Scene scene = scene_of();
    const Listing listing = listing_of(scene, full_range(scene));
    ASSERT_EQ(listing.steps.size(), 7u);
    for (std::size_t n = 0; n < listing.steps.size(); ++n) {
        const LayerStep& veil = listing.steps[n].layers[0];
        EXPECT_GT(veil.statistics.cld, 1000u);
        EXPECT_GT(veil.statistics.cover, 0.2);
        EXPECT_GE(veil.statistics.base_m, 7000);
        EXPECT_LE(veil.statistics.top_m, 8800);
        EXPECT_GT(veil.statistics.mean_density, 0.001);
        EXPECT_LT(veil.statistics.mean_density, 0.25);
        for (std::size_t m = 0; m < n; ++m) EXPECT_NE(veil.hash, listing.steps[m].layers[0].hash);
    }
    // Of what decides the density and of nothing else.
    const auto first_hash = [](const std::vector<std::string>& overrides) {
        return LayerSimulation(scene_of(overrides), 0).hash();
    };
    EXPECT_EQ(first_hash({}), listing.steps[0].layers[0].hash);
    EXPECT_EQ(first_hash({"layer[1].opacity=0.5", "density.refine=2", "frames.time_scale=9"}),
              first_hash({}));
    for (const char* change : {"seed=12", "layer[0].veil.coverage=0.4", "layer[0].opacity=0.5",
                               "wind[0].levels[1].east_m_per_s=21", "layer[0].lattice.cell_size_m=190"}) {
        EXPECT_NE(first_hash({change}), first_hash({})) << change;
    }
}

TEST(VeilLayer, HasTheSameBitsOnAnyNumberOfThreads) {
    const Scene scene = scene_of();
    const auto run = [&] { return listing_of(scene, full_range(scene)).events; };
    const std::vector<std::string> one = test::with_threads(1, run);
    for (const std::size_t threads : {2, 3, 8}) EXPECT_EQ(test::with_threads(threads, run), one) << threads;
}

TEST(VeilLayer, GoesOnWithTheSameResultsAfterAnyInterruption) {
    for (const std::vector<std::string>& overrides :
         {std::vector<std::string>{"density.write_state=true"}, std::vector<std::string>{}}) {
        const Scene scene = scene_of(overrides);
        const SimulationRange range = full_range(scene);
        const Listing whole = listing_of(scene, range);
        Listing first;
        Simulation simulation(scene, range, std::string(32, '0'));
        for (std::size_t restarts = 0;; ++restarts) {
            Listing joined = first;
            for (Simulation again(scene, range, std::string(32, '0'), simulation.save());
                 !again.finished();) {
                again.advance(joined);
            }
            ASSERT_EQ(joined.events, whole.events) << "restart " << restarts;
            if (simulation.finished()) break;
            simulation.advance(first);
        }
    }
}

// A branch may change a veil, whose hash then is another one from the next step on: the state goes on all the same, and can be
// saved at once.
TEST(VeilLayer, GoesOnAsAnotherVeil) {
    for (const std::string smoothing : {"density.smoothing.t0=0", "density.smoothing.t0=2"}) {
        const Scene scene = scene_of({smoothing}), longer = scene_of({"time.steps=8", smoothing}),
                    changed = scene_of({"layer[0].veil.coverage=0.7", "time.steps=8", smoothing});
        const std::string name(32, '0'), changed_name(32, '1');
        const Listing before = listing_of(longer, full_range(longer)),
                      after = listing_of(changed, full_range(changed));
        Simulation simulation(scene, full_range(scene), name);
        Listing first;
        while (simulation.next_step() < 4) simulation.advance(first);
        Checkpoint point = simulation.save();
        const auto branch_of = [&](const Checkpoint& from) {
            return Simulation(changed, full_range(changed), changed_name, from, SimulationResults::everything,
                              Restart::branch);
        };
        Listing rest, saved_at_once;
        for (Simulation branch = branch_of(point); !branch.finished();) branch.advance(rest);
        for (Simulation again(changed, full_range(changed), changed_name,
                              branch_of(branch_of(point).save()).save());
             !again.finished();)
            again.advance(saved_at_once);
        EXPECT_EQ(saved_at_once.events, rest.events);
        ASSERT_EQ(rest.steps.size(), 5u);
        // A step that the other run has taken keeps its hash, in rows and in frames that follow.
        const auto hash_of_step = [&](std::uint64_t step) {
            return (step > point.steps ? after : before).steps[step].hash;
        };
        for (const StepResult& step : rest.steps) {
            EXPECT_EQ(step.layers[1].hash, before.steps[step.step].layers[1].hash) << step.step;
            EXPECT_EQ(step.hash, hash_of_step(step.step)) << step.step;
        }
        ASSERT_FALSE(rest.frames.empty());
        for (const FrameResult& frame : rest.frames) {
            EXPECT_EQ(frame.hash, hash_of_step(frame.step)) << frame.number;
            EXPECT_EQ(frame.layers[0].density.to_dense(),
                      after.frames[std::size_t(frame.number) - 1].layers[0].density.to_dense());
        }
        EXPECT_THROW(Simulation(changed, full_range(changed), changed_name, point), Error)
            << "not without a branch";
        point.state.low ^= 1;
        EXPECT_THROW(branch_of(point), Error);
    }
}

TEST(VeilLayer, ARangeOfFramesIsThatPartOfTheWhole) {
    const Scene scene = scene_of();
    const Listing whole = listing_of(scene, full_range(scene)),
                  part = listing_of(scene, range_of_frames(scene, 4, 6));
    ASSERT_EQ(part.frames.size(), 3u);
    for (std::size_t n = 0; n < 3; ++n) {
        EXPECT_EQ(part.frames[n].density.to_dense(), whole.frames[n + 3].density.to_dense());
        EXPECT_EQ(part.frames[n].hash, whole.frames[n + 3].hash);
    }
}

TEST(VeilLayer, ACheckpointOfAnotherLengthIsRefused) {
    LayerSimulation layer(scene_of(), 0);
    layer.step();
    layer.step();
    std::vector<std::byte> bytes = layer.save();
    LayerSimulation other(scene_of(), 0);
    other.restore(bytes);
    EXPECT_EQ(other.steps(), 2u);
    EXPECT_EQ(other.hash(), layer.hash());
    bytes.push_back({});
    EXPECT_THROW(other.restore(bytes), Error);
    EXPECT_THROW(other.restore(std::span(bytes).first(5)), Error);
}

TEST(VeilLayer, ARunHasItsFiles) {
    const fs::path base = fs::temp_directory_path() / ("nephos veils " + std::to_string(::getpid()));
    RunSettings settings;
    settings.scene = scene_of({"time.steps=2", "density.write_velocity=true", "density.write_state=true"});
    settings.scene_text = to_toml(settings.scene);
    settings.scene_hash = scene_hash(settings.scene);
    settings.simulation_hash = simulation_hash(settings.scene);
    settings.range = full_range(settings.scene);
    settings.render = false;
    settings.folder = base;
    ASSERT_TRUE(run_scene(settings, {}).complete);
    const auto manifest = nlohmann::json::parse(content(base / "manifest.json"));
    EXPECT_EQ(manifest["layers"][0]["veil"], true);
    EXPECT_EQ(manifest["layers"][0]["automaton"], false);
    EXPECT_EQ(manifest["layers"][1]["veil"], false);
    ASSERT_EQ(manifest["frames"].size(), 3u);
    const auto& frame = manifest["frames"][2];
    const LoadedDensity loaded =
        load_density(base / frame["layers"]["Ci"].get<std::string>(), VdbReadOptions{});
    const LayerOptions& layer = settings.scene.layers[0];
    const DensityGrid expected =
        scaled(veil_density(veil_options(settings.scene, 0), settings.scene.automaton.wind, layer.extent,
                            layer.placement, 14),
               0.25);
    EXPECT_EQ(loaded.density.to_dense(), expected.to_dense());
    EXPECT_EQ(loaded.density.placement(), layer.placement);
    EXPECT_TRUE(fs::exists(base / frame["density"].get<std::string>()));
    EXPECT_TRUE(fs::exists(base / "statistics/Ci.csv"));
    fs::remove_all(base);
}

TEST(VeilLayer, IsReadWrittenAndReckonedWith) {
    const Scene scene = scene_of();
    const LayerOptions& layer = scene.layers[0];
    EXPECT_TRUE(layer.is_veil);
    EXPECT_FALSE(layer.automaton);
    EXPECT_EQ(layer.veil.base_m, 7000);
    EXPECT_EQ(layer.veil.top_m, 8800);
    EXPECT_NEAR(layer.veil.direction_deg, 21.8014, 1e-4);  // of (20, 8)
    EXPECT_EQ(read_scene_text(to_toml(scene), "again.toml"), scene);
    EXPECT_EQ(to_toml(scene).find("coupling", to_toml(scene).find("[[layer]]")),
              to_toml(scene).find("coupling", to_toml(scene).find("\"low\"")));
    const Scene listed = scene_of({"layer[0].veil={ octave = [{ weight = 2 }, { crest = 1 }] }"});
    ASSERT_EQ(listed.layers[0].veil.octaves.size(), 2u);
    EXPECT_EQ(listed.layers[0].veil.octaves[1].crest, 1);
    EXPECT_EQ(read_scene_text(to_toml(listed), "again.toml"), listed);

    const Scene larger = scene_of({"layer[0].lattice.cells=[400, 300, 9]", "density.half=true"});
    EXPECT_GT(memory_estimate(larger).density, memory_estimate(scene).density + 99 * 40 * 30 * 9 * 4 * 3);
    EXPECT_EQ(memory_estimate(larger).automaton, memory_estimate(scene).automaton);
}

}  // namespace
}  // namespace nephos
