// SPDX-License-Identifier: Apache-2.0

// What a scene takes from other files: velocities, probabilities, and the states that layers start from.

#include "simulation/scene_files.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>
#include <unistd.h>

#include "core/error.h"
#include "density/vdb/vdb_file.h"
#include "scenes/format/errors.h"
#include "scenes/format/reader.h"
#include "simulation/billboard_files.h"
#include "simulation/frame_writer.h"
#include "simulation/layer_simulation.h"
#include "simulation/memory.h"
#include "simulation/simulation.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

class SceneFiles : public testing::Test {
  protected:
    void SetUp() override {
        folder_ = fs::temp_directory_path() / ("nephos-scene-files-" + std::to_string(::getpid()));
        fs::create_directories(folder_);
        openvdb::initialize();
    }
    void TearDown() override { fs::remove_all(folder_); }

    // A grid of 4 x 3 x 2 points, 500 m apart.
    template <class Grid>
    void write(const std::string& name, const std::string& grid_name, const typename Grid::ValueType& value,
               const typename Grid::ValueType& first) {
        auto grid = Grid::create();
        grid->setName(grid_name);
        auto transform = openvdb::math::Transform::createLinearTransform(500.0);
        transform->postTranslate(openvdb::Vec3d(250, 250, 100));
        grid->setTransform(transform);
        auto accessor = grid->getAccessor();
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < 3; ++j)
                for (int k = 0; k < 2; ++k) accessor.setValue({i, j, k}, i == 0 ? first : value);
        openvdb::io::File((folder_ / name).string()).write({grid});
    }

    Scene read(const std::string& text) {
        std::ofstream(folder_ / "scene.toml") << "[lattice]\ncells = [40, 32, 16]\n" << text;
        return read_scene(folder_ / "scene.toml");
    }
    static std::string hash_after(const Scene& scene, int steps) {
        std::vector<LayerSimulation> layers = make_layers(scene);
        for (int step = 0; step < steps; ++step)
            for (LayerSimulation& layer : layers) layer.step();
        return combined_hash(layers).hex();
    }

    fs::path folder_;
    const std::string field_ = "[field.background]\nhum = 0.1\nact = 0.01\next = 0.1\n";
};

TEST_F(SceneFiles, VelocitiesMoveTheCells) {
    write<openvdb::Vec3SGrid>("even.vdb", "wind", {3.75f, 0, 0}, {3.75f, 0, 0});
    write<openvdb::Vec3SGrid>("uneven.vdb", "wind", {3.75f, 0, 0}, {0, 2, 1});
    const Scene even = read(field_ + "[[wind_field]]\nkind = \"grid\"\nfiles = \"even.vdb\"\n");
    const Scene profile = read(field_ + "[[wind]]\nlevels = [{ height_m = 0, east_m_per_s = 3.75 }]\n");
    EXPECT_EQ(hash_after(even, 30), hash_after(profile, 30)) << "a uniform file is a profile";
    const Scene uneven = read(field_ + "[[wind_field]]\nkind = \"grid\"\nfiles = [\"uneven.vdb\"]\ngrid = \"wind\"\n");
    EXPECT_NE(hash_after(uneven, 30), hash_after(profile, 30));
    const Scene loaded = with_files(uneven);
    ASSERT_EQ(loaded.automaton.wind.fields[0].samples.size(), 1u);
    EXPECT_EQ(wind_at(loaded.automaton.wind, Vec3(0, 500, 300), 0), Vec3(0, 2, 1));
    EXPECT_EQ(wind_at(loaded.automaton.wind, Vec3(1000, 500, 300), 0).x, 3.75 * 0.5 + 3.75 * 0.5);
    EXPECT_NE(simulation_start(even).simulation_hash, simulation_start(uneven).simulation_hash)
        << "what is in the file belongs to the simulation";
}

// Cells have motions of their own, and memory for them, only where the wind of the files is no profile.
TEST_F(SceneFiles, WindsThatAreProfilesTakeNoMemoryForMotions) {
    write<openvdb::Vec3SGrid>("even.vdb", "wind", {3.75f, 0, 0}, {3.75f, 0, 0});
    write<openvdb::Vec3SGrid>("uneven.vdb", "wind", {3.75f, 0, 0}, {0, 2, 1});
    const std::string wind = "[[wind_field]]\nkind = \"grid\"\nfiles = ";
    const Scene even = read(wind + "\"even.vdb\"\n"), uneven = read(wind + "\"uneven.vdb\"\n");
    const std::size_t enough = memory_estimate_bytes(with_files(even), RunParts::statistics);
    EXPECT_GT(memory_estimate_bytes(even, RunParts::statistics), enough) << "nobody knows yet";
    EXPECT_NO_THROW(check_memory(even, {enough, "limit"}, RunParts::statistics));
    EXPECT_THROW(check_memory(even, {enough - 1, "limit"}, RunParts::statistics), Error);
    EXPECT_THROW(check_memory(uneven, {enough, "limit"}, RunParts::statistics), Error);
}

// As of key frames: further, and sums over the steps of a frame would not fit.
TEST_F(SceneFiles, WindsThatMoveTheAirTooFarAreRefused) {
    write<openvdb::Vec3SGrid>("storm.vdb", "wind", {200.f, 0, 0}, {200.f, 0, 0});
    const std::string wind =
        "cell_size_m = 1\n" + field_ +
        "[[wind_field]]\nkind = \"grid\"\nfiles = \"storm.vdb\"\n[frames]\ncount = 1\n[time]\nstep_s = ";
    const double step_s = kMaxCellsOfStep / 200;
    const auto hash = [&](double seconds) {
        return hash_after(read(wind + std::to_string(seconds) + "\n"), 1);
    };
    EXPECT_NO_THROW(hash(0.99 * step_s));
    try {
        hash(1.01 * step_s);
        FAIL() << "an error was expected";
    } catch (const Error& error) {
        EXPECT_NE(std::string(error.what()).find("at most 2^24 cells are possible"), std::string::npos)
            << error.what();
    }
}

TEST_F(SceneFiles, ASequenceIsLinearInTime) {
    write<openvdb::Vec3SGrid>("a.vdb", "wind", {0, 0, 0}, {0, 0, 0});
    write<openvdb::Vec3SGrid>("b.vdb", "wind", {8, 0, 0}, {8, 0, 0});
    const Scene scene = with_files(
        read("[[wind_field]]\nkind = \"grid\"\nfiles = [\"a.vdb\", \"b.vdb\"]\nstart_s = 100\ninterval_s = 40\n"));
    EXPECT_EQ(wind_at(scene.automaton.wind, Vec3(9, 9, 9), 110).x, 2);
    EXPECT_EQ(wind_at(scene.automaton.wind, Vec3(9, 9, 9), 999).x, 8);
}

TEST_F(SceneFiles, ProbabilitiesComeFromAFile) {
    write<openvdb::FloatGrid>("p.vdb", "p_hum", 0.1f, 0.1f);
    write<openvdb::FloatGrid>("q.vdb", "p_hum", 0.1f, 0.6f);
    const Scene constant = read(field_), from_file = read("[field.background]\nact = 0.01\next = 0.1\n"
                                                          "[[field.grids]]\nof = \"hum\"\nfile = \"p.vdb\"\n");
    EXPECT_EQ(hash_after(constant, 20), hash_after(from_file, 20)) << "0.1 as a float is 0.1 as a threshold";
    const Scene other = read("[field.background]\nact = 0.01\next = 0.1\n[[field.grids]]\nof = \"hum\"\nfile = \"q.vdb\"\n");
    EXPECT_NE(hash_after(constant, 20), hash_after(other, 20));
}

TEST_F(SceneFiles, TheVelocityGridHasTheField) {
    Scene scene = read(field_ + "[[wind]]\nlevels = [{ height_m = 0, north_m_per_s = 1 }]\n"
                                "[[wind_field]]\nkind = \"vortex\"\nx_m = 1000\ny_m = 800\nradius_m = 400\nspeed_m_per_s = 6\n");
    const Wind& wind = scene.automaton.wind;
    const DensityGrid density = DensityGrid::from_dense(std::vector<float>(40 * 32 * 16, 0.5f), scene.automaton.extent,
                                                        scene.automaton.placement);
    VdbContent content;
    content.density = &density;
    for (int k = 0; k < 16; ++k) content.wind.push_back(wind_at(wind, (k + 0.5) * 50, 0));
    content.wind_field = [&](const Vec3& place) { return velocity_of(wind.fields, place, 0); };
    write_vdb(folder_ / "out.vdb", content, {});
    const SampleGrid grid = read_samples(folder_ / "out.vdb", "vel", 3);
    ASSERT_EQ(grid.points, (std::array<int, 3>{40, 32, 16}));
    for (const Vec3 index : {Vec3(2, 3, 4), Vec3(30, 10, 0), Vec3(20, 16, 15)}) {
        const Vec3 place = scene.automaton.placement.origin_m + 50.0 * (index + 0.5), expected = wind_at(wind, place, 0);
        for (int part = 0; part < 3; ++part) EXPECT_NEAR(sample_at(grid, place, part), expected[part], 1e-6);
    }
}

// Veils do not move with fields, so their velocity grid has the profile alone; the layer beside it has both.
TEST_F(SceneFiles, TheVelocityGridOfAVeilIsTheProfile) {
    const Scene scene = read(
        "[density]\nwrite_velocity = true\n[[wind]]\nlevels = [{ height_m = 0, north_m_per_s = 3 }]\n"
        "[[wind_field]]\nkind = \"vortex\"\nx_m = 1000\ny_m = 800\nradius_m = 400\nspeed_m_per_s = 6\n"
        "[[model]]\nname = \"Cu\"\nseeds = [{ size_m = [400, 400, 200] }]\n"
        "[[sky]]\nname = \"fair\"\nstate = 0\nclouds = 6\nmodels = \"Cu\"\n"
        "[[layer]]\nname = \"Cu\"\nskies = \"fair\"\nbase_height_m = 300\n"
        "background = { hum = 0.5, act = 0.5, ext = 0 }\n[[layer]]\nname = \"St\"\n"
        "[layer.veil]\nform = \"stratus\"\nwavelength_m = 1000\noctaves = 1\nsheet = 0.5\n");
    struct Writer : SimulationSink {
        explicit Writer(const Scene& scene, const fs::path& folder) : files(scene, {folder, "veil"}) {}
        void step(const StepResult&) override {}
        void frame(const FrameResult& frame) override {
            if (written.empty()) written = files.write_density(frame);
        }
        FrameWriter files;
        std::vector<WrittenFile> written;
    } writer(scene, folder_);
    for (Simulation s(scene, full_range(scene), std::string(32, '0')); !s.finished() && writer.written.empty();)
        s.advance(writer);
    ASSERT_EQ(writer.written.size(), 3u);
    const Vec3 place{1400, 800, 400};  // where the vortex is fastest
    const auto velocity = [&](std::size_t file, int part) {
        return sample_at(read_samples(writer.written[file].path, "vel", 3), place, part);
    };
    EXPECT_NEAR(velocity(2, 1), 3, 1e-6);
    EXPECT_GT(std::abs(velocity(1, 1) - 3), 1);
    EXPECT_GT(std::abs(velocity(0, 1) - 3), 1) << "the file of all layers";
}

TEST_F(SceneFiles, BadFilesAreNamed) {
    write<openvdb::FloatGrid>("p.vdb", "p", 0.1f, 1.4f);
    write<openvdb::Vec3SGrid>("v.vdb", "wind", {1, 0, 0}, {2, 0, 0});
    const auto error_of = [&](const std::string& text) -> std::string {
        try {
            make_layers(read(text));
            return "none";
        } catch (const Error& error) {
            return error.what();
        }
    };
    const std::string wind = "[[wind_field]]\nkind = \"grid\"\nfiles = ", grids = "[[field.grids]]\nof = \"act\"\nfile = ";
    EXPECT_NE(error_of(wind + "\"none.vdb\"\n").find("none.vdb: No such file or directory"), std::string::npos);
    EXPECT_NE(error_of(wind + "\"p.vdb\"\n").find("there is no vec3s grid in it; it has `p` (float)"), std::string::npos)
        << error_of(wind + "\"p.vdb\"\n");
    EXPECT_NE(error_of(wind + "\"v.vdb\"\ngrid = \"air\"\n").find("no vec3s grid `air`"), std::string::npos);
    EXPECT_NE(error_of(grids + "\"v.vdb\"\n").find("no float grid"), std::string::npos);
    EXPECT_NE(error_of(grids + "\"p.vdb\"\n").find("has the value 1.4: expected probabilities 0..1"), std::string::npos)
        << error_of(grids + "\"p.vdb\"\n");
}

// Every file that a scene names and nobody can use has its place in the text, in `validate` all of them at once, from top
// to bottom.
TEST_F(SceneFiles, BadFilesHaveTheirPlace) {
    const std::string text = R"(initial_state = "start.vdb"
[ground]
height_map = "alps.png"
[[wind_field]]
kind = "grid"
files = ["a.vdb",
         "none.vdb"]
[[field.grids]]
of = "hum"
file = "p.vdb"
[[model]]
name = "Cu"
seeds = [{}]
textures = ["wisp.png"]
)";
    write<openvdb::Vec3SGrid>("a.vdb", "wind", {1, 0, 0}, {2, 0, 0});
    write<openvdb::FloatGrid>("p.vdb", "p", 0.1f, 1.4f);
    std::ofstream(folder_ / "alps.png") << "no picture";
    const Scene scene = read(text);
    struct Expected {
        const char* key;
        const char* what;
        int line, column;
    };
    const Expected expected[] = {{"lattice.initial_state", "start.vdb: No such file", 3, 17},
                                 {"ground.height_map", "alps.png", 5, 14},
                                 {"wind_field[0].files[1]", "none.vdb: No such file", 9, 10},
                                 {"field.grids[0].file", "p.vdb: has the value 1.4", 12, 8},
                                 {"model[0].textures[0]", "wisp.png", 16, 13}};
    try {
        check_files(scene);
        FAIL() << "nothing was thrown";
    } catch (const SceneErrors& errors) {
        ASSERT_EQ(errors.problems().size(), std::size(expected)) << errors.what();
        for (std::size_t n = 0; n < std::size(expected); ++n) {
            const Problem& problem = errors.problems()[n];
            SCOPED_TRACE(expected[n].key);
            EXPECT_TRUE(problem.message.starts_with("`" + std::string(expected[n].key) + "`: ")) << problem.message;
            EXPECT_NE(problem.message.find(expected[n].what), std::string::npos) << problem.message;
            EXPECT_TRUE(problem.where.file.ends_with("scene.toml"));
            EXPECT_EQ(problem.where.line, expected[n].line);
            EXPECT_EQ(problem.where.column, expected[n].column);
            EXPECT_GT(problem.caret, 0);
            EXPECT_TRUE(problem.expected.starts_with("expected a file that can be read: ")) << problem.expected;
        }
    }
    const auto place_of = [](const auto& call) -> std::string {
        try {
            call();
        } catch (const SceneErrors& errors) {
            EXPECT_EQ(errors.problems().size(), 1u);
            EXPECT_EQ(errors.code() == ErrorCode::io, errors.problems()[0].message.find("1.4") == std::string::npos);
            return errors.problems()[0].message.substr(0, errors.problems()[0].message.find(':'));
        }
        return "none";
    };
    EXPECT_EQ(place_of([&] { initial_state(scene); }), "`lattice.initial_state`");
    EXPECT_EQ(place_of([&] { with_files(scene); }), "`wind_field[0].files[1]`");
    EXPECT_EQ(place_of([&] { with_files(read("[[field.grids]]\nof = \"hum\"\nfile = \"p.vdb\"\n")); }),
              "`field.grids[0].file`");
    EXPECT_EQ(place_of([&] { read_textures(scene); }), "`model[0].textures[0]`");
    EXPECT_EQ(place_of([&] { read_terrain(scene); }), "`ground.height_map`");
    Scene built;
    built.initial_state_file = folder_ / "none.vdb";
    EXPECT_THROW(
        {
            try {
                check_files(built);
            } catch (const SceneErrors&) {
                FAIL() << "there is no text";
            }
        },
        Error);
}

// Parcels of [field] and of the layer, clouds of skies and a state from a file in one layer.
TEST_F(SceneFiles, LayersStartFromFilesAndHaveParcels) {
    const std::string sky = "[[sky]]\nname = \"clear\"\nstate = 0\n";
    const std::string layer = "[[layer]]\nname = \"one\"\nskies = \"clear\"\nbase_height_m = 100\n";
    const Scene alone = read(field_);
    std::vector<LayerSimulation> layers = make_layers(alone);
    for (int step = 0; step < 10; ++step) layers[0].step();
    const Automaton& automaton = *layers[0].automaton();
    VdbContent content;
    content.hum = automaton.hum();
    content.act = automaton.act();
    content.cld = automaton.cld();
    content.cells = automaton.options().placement;
    write_vdb(folder_ / "state.vdb", content, {});
    const Scene started = read(sky + layer + "lattice = { initial_state = \"state.vdb\" }\n");
    const std::vector<LayerSimulation> from_file = make_layers(started);
    EXPECT_EQ(from_file[0].automaton()->hash(), automaton.hash());
    EXPECT_NE(simulation_start(started).simulation_hash, simulation_start(read(sky + layer)).simulation_hash);

    const std::string parcel = "centre_m = [1000, 800, 400]\ncentre = { hum = 0.5, act = 0.05, ext = 0.05 }\n";
    const Scene shared = read("[[field.ellipsoids]]\n" + parcel + sky + layer),
                own = read(sky + layer + "[[layer.ellipsoids]]\n" + parcel);
    EXPECT_EQ(hash_after(shared, 15), hash_after(own, 15));
    EXPECT_NE(hash_after(shared, 15), hash_after(read(sky + layer), 15));
}

}  // namespace
}  // namespace nephos
