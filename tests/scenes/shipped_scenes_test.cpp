// SPDX-License-Identifier: Apache-2.0
// Every scene in scenes/ loads, says what its name promises, and survives being written and read again.

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "scenes/format/given_keys.h"
#include "scenes/format/reader.h"
#include "scenes/format/writer.h"
#include "simulation/memory.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

const fs::path kFolder = fs::path(NEPHOS_SOURCE_DIR) / "scenes";

std::vector<fs::path> shipped_scenes() {
    std::vector<fs::path> paths;
    for (const auto& entry : fs::recursive_directory_iterator(kFolder)) {
        if (entry.path().extension() == ".toml") paths.push_back(entry.path());
    }
    std::sort(paths.begin(), paths.end());
    return paths;
}

TEST(ShippedScenes, LoadAndKeepTheirMeaning) {
    const std::vector<fs::path> paths = shipped_scenes();
    ASSERT_GE(paths.size(), 22u);
    for (const fs::path& path : paths) {
        SCOPED_TRACE(path.filename().string());
        const Scene scene = read_scene(path);
        EXPECT_EQ(scene.name, path.stem().string());
        EXPECT_NO_THROW(check(scene.automaton));
        const std::string text = to_toml(scene);
        EXPECT_EQ(read_scene_text(text, "again.toml"), scene) << text;
        const std::string given = given_toml(scene);
        EXPECT_EQ(read_scene_text(given, "again.toml"), scene) << given;
        EXPECT_EQ(given_toml(read_scene_text(given, "again.toml")), given);
        EXPECT_GT(frame_count(scene), 0);
        EXPECT_FALSE(scene.automaton.field.ellipsoids.empty() && scene.automaton.field.scatters.empty() &&
                     scene.layers.empty());
        if (path.stem().string().starts_with("cloud-")) continue;  // one cloud, to look at
        EXPECT_FALSE(scene.automaton.wind.keyframes.empty());
        // Small enough for the machines that the project is for.
        EXPECT_LT(memory_estimate_bytes(scene), std::size_t(16) << 30);
    }
}

TEST(ShippedScenes, BeginWithTheirSchema) {
    for (const fs::path& path : shipped_scenes()) {
        std::ifstream file(path);
        std::string line;
        std::getline(file, line);
        const bool top = path.parent_path() == kFolder;
        EXPECT_EQ(line, top ? "#:schema ./nephos.schema.json" : "#:schema ../nephos.schema.json") << path;
    }
}

// The lattices of the examples of Dobashi et al., and their probabilities at the centre of an ellipsoid.
TEST(ShippedScenes, HaveTheNumbersOfTheirSource) {
    const Scene cumulus = read_scene(kFolder / "cumulus.toml");
    EXPECT_EQ(cumulus.automaton.extent, (Extent{256, 128, 32}));  // theirs is 20 cells high
    ASSERT_EQ(cumulus.automaton.field.scatters.size(), 2u);
    for (const EllipsoidScatter& scatter : cumulus.automaton.field.scatters)
        EXPECT_EQ(scatter.centre, (Probabilities{0.1, 0.001, 0.1}));
    EXPECT_TRUE(cumulus.automaton.field.ellipsoids.empty());
    const Scene by_hand = read_scene(kFolder / "cumulus-by-hand.toml");
    EXPECT_EQ(by_hand.automaton.extent, (Extent{256, 128, 20}));
    EXPECT_TRUE(by_hand.automaton.field.scatters.empty());
    EXPECT_GE(by_hand.automaton.field.ellipsoids.size(), 3u);
    for (const char* file : {"shafts.toml", "stratus.toml"}) {  // his third and fourth example
        const Scene shafts = read_scene(kFolder / file);
        EXPECT_EQ(shafts.automaton.extent, (Extent{256, 256, 20})) << file;
        EXPECT_EQ(shafts.render.shells.count, 40) << file;
        EXPECT_GT(shafts.render.light_shafts.strength, 0) << file;
    }
    EXPECT_EQ(read_scene(kFolder / "large.toml").automaton.extent, (Extent{1024, 1024, 64}));
}

// The ten genera and the two ragged forms, each under its WMO abbreviation, at the heights of the temperate
// belt.
TEST(ShippedScenes, HaveEveryGenus) {
    for (const GenusFacts& facts : genera()) {
        SCOPED_TRACE(std::string(facts.abbreviation));
        std::string file(facts.abbreviation);
        std::replace(file.begin(), file.end(), ' ', '-');
        const Scene scene = read_scene(kFolder / "genera" / (file + ".toml"));
        ASSERT_EQ(scene.models.size(), 1u);
        EXPECT_EQ(scene.models[0].name, facts.abbreviation);
        EXPECT_EQ(scene.models[0].genus, facts.genus);
        ASSERT_GE(scene.layers.size(), 1u);  // a cumulonimbus has an anvil, a nimbostratus shreds, too
        const LayerOptions& layer = scene.layers[0];
        const Range base = layer.is_veil ? Range{layer.veil.base_m, layer.veil.base_m} : layer.base_height_m;
        EXPECT_GE(base.min, facts.base_temperate_m.min);
        EXPECT_LE(base.max, facts.base_temperate_m.max);
    }
}

// Any scene may take the models of all of them, by their names.
TEST(ShippedScenes, GeneraCanBeUsedInAnyScene) {
    std::string files, names;
    for (const GenusFacts& facts : genera()) {
        std::string file(facts.abbreviation);
        std::replace(file.begin(), file.end(), ' ', '-');
        files += "\"" + (kFolder / "genera" / (file + ".toml")).string() + "\", ";
        names += "\"" + std::string(facts.abbreviation) + "\", ";
    }
    const Scene scene =
        read_scene_text("models = [" + files +
                            "]\n[lattice]\ncells = [1000, 1000, 10]\n[[sky]]\nname = \"all\"\n"
                            "state = 0\nclouds = 24\ngenerated = 1\nmodels = [" +
                            names + "]\n[[layer]]\nname = \"one\"\nskies = \"all\"\nbase_height_m = 300\n",
                        "all.toml");
    ASSERT_EQ(scene.models.size(), genera().size());
    const SkySimulation sky(sky_options(scene, 0));
    EXPECT_EQ(sky.shapes().size(), genera().size());
    EXPECT_EQ(sky.clouds().size(), 24u);
}

// T's table of models and of skies.
TEST(ShippedScenes, HaveTheNumbersOfTorchelsen) {
    struct Row {
        std::size_t seeds;
        double box_m;
        std::size_t roots;
        CountRange reproductions;
        int start, end;
        CountRange billboards;
        Range size_m;
        double light_distance_m;
    };
    const double infinite = std::numeric_limits<double>::infinity();
    const Row rows[] = {{6, 20, 1, {1, 2}, 2, 3, {2, 4}, {20, 50}, infinite},
                        {9, 10, 1, {2, 4}, 2, 3, {4, 5}, {30, 50}, 100},
                        {9, 10, 2, {2, 3}, 2, 4, {2, 4}, {30, 50}, 100},
                        {8, 10, 2, {2, 3}, 2, 3, {3, 4}, {30, 50}, 100}};
    for (int n = 1; n <= 4; ++n) {
        SCOPED_TRACE(n);
        const Row& row = rows[n - 1];
        const Scene scene = read_scene(kFolder / "torchelsen" / ("cloud-" + std::to_string(n) + ".toml"));
        ASSERT_EQ(scene.models.size(), 1u);
        const BaseModel& model = scene.models[0];
        EXPECT_EQ(model.name, "Cloud " + std::to_string(n));
        EXPECT_EQ(model.light_distance_m, row.light_distance_m);
        ASSERT_EQ(model.seeds.size(), row.seeds);
        std::size_t roots = 0;
        for (const Seed& seed : model.seeds) {
            EXPECT_EQ(seed.size_m, (Vec3{row.box_m, row.box_m, row.box_m}));
            EXPECT_EQ(seed.billboards, row.billboards);
            EXPECT_EQ(seed.billboard_width_m, row.size_m);
            EXPECT_EQ(seed.billboard_height_m, row.size_m);
            for (const Root& root : seed.roots) {
                ++roots;
                EXPECT_EQ(root.reproductions, row.reproductions);
                EXPECT_EQ(root.seeds_start, row.start);
                EXPECT_EQ(root.seeds_end, row.end);
            }
        }
        EXPECT_EQ(roots, row.roots);
    }
    const Scene skies = read_scene(kFolder / "torchelsen" / "skies.toml");
    const std::vector<std::vector<int>> clouds{{50, 100}, {100, 200, 400}};
    const std::vector<std::vector<std::size_t>> models{{1, 1}, {3, 3, 2}};
    ASSERT_EQ(skies.layers.size(), 2u);
    for (std::size_t layer = 0; layer < 2; ++layer) {
        const SkyOptions options = sky_options(skies, layer);
        ASSERT_EQ(options.skies.size(), clouds[layer].size());
        for (std::size_t s = 0; s < options.skies.size(); ++s) {
            EXPECT_EQ(options.skies[s].state, 0.5 * double(s));
            EXPECT_EQ(options.skies[s].clouds, clouds[layer][s]);
            EXPECT_EQ(options.skies[s].models.size(), models[layer][s]);
            for (const SkyModel& model : options.skies[s].models) EXPECT_EQ(model.generated, 10);
        }
    }
}

// The clouds of his figures 29, 31, 33 and 35, drawn directly.
TEST(ShippedScenes, HaveTheFiguresOfTorchelsen) {
    struct Row {
        const char* file;
        std::size_t models;
        int generated;
        std::size_t least_clouds, most_clouds;
    };
    const Row rows[] = {{"cirrus", 1, 1, 1, 1},
                        {"nimbus", 1, 10, 200, 200},
                        {"rain-clouds", 2, 10, 1001, 1200},
                        {"fractostratus", 1, 10, 90, 110}};
    for (const Row& row : rows) {
        SCOPED_TRACE(row.file);
        const Scene scene = read_scene(kFolder / "torchelsen" / (std::string(row.file) + ".toml"));
        ASSERT_EQ(scene.layers.size(), 1u);
        EXPECT_FALSE(scene.layers[0].automaton);
        const SkySimulation sky(sky_options(scene, 0));
        EXPECT_GE(sky.clouds().size(), row.least_clouds);
        EXPECT_LE(sky.clouds().size(), row.most_clouds);
        ASSERT_EQ(sky.options().skies.size(), 1u);
        EXPECT_EQ(sky.options().skies[0].models.size(), row.models);
        for (const SkyModel& model : sky.options().skies[0].models) EXPECT_EQ(model.generated, row.generated);
        EXPECT_EQ(sky.shapes().size(), row.models * std::size_t(row.generated));
        std::set<std::uint32_t> shown;
        for (const SkyCloud& cloud : sky.clouds()) shown.insert(cloud.shape);
        EXPECT_EQ(shown.size(), sky.shapes().size()) << "each of them is seen";
    }
    const Scene cirrus = read_scene(kFolder / "torchelsen" / "cirrus.toml");
    const SkySimulation sky(sky_options(cirrus, 0));
    const std::vector<SeedBox>& boxes = sky.shapes()[0].cloud.boxes;
    EXPECT_EQ(boxes.size(), 15u);
    int billboards = 0;
    for (const SeedBox& box : boxes) billboards += box.billboards;
    EXPECT_NEAR(billboards, 50, 10) << "his number";
}

}  // namespace
}  // namespace nephos
