// SPDX-License-Identifier: Apache-2.0
// Scenes that run beside the window: the steps are those of the simulation, going back shows the same state, changes
// while it runs act from their step on, and failures are said.

#include "apps/editor/live.h"

#include <chrono>
#include <filesystem>
#include <functional>
#include <thread>

#include <gtest/gtest.h>

#include "apps/editor/scene_document.h"
#include "scenes/format/reader.h"
#include "simulation/layer_simulation.h"

namespace nephos {
namespace {

using Clock = std::chrono::steady_clock;

// Waits for something that other threads do; a minute is far more than it takes.
testing::AssertionResult comes(const std::function<bool()>& condition) {
    const Clock::time_point begin = Clock::now();
    while (!condition()) {
        if (Clock::now() - begin > std::chrono::minutes(1))
            return testing::AssertionFailure() << "after a minute";
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return testing::AssertionSuccess();
}

Scene small_scene(const std::string& more = {}) {
    return read_scene_text(
        "name = \"small\"\nseed = 3\n[lattice]\ncells = [48, 40, 16]\ncell_size_m = 60\norigin_m = [-1440, "
        "-1200, 900]\n"
        "[[field.scatters]]\ncount = 8\nreplace = true\nz_m = [1000, 1400]\ncentre = { hum = 0.3, act = "
        "0.05, ext = 0.1 "
        "}\n[camera]\nposition_m = [0, -3000, "
        "400]\n" +
            more,
        "small.toml");
}

std::vector<std::string> true_hashes(const Scene& scene, std::uint64_t steps) {
    std::vector<LayerSimulation> layers = make_layers(scene);
    std::vector<std::string> hashes{combined_hash(layers).hex()};
    for (std::uint64_t n = 0; n < steps; ++n) {
        for (LayerSimulation& layer : layers) layer.step();
        hashes.push_back(combined_hash(layers).hex());
    }
    return hashes;
}

LiveView small_view() {
    LiveView view;
    view.width = 96;
    view.height = 64;
    view.camera.position_m = {0, -3000, 400};
    return view;
}

TEST(LiveScene, StepsAreThoseOfTheSimulation) {
    const Scene scene = small_scene();
    LiveScene live({.splatting = Splatting::cpu});
    live.set_view(small_view());
    live.start(scene, 40);
    ASSERT_TRUE(comes([&] { return live.status().step == 40; })) << live.status().failure;
    const std::vector<LiveStep> steps = live.steps();
    const std::vector<std::string> hashes = true_hashes(scene, 40);
    ASSERT_GE(steps.size(), 41u);
    for (std::size_t n = 0; n <= 40; ++n) ASSERT_EQ(steps[n].hash.hex(), hashes[n]) << "step " << n;
    ASSERT_TRUE(comes([&] { return live.picture(0) && live.picture(0)->step == 40; }));
    EXPECT_EQ(live.frame()->frame.hash.hex(), hashes[40]);
}

TEST(LiveScene, GoesBackToTheSameState) {
    LiveScene live({.splatting = Splatting::cpu});
    live.set_view(small_view());
    live.start(small_scene(), 60);
    ASSERT_TRUE(comes([&] { return live.status().step == 60; }));
    const std::vector<LiveStep> steps = live.steps();
    for (const std::uint64_t step : {3u, 59u, 0u, 16u, 17u, 60u, 75u}) {
        live.seek(step);
        ASSERT_TRUE(comes([&] { return live.status().step == step; })) << step;
        if (step < steps.size()) {
            EXPECT_EQ(live.frame()->frame.hash, steps[step].hash) << step;
        }
        EXPECT_EQ(live.frame()->frame.step, step);
    }
}

// A wind that is changed while it runs, written down as key frames: the scene that says so, simulated from its start,
// has the bits that were seen.
TEST(LiveScene, ChangeOnTheWayEqualsItsKeyFramesFromTheStart) {
    const std::string wind = "[[wind]]\nlevels = [{ height_m = 1000, east_m_per_s = 3 }]\n";
    LiveScene live({.splatting = Splatting::cpu});
    live.set_view(small_view());
    live.start(small_scene(wind), 10);
    ASSERT_TRUE(comes([&] { return live.status().step == 10; }));
    const std::uint64_t step = live.hold();
    EXPECT_GE(step, 10u);
    const std::string before = std::to_string(10 * (step - 1)), now = std::to_string(10 * step);
    const Scene changed =
        small_scene("[[wind]]\ntime_s = " + before +
                    "\nlevels = [{ height_m = 1000, east_m_per_s = 3 }]\n[[wind]]\ntime_s = " + now +
                    "\nlevels = [{ height_m = 1000, east_m_per_s = -5, north_m_per_s = 2 }]\n");
    live.change(changed);
    live.release();
    live.seek(50);
    ASSERT_TRUE(comes([&] { return live.status().step == 50; })) << live.status().failure;
    const std::vector<LiveStep> seen = live.steps();
    const std::vector<std::string> hashes = true_hashes(changed, 50);
    ASSERT_GE(seen.size(), 51u);
    for (std::size_t n = 0; n <= 50; ++n) ASSERT_EQ(seen[n].hash.hex(), hashes[n]) << "step " << n;
    EXPECT_NE(hashes[50], true_hashes(small_scene(wind), 50)[50]);
}

TEST(LiveScene, RunsAtItsSpeedAndStops) {
    LiveScene live({.splatting = Splatting::cpu});
    live.set_view(small_view());
    live.set_speed(200);
    live.start(small_scene(), 0);
    live.run(true);
    ASSERT_TRUE(comes([&] { return live.status().step > 20; }));
    live.run(false);
    live.hold();
    const std::uint64_t step = live.status().step;
    live.release();
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    EXPECT_EQ(live.status().step, step);
    ASSERT_TRUE(comes([&] { return live.picture(0)->refined && live.picture(0)->step == step; }));
    EXPECT_EQ(live.picture(0)->width, 96);
}

// Whoever pauses on a long way stands where it is paused, and steps are counted from there at once.
TEST(LiveScene, APauseGivesUpAGoal) {
    LiveScene live({.splatting = Splatting::cpu});
    live.set_view(small_view());
    live.start(small_scene(), 100000);
    ASSERT_TRUE(comes([&] { return live.status().step > 3; }));
    EXPECT_EQ(live.status().goal, 100000u);
    live.run(false);
    const LiveStatus paused = live.status();
    EXPECT_LE(paused.goal, paused.step + 1);
}

// A simulation that is not shown goes on, without pictures; shown again it has that of its step.
TEST(LiveScene, RunsUnseen) {
    LiveScene live({.splatting = Splatting::cpu});
    live.set_view(small_view());
    live.keep_at_most(1);  // a checkpoint has more: two are kept
    live.start(small_scene(), 5);
    ASSERT_TRUE(comes([&] { return live.picture(0) && live.picture(0)->refined; }));
    live.show(false);
    const std::uint64_t number = live.picture(0)->number;
    live.seek(40);
    ASSERT_TRUE(comes([&] { return live.status().step == 40; }));
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    EXPECT_EQ(live.picture(number), nullptr);
    EXPECT_LE(live.status().checkpoints, 3u);
    EXPECT_EQ(live.frame()->frame.hash.hex(), true_hashes(small_scene(), 40)[40]);
    live.show(true);
    ASSERT_TRUE(comes([&] { return live.picture(number) && live.picture(0)->step == 40; }));
}

TEST(LiveScene, FailuresAreSaidAndAnotherSceneGoesOn) {
    LiveScene live({.splatting = Splatting::cpu});
    live.set_view(small_view());
    Scene huge = small_scene();
    huge.automaton.extent = {65536, 65536, 512};
    live.start(huge, 5);
    ASSERT_TRUE(comes([&] { return !live.status().failure.empty(); }));
    EXPECT_NE(live.status().failure.find("memory"), std::string::npos) << live.status().failure;
    live.seek(9);  // nothing goes there
    EXPECT_EQ(live.status().goal, live.status().step);
    live.start(small_scene(), 5);
    ASSERT_TRUE(comes([&] { return live.status().step == 5; }));
    EXPECT_EQ(live.status().failure, "");
    // A change takes the place of one that has failed, too.
    live.start(huge, 5);
    ASSERT_TRUE(comes([&] { return !live.status().failure.empty(); }));
    live.change(small_scene());
    live.seek(7);
    ASSERT_TRUE(comes([&] { return live.status().step == 7; }));
    EXPECT_EQ(live.status().failure, "");
    live.seek(2);
    EXPECT_TRUE(comes([&] { return live.status().step == 2; }));
    // Also while it is being made.
    for (int n = 0; n < 10; ++n) {
        live.start(huge, 5);
        ASSERT_TRUE(comes([&] { return !live.status().failure.empty(); }));
        live.change(small_scene());
        std::this_thread::sleep_for(std::chrono::microseconds(200 * n));
        live.seek(7);
        ASSERT_TRUE(comes([&] { return live.status().step == 7; }));
    }
    // One that fails while it is closed is nobody's failure.
    for (int n = 0; n < 100; ++n) {
        const std::uint64_t version = live.status().rows_version;
        live.start(huge, 5);
        std::this_thread::sleep_for(std::chrono::microseconds(2 * n));
        live.clear();
        ASSERT_TRUE(comes([&] { return live.status().rows_version != version; }));
        ASSERT_EQ(live.status().failure, "") << n;
    }
}

std::string layer_text(const std::string& name) {
    return "[[layer]]\nname = \"" + name +
           "\"\nskies = \"few\"\nautomaton = false\nbase_height_m = 1000\nlattice = { cells = [32, 32, 8], "
           "cell_size_m = 80, origin_m = [-1280, -1280, 900] }\n";
}

Scene layered_scene(int layers, double sun_deg) {
    std::string text =
        "name = \"layers\"\n[[model]]\nname = \"bank\"\nseeds = [{ size_m = [700, 600, 300], billboards = 4, "
        "billboard_width_m = [300, 500], billboard_height_m = [200, 300] }]\n[[sky]]\nname = \"few\"\nstate "
        "= "
        "0\nclouds = 5\nmodels = \"bank\"\n[sun]\nelevation_deg = " +
        std::to_string(sun_deg) + "\n";
    for (int n = 0; n < layers; ++n) text += layer_text("layer-" + std::to_string(n));
    return read_scene_text(text, "layers.toml");
}

// The clouds of a scene are drawn with its own light and layers until those of the next one are there, which here
// never come.
TEST(LiveScene, FramesAreDrawnWithTheSceneThatTheyAreOf) {
    LiveScene live({.splatting = Splatting::cpu});
    LiveView view = small_view();
    live.set_view(view);
    live.start(layered_scene(3, 40), 2);
    const auto rests = [&] {
        return live.picture(0) && live.picture(0)->refined && live.picture(0)->step == 2;
    };
    ASSERT_TRUE(comes(rests)) << live.status().failure;
    const std::vector<std::uint8_t> day = live.picture(0)->rgba;
    Scene night = layered_scene(1, -15);
    night.layers[0].automaton = true;
    night.layers[0].extent = {65536, 65536, 512};  // no memory for it
    live.start(night, 2);
    ASSERT_TRUE(comes([&] { return !live.status().failure.empty(); }));
    live.redraw(night);
    for (int turn = 0; turn < 2; ++turn) {  // drawn anew, the second time as before
        view.detail = !view.detail;
        const std::uint64_t number = live.picture(0)->number;
        live.set_view(view);
        ASSERT_TRUE(comes([&] { return live.picture(number) && live.picture(number)->refined; }));
    }
    EXPECT_TRUE(live.picture(0)->rgba == day);
    live.start(layered_scene(1, 40), 2);
    ASSERT_TRUE(comes([&] { return live.frame() && live.frame()->frame.layers.size() == 1 && rests(); }));
    EXPECT_EQ(live.status().failure, "");
}

// A camera whose heights are counted from the ground is drawn from there, in each mode, and the picture says where that is.
TEST(LiveScene, PicturesSayWhereACameraAboveTheGroundStands) {
    LiveScene live({.splatting = Splatting::cpu});
    LiveView view = small_view();
    view.camera.above_ground = true;
    live.set_view(view);
    live.start(small_scene("above_ground = true\n[ground]\nheight_m = 250\n"), 1);
    for (const int mode : {int(kBeauty), int(kVoxels), int(kWireframe)}) {
        view.mode = mode;
        live.set_view(view);
        ASSERT_TRUE(comes([&] { return live.picture(0) && live.picture(0)->view == view; })) << live.status().failure;
        EXPECT_EQ(live.picture(0)->position_m.z, 650) << mode;
        EXPECT_EQ(live.picture(0)->target_m.z, view.camera.target_m.z + 250) << mode;
    }
}

// Scenes with more and with fewer layers in turn, while views change: under a sanitizer no index is out of bounds.
TEST(LiveScene, NumberOfLayersChangesWhileItIsDrawn) {
    LiveScene live({.splatting = Splatting::cpu});
    LiveView view = small_view();
    for (int n = 0; n < 60; ++n) {
        live.start(layered_scene(1 + n * 2 % 5, 40), std::uint64_t(n % 3));
        view.mode = n % 6;
        view.hidden.assign(std::size_t(n % 4), n % 2 == 0);
        live.set_view(view);
        live.redraw(layered_scene(1 + n * 2 % 5, 20));
        std::this_thread::sleep_for(std::chrono::milliseconds(n % 7));
    }
    ASSERT_TRUE(comes([&] { return live.frame() && live.frame()->frame.layers.size() == 1 + 59 * 2 % 5; }))
        << live.status().failure;
    EXPECT_EQ(live.status().failure, "");
}

TEST(LiveScene, AClearedOneShowsNothingUntilTheNext) {
    LiveScene live({.splatting = Splatting::cpu});
    live.set_view(small_view());
    live.start(small_scene(), 20);
    ASSERT_TRUE(comes([&] { return live.status().step == 20 && live.picture(0); }));
    const std::uint64_t rows = live.status().rows_version;
    live.clear();
    ASSERT_TRUE(comes([&] { return live.status().rows == 0; }));
    std::this_thread::sleep_for(std::chrono::milliseconds(300));  // longer than a draft waits for its detail
    EXPECT_EQ(live.picture(0), nullptr);
    EXPECT_EQ(live.frame(), nullptr);
    EXPECT_GT(live.status().rows_version, rows);
    live.start(small_scene(), 3);
    ASSERT_TRUE(comes([&] { return live.status().step == 3 && live.picture(0); }));
}

TEST(LiveScene, OnlySomeChangesNeedAnotherSimulation) {
    const Scene scene = small_scene();
    Scene other = scene;
    EXPECT_EQ(change_between(scene, other), SceneChange::none);
    other.render.sun.elevation_deg = 3;
    other.density.extinction_per_m = 0.3;
    EXPECT_EQ(change_between(scene, other), SceneChange::picture);
    other.sun_path = {{0, 3, 90, {1, 1, 1}}};
    EXPECT_EQ(change_between(scene, other), SceneChange::picture);
    other.automaton.seed = 4;
    EXPECT_EQ(change_between(scene, other), SceneChange::simulation);
}

}  // namespace
}  // namespace nephos
