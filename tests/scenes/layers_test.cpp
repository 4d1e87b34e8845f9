// SPDX-License-Identifier: Apache-2.0
// Models from other files, and what a scene's layers become in the options of the libraries.

#include "scenes/format/layers.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>
#include <unistd.h>

#include "scenes/format/reader.h"
#include "scenes/format/warnings.h"
#include "scenes/format/writer.h"
#include "seeds/genera.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

// A folder of its own, gone afterwards.
class ModelFiles : public testing::Test {
  protected:
    void SetUp() override {
        folder_ = fs::temp_directory_path() / ("nephos-models-" + std::to_string(::getpid()));
        fs::create_directories(folder_ / "genera");
    }
    void TearDown() override { fs::remove_all(folder_); }

    void write(const std::string& name, const std::string& text) { std::ofstream(folder_ / name) << text; }
    Scene read(const std::vector<std::string>& overrides = {}) {
        return read_scene(folder_ / "scene.toml", overrides);
    }
    std::string messages(const std::vector<std::string>& overrides = {}) {
        try {
            read(overrides);
        } catch (const SceneErrors& errors) {
            return format(errors.problems());
        }
        return "no error";
    }

    fs::path folder_;
};

const std::string kCu = "[[model]]\nname = \"Cu\"\ngenus = \"Cu\"\nseeds = [{ size_m = [30, 20, 10] }]\n";

TEST_F(ModelFiles, StandBeforeTheScenesOwnModelsAndInItsHash) {
    write("genera/Cu.toml", kCu + "[[sky]]\nname = \"ignored\"\nstate = 0\n");
    write("scene.toml", "models = [\"genera/Cu.toml\"]\n[[model]]\nname = \"own\"\nseeds = [{}]\n");
    const Scene scene = read();
    ASSERT_EQ(scene.models.size(), 2u);
    EXPECT_EQ(scene.models[0].name, "Cu");
    EXPECT_EQ(scene.models[0].genus, Genus::Cu);
    EXPECT_EQ(scene.models[0].seeds[0].size_m, (Vec3{30, 20, 10}));
    EXPECT_EQ(scene.models[1].name, "own");
    EXPECT_TRUE(scene.skies.empty());
    // The canonical scene needs the file no longer.
    EXPECT_EQ(read_scene_text(to_toml(scene), "again.toml"), scene);

    const std::string before = scene_hash(scene), simulation = simulation_hash(scene);
    write("genera/Cu.toml", kCu + "# a comment\n");
    EXPECT_EQ(scene_hash(read()), before);
    write("genera/Cu.toml", kCu + "light_distance_m = 50\n" + "[[model.seeds]]\n");
    EXPECT_NE(messages(), "no error") << "seeds are given twice";
    write("genera/Cu.toml",
          "[[model]]\nname = \"Cu\"\ngenus = \"Cu\"\nseeds = [{ size_m = [30, 20, 11] }]\n");
    EXPECT_NE(scene_hash(read()), before);
    EXPECT_NE(simulation_hash(read()), simulation);
}

TEST_F(ModelFiles, CanBeSetAndChangedFromTheCommandLine) {
    write("genera/Cu.toml", kCu);
    write("scene.toml", "name = \"x\"\n");
    const std::string path = (folder_ / "genera/Cu.toml").string();
    EXPECT_EQ(read({"models=" + path}).models.size(), 1u);
    // The order of the options does not matter: files come first.
    const Scene scene = read({"model[0].light_distance_m=7", "models=[\"" + path + "\"]"});
    EXPECT_EQ(scene.models.at(0).light_distance_m, 7);
}

TEST_F(ModelFiles, ProblemsNameTheirFileAndLine) {
    write("genera/Cu.toml", kCu);
    write("scene.toml", "models = [\"genera/Cuu.toml\"]\n");
    EXPECT_NE(messages().find("did you mean \"genera/Cu.toml\"?"), std::string::npos) << messages();
    write("scene.toml", "models = \"genera\"\n");
    EXPECT_NE(messages().find("is a folder"), std::string::npos) << messages();
    write("genera/Cu.toml", "name = \"none\"\n");
    write("scene.toml", "models = \"genera/Cu.toml\"\n");
    EXPECT_NE(messages().find("has no [[model]]"), std::string::npos) << messages();
    write("genera/Cu.toml", "\n\n[[model]]\nname = \"a\"\nseeds = [{ size_m = [1, 2, -3] }]\n");
    EXPECT_NE(messages().find("genera/Cu.toml:5:28: error: `model[0].seeds[0].size_m[2]` is -3"),
              std::string::npos)
        << messages();
    write("genera/Cu.toml", "[[model]\n");
    EXPECT_NE(messages().find("genera/Cu.toml:1:"), std::string::npos) << messages();
}

// However often a file is named, and by whatever detour: its models come each time, its problems once.
TEST_F(ModelFiles, AreReadOnce) {
    write("genera/Cu.toml", kCu);
    write("scene.toml",
          "models = [\"genera/Cu.toml\", \"genera/../genera/Cu.toml\", \"scene.toml\", \"scene.toml\"]\n"
          "[[model]]\nname = \"own\"\nseeds = [{}]\n");
    const Scene scene = read({"model[1].name=b", "model[2].name=c", "model[3].name=d"});
    ASSERT_EQ(scene.models.size(), 5u);
    EXPECT_EQ(scene.models[0].seeds[0].size_m, (Vec3{30, 20, 10}));
    EXPECT_EQ(scene.models[1].seeds[0].size_m, (Vec3{30, 20, 10}));
    EXPECT_EQ(scene.models[4].name, "own");
    write("scene.toml", "models = [\"genera/Cu.toml\", \"genera/../genera/Cu.toml\"]\n");
    write("genera/Cu.toml", "[[model]\n");
    EXPECT_NE(messages().find("\n1 error\n"), std::string::npos) << messages();
    write("genera/Cu.toml", "name = \"none\"\n");
    EXPECT_NE(messages().find("\n2 errors\n"), std::string::npos) << messages();
}

// Checks that ".." behind a link leads where the system goes, not where the text of the path does.
TEST_F(ModelFiles, AreFoundThroughLinks) {
    write("genera/Cu.toml", kCu);
    write("scene.toml", "models = [\"genera/Cu.toml\"]\n");
    fs::create_directories(folder_ / "deep/er");
    fs::create_directory_symlink("deep/er", folder_ / "link");
    EXPECT_EQ(read_scene(folder_ / "link/../../scene.toml").models.size(), 1u);
    EXPECT_EQ(read_scene(folder_ / "deep/../scene.toml").models.size(), 1u);
}

TEST_F(ModelFiles, AreNoDevices) {
    write("scene.toml", "models = [\"/dev/zero\"]\n");
    EXPECT_NE(messages().find("/dev/zero: is not a regular file"), std::string::npos) << messages();
}

TEST_F(ModelFiles, AreLimitedInNumberAndSize) {
    std::string list = "models = [";
    for (int n = 0; n < 1001; ++n) {
        const std::string name = "genera/" + std::to_string(n) + ".toml";
        write(name, "model = []\n");
        list += "\"" + name + "\", ";
    }
    write("scene.toml", list + "]\n");
    EXPECT_NE(messages().find("`models[1000]`: the files up to this one are too many or too large\n"),
              std::string::npos)
        << messages();
    const std::string model = "model = []\n# ";
    write("large.toml", model + std::string(kMaxSceneBytes - model.size(), 'x'));
    list = "models = [";
    for (int n = 0; n < 3; ++n) list += "\"large.toml\", ";
    write("scene.toml", list + "]\n");
    EXPECT_NE(messages().find("`models[1]`: the files up to this one are too many or too large\n"),
              std::string::npos)
        << messages();
    EXPECT_NE(messages().find("\n1 error\n"), std::string::npos) << messages();
}

TEST_F(ModelFiles, ThatAreMissingMakeNoEndlessList) {
    write("genera/Cu.toml", kCu);
    std::string list = "models = [";
    for (int n = 0; n < 3000; ++n) list += "\"genera/Cu" + std::to_string(n % 1500) + ".toml\", ";
    write("scene.toml", list + "]\n");
    const std::string said = messages();
    EXPECT_NE(said.find("\n1001 errors\n"), std::string::npos);
    std::size_t advised = 0;
    for (std::size_t at = said.find("did you mean"); at != said.npos; at = said.find("did you mean", at + 1))
        ++advised;
    EXPECT_EQ(advised, 20u) << "for these the folder was looked through";
}

const char* const kTwoLayers = R"(
seed = 77
[lattice]
cells = [32, 16, 8]
cell_size_m = 100
origin_m = [-1600, 0, 500]
[field.background]
ext = 0.2
[[wind]]
levels = [{ height_m = 0, east_m_per_s = 5 }]
[climate]
region = "polar"
initial_state = 0.25
final_state = 1
duration_s = 600
[[model]]
name = "billboard"
seeds = [{}]
[[sky]]
name = "fair"
state = 0
clouds = 4
models = "billboard"
generated = 3
[[layer]]
name = "low"
skies = "fair"
base_height_m = 600
[[layer]]
name = "middle"
skies = "fair"
genus = "Ac"
lattice = { cells = [20, 20, 30], origin_m = [0, 0, 1000], boundaries = "periodic" }
background = { hum = 0.01 }
wind = [{ levels = [{ height_m = 0, north_m_per_s = 9 }] }]
climate = { initial_state = 0.5 }
coupling = { min_semi_axis_m = 3 }
)";

// Two zeros that are equal would be two texts and two hashes.
TEST(Layers, HaveOneZero) {
    std::string text = kTwoLayers;
    const std::string state = "initial_state = 0.5";
    text.replace(text.find(state), state.size(), "initial_state = -0.0, final_state = -0.0, duration_s = 60");
    const Scene scene = read_scene_text(text, "zero.toml");
    EXPECT_EQ(to_toml(scene).find("-0.0"), std::string::npos);
    EXPECT_EQ(scene_hash(scene), scene_hash(read_scene_text(to_toml(scene), "zero.toml")));
}

TEST(Layers, TakeWhatTheySayNotFromTheScene) {
    const Scene scene = read_scene_text(kTwoLayers, "two.toml");
    const AutomatonOptions low = automaton_options(scene, 0), middle = automaton_options(scene, 1);
    EXPECT_EQ(low.extent, scene.automaton.extent);
    EXPECT_EQ(low.placement, scene.automaton.placement);
    EXPECT_EQ(low.wind, scene.automaton.wind);
    EXPECT_EQ(low.seed, 77u) << "one layer has the bits of a scene without";
    EXPECT_EQ(middle.extent, (Extent{20, 20, 30}));
    EXPECT_EQ(middle.placement, (Placement{{0, 0, 1000}, 100}));
    EXPECT_EQ(middle.boundaries, (Boundaries{Boundary::periodic, Boundary::periodic, Boundary::periodic}));
    EXPECT_EQ(middle.field.background, (Probabilities{0.01, 0, 0.2}));
    EXPECT_EQ(wind_at(middle.wind, 0, 0), (Velocity{0, 9}));
    EXPECT_NE(middle.seed, low.seed);

    const SkyOptions sky = sky_options(scene, 1);
    EXPECT_EQ(sky.layer, 1u);
    EXPECT_EQ(sky.seed, 77u);
    EXPECT_EQ(sky.world, (WorldRectangle{0, 0, 2000, 2000}));
    EXPECT_EQ(sky.base_height_m, (Range{2000, 4000}))
        << "Ac in polar regions, cut to the lattice's 1000..4000 m";
    EXPECT_EQ(sky.schedule, (std::vector<StatePoint>{{0, 0.5}}));
    EXPECT_EQ(sky.wind, middle.wind);
    EXPECT_EQ(sky.skies.at(0).models, (std::vector<SkyModel>{{0, 3}}));
    EXPECT_EQ(sky_options(scene, 0).schedule, (std::vector<StatePoint>{{0, 0.25}, {600, 1}}));
    EXPECT_EQ(scene.layers[0].coupling.min_semi_axis_m, 100) << "a cell";
    EXPECT_EQ(scene.layers[1].coupling.min_semi_axis_m, 3);
    EXPECT_EQ(scene.layers[1].rain.column.bottom_m, 1000);
    EXPECT_EQ(scene.layers[1].rain.column.top_m, 4000);
}

// A camera looks beyond the edge of a world of clouds that are drawn directly: they must not pop up there.
// Scatters of a layer are those of its automaton, with the defaults of a field's and in its own lattice; the canonical
// scene has them too.
TEST(Layers, HaveScattersOfTheirOwn) {
    const Scene scene = read_scene_text(R"(
[[sky]]
name = "clear"
state = 0
[[layer]]
name = "Cu"
skies = "clear"
base_height_m = 900
lattice = { cells = [40, 30, 20], cell_size_m = 50, origin_m = [-100, 300, 800] }
[[layer.scatters]]
count = 4
z_m = 800
life_s = 2000
thermals = { interval_s = 90, rise_m = [300, 500] }
[[layer.scatters]]
count = 2
)",
                                        "scatters.toml");
    const AutomatonOptions options = automaton_options(scene, 0);
    ASSERT_EQ(options.field.scatters.size(), 2u);
    const EllipsoidScatter& plumes = options.field.scatters[0];
    EXPECT_EQ(plumes.x_m, (Range{-100, 1900}));
    EXPECT_EQ(plumes.y_m, (Range{300, 1800}));
    EXPECT_EQ(plumes.z_m, (Range{800, 800}));
    EXPECT_EQ(plumes.semi_axis_x_m, (Range{400, 900}));
    EXPECT_EQ(plumes.thermals.interval_s, 90);
    EXPECT_EQ(plumes.thermals.rise_m, (Range{300, 500}));
    EXPECT_TRUE(is_plume(plumes));
    EXPECT_FALSE(is_plume(options.field.scatters[1]));
    EXPECT_EQ(options.field.scatters[1].z_m, (Range{800, 1800}));
    EXPECT_NO_THROW(check(options));
    EXPECT_EQ(read_scene_text(to_toml(scene), "again.toml"), scene);
}

TEST(Layers, CloudsDrawnDirectlyFormAndDissolveAtTheEdges) {
    const auto whole = [](std::vector<std::string> overrides) {
        const Scene scene = read_scene_text(kTwoLayers, "two.toml", {}, overrides);
        EXPECT_EQ(read_scene_text(to_toml(scene), "again.toml"), scene);
        return sky_options(scene, 0).cross_edges_whole;
    };
    EXPECT_TRUE(whole({}));
    EXPECT_FALSE(whole({"layer[0].cross_edges_whole=false"}));
    EXPECT_FALSE(whole({"layer[0].automaton=false"}));
    EXPECT_TRUE(whole({"layer[0].automaton=false", "layer[0].cross_edges_whole=true"}));
}

TEST(Layers, HaveSeedsThatNeverRepeat) {
    std::vector<std::uint64_t> seeds;
    for (std::uint64_t scene : {0ull, 1ull, 77ull, ~0ull}) {
        for (std::size_t layer = 0; layer < kMaxLayers; ++layer) seeds.push_back(layer_seed(scene, layer));
    }
    std::sort(seeds.begin(), seeds.end());
    EXPECT_EQ(std::adjacent_find(seeds.begin(), seeds.end()), seeds.end());
}

// Of base models whose light distance acts on nothing, and layers that absorb nothing, the author is told.
TEST(Layers, NoteLightDistancesWithoutEffect) {
    const std::string text = R"(
name = "dark"
[[model]]
name = "Ns"
light_distance_m = 400
seeds = [{}]
[[sky]]
name = "rain"
state = 0
clouds = 3
models = "Ns"
[[layer]]
name = "low"
skies = "rain"
base_height_m = 1000
)";
    const auto notes = [&](std::vector<std::string> overrides) {
        std::string all;
        for (const std::string& note : keys_without_effect(read_scene_text(text, "dark.toml", {}, overrides)))
            all += note + "\n";
        return all;
    };
    const std::string model = "base model 'Ns': `light_distance_m` has no effect",
                      layer = "layer 'low': `light_absorption` has no effect",
                      direct = "layer 'low' is drawn directly: `light_absorption` has no effect";
    EXPECT_EQ(notes({}), "");
    EXPECT_EQ(notes({"layer[0].light_absorption=0.5"}), "");
    EXPECT_EQ(notes({"layer[0].automaton=false"}), "") << "billboards have it";
    EXPECT_EQ(notes({"layer[0].light_absorption=0"}).find(model), 0u);
    EXPECT_EQ(notes({"layer[0].coupling.strength=0"}).find(model), 0u);
    EXPECT_EQ(notes({"layer[0].light_absorption=0.5", "model[0].light_distance_m=inf"}).find(layer), 0u);
    EXPECT_EQ(notes({"layer[0].light_absorption=0.5", "layer[0].automaton=false"}).find(direct), 0u);
}

// Each key alone: where it acts nothing is said, where it does not, one note.
TEST(Layers, KeysThatDoNothingAreNamed) {
    const std::string text = R"(
[[wind]]
levels = [{ height_m = 0, east_m_per_s = 4 }]
[[model]]
name = "Cu"
seeds = [{}]
[[sky]]
name = "fair"
state = 0
clouds = 3
models = "Cu"
[[layer]]
name = "low"
skies = "fair"
base_height_m = 1000
)";
    const auto notes = [&](std::vector<std::string> overrides, const std::string& of) {
        std::string all;
        for (const std::string& note : keys_without_effect(read_scene_text(of, "keys.toml", {}, overrides)))
            all += note + "\n";
        return all;
    };
    const auto starts = [](const std::string& all, const std::string& note) {
        return all.starts_with(note) && std::ranges::count(all, '\n') == 1;
    };
    const std::string direct = "layer[0].automaton=false", profile = "field.profile=[{levels=[{height_m=0,hum=0.1}]}]";
    const std::string coupling = "layer 'low' is drawn directly: its ellipsoids, scatters, profile and coupling have no";
    EXPECT_TRUE(starts(notes({direct, "layer[0].coupling.size_scale=2"}, text), coupling));
    EXPECT_TRUE(starts(notes({direct, "layer[0].coupling.min_semi_axis_m=7"}, text), coupling));
    EXPECT_EQ(notes({"layer[0].coupling.size_scale=2"}, text), "");
    EXPECT_TRUE(starts(notes({direct, "density.refine=2"}, text), "[density] has no effect"));
    EXPECT_EQ(notes({"density.refine=2"}, text), "");
    EXPECT_TRUE(starts(notes({"light.cfa_clouds_per_frame=1"}, text), "`light.cfa_clouds_per_frame` has no effect"));
    EXPECT_EQ(notes({direct, "light.cfa_clouds_per_frame=1"}, text), "");
    const std::string horizon = "layer[0].entering=horizon", calm = "layer 'low': no cloud will ever enter or leave";
    EXPECT_EQ(notes({horizon}, text), "");
    EXPECT_EQ(notes({"wind=[]"}, text), "");
    EXPECT_TRUE(starts(notes({horizon, "wind=[]"}, text), calm));
    EXPECT_TRUE(starts(notes({horizon, "wind[0].levels[0].east_m_per_s=0"}, text), calm));

    const std::string hum = "field.background.hum=0.5", replaced = "[field.background] has no effect";
    EXPECT_TRUE(starts(notes({profile, hum}, "seed = 1"), replaced));
    EXPECT_EQ(notes({profile}, "seed = 1"), "");
    EXPECT_EQ(notes({hum}, "seed = 1"), "");
    EXPECT_TRUE(starts(notes({profile, hum}, text), replaced)) << "the layer takes the profile of [field]";
    EXPECT_EQ(notes({profile, hum, "layer[0].background.ext=0.3"}, text), "") << "the layer has a background";
    EXPECT_TRUE(starts(notes({"layer[0].profile=[{levels=[{height_m=0}]}]", "layer[0].background.hum=0.3"}, text),
                       "layer 'low': its `background` has no effect"));
    const std::string grid = "field.grids=[{of=\"hum\",file=\"a.vdb\"}]";
    EXPECT_TRUE(starts(notes({grid, hum}, "seed = 1"), "`field.background.hum` has no effect"));
    EXPECT_EQ(notes({grid, "field.background.ext=0.5"}, "seed = 1"), "");
}

// Bases of a genus are those of its climate, counted from the ground.
TEST(Layers, GeneraLieAboveTheGround) {
    const auto base = [](std::vector<std::string> overrides) {
        return read_scene_text(
                   "[lattice]\ncells = [8, 8, 100]\ncell_size_m = 200\n[[sky]]\nname = \"s\"\nstate = 0\n"
                   "[[layer]]\nname = \"a\"\nskies = \"s\"\ngenus = \"Ci\"\n",
                   "genus.toml", {}, overrides)
            .layers.front()
            .base_height_m;
    };
    EXPECT_EQ(base({}), base_height_m(Genus::Ci, Region::temperate));
    const Range polar = base_height_m(Genus::Ci, Region::polar);
    EXPECT_EQ(base({"climate.region=polar", "ground.height_m=700"}), (Range{polar.min + 700, polar.max + 700}));
    EXPECT_EQ(base({"climate.region=polar", "ground.height_m=700", "layer[0].automaton=false"}),
              (Range{polar.min + 700, polar.max + 700}));
}

// A veil, too, has the heights of its genus: its base lies in their middle, and its lattice with it, unless the scene
// says where they lie.
TEST(Layers, VeilsLieAtTheHeightsOfTheirGenus) {
    const auto layer = [](std::vector<std::string> overrides) {
        return read_scene_text("[[layer]]\nname = \"a\"\ngenus = \"Ci\"\n"
                               "[layer.lattice]\ncells = [8, 8, 10]\ncell_size_m = 200\n"
                               "[layer.veil]\nwavelength_m = 6000\n[layer.slab]\n",
                               "veil.toml", {}, overrides)
            .layers.front();
    };
    const auto expect = [](const LayerOptions& of, double bottom_m, double base_m, double top_m) {
        EXPECT_EQ(of.placement.origin_m.z, bottom_m);
        EXPECT_EQ(of.veil.base_m, base_m);
        EXPECT_EQ(of.veil.top_m, top_m);
    };
    expect(layer({}), 9000, 9000, 11'000);                      // 5 to 13 km
    expect(layer({"climate.region=polar"}), 5500, 5500, 7500);  // 3 to 8 km
    expect(layer({"climate.region=polar", "ground.height_m=700"}), 6200, 6200, 8200);
    expect(layer({"layer[0].veil.top_m=9800"}), 9000, 9000, 9800);
    expect(layer({"layer[0].lattice.origin_m=[0,0,8400]"}), 8400, 9000, 10'400);
    expect(layer({"layer[0].lattice.origin_m=[0,0,8400]", "layer[0].veil.base_m=8500"}), 8400, 8500, 10'400);

    const auto message = [&](std::vector<std::string> overrides) -> std::string {
        try {
            layer(std::move(overrides));
        } catch (const Error& error) {
            return error.what();
        }
        return "no error";
    };
    const std::string outside = message({"layer[0].lattice.origin_m=[0,0,5000]"});
    EXPECT_TRUE(outside.starts_with("veil.toml:3:9: error: the base of a veil of Ci, the middle of 5000 to 13000 m, is "
                                    "outside the 5000 to 7000 m of its lattice\n 3 | genus = \"Ci\"\n   |         ^\n"))
        << outside;
    const std::string other = message({"climate.region=polar", "layer[0].veil.base_m=8500"});
    EXPECT_NE(other.find("`layer[0].veil.base_m` is 8500; bases of Ci lie from 3000 to 8000 m"), std::string::npos)
        << other;
}

// Between two steps a cloud moves on a straight line that ends where the step puts it.
TEST(Layers, CloudsMoveOnContinuouslyBetweenSteps) {
    const Scene scene = read_scene_text(kTwoLayers, "two.toml");
    SkySimulation sky(sky_options(scene, 0));
    for (int n = 0; n < 5; ++n) sky.step();
    const SkyCloud before = sky.clouds().front();
    const SkyCloud half = sky.ahead(before, 50, 5), whole = sky.ahead(before, 50, 10);
    sky.step();
    const SkyCloud after = sky.clouds().front();
    ASSERT_EQ(after.serial, before.serial);
    EXPECT_EQ(whole, after);
    EXPECT_NEAR(sky.position_m(half).x - sky.position_m(before).x, 25, 1e-6);
    EXPECT_EQ(sky.ahead(before, 50, 0), before);
}

}  // namespace
}  // namespace nephos
