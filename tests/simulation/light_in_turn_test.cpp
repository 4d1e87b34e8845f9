// SPDX-License-Identifier: Apache-2.0
// Runs whose clouds follow a moving sun in turn (light.cfa_clouds_per_frame): a picture is the same drawn
// alone, within a range of frames, and by a run that was interrupted.

#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "core/error.h"
#include "scenes/format/reader.h"
#include "simulation/run_folder.h"
#include "tests/simulation/file_content.h"
#include "tests/simulation/small_run.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

constexpr const char* kScene = R"(
name = "small"
seed = 5
[time]
step_s = 120
steps = 12
[frames]
per_second = 1
time_scale = 120
[camera]
position_m = [0, -4000, 300]
target_m = [0, 0, 1200]
width = 160
height = 120
[sun]
date = "2026-06-21"
time = "17:00"
latitude_deg = 50
moves = true
[light]
cfa_clouds_per_frame = 1
[[wind]]
levels = [{ height_m = 0, from_deg = 250, speed_m_per_s = 2 }]
[[model]]
name = "tower"
light_distance_m = 1500
[[model.seeds]]
size_m = [600, 300, 200]
position_m = [0, 0, 100]
[[model.seeds]]
size_m = [300, 400, 400]
position_m = [60, 20, 400]
[[sky]]
name = "some"
state = 0
clouds = 20
models = "tower"
[[layer]]
name = "low"
skies = "some"
automaton = false
base_height_m = 900
lattice = { cells = [40, 40, 10], cell_size_m = 100, origin_m = [-2000, -2000, 600] }
formation_s = 240
dissolution_s = 240
)";

class LightInTurn : public test::SmallRun {
  protected:
    static constexpr int kFrames = 13;

    RunSettings settings(const std::string& folder) const {
        return settings_of(read_scene_text(kScene, "small.toml"), folder);
    }
    static fs::path picture(const RunSettings& s, int frame) {
        return RunFolder{s.folder, s.scene.name}.picture(frame, ".png");
    }
};

TEST_F(LightInTurn, ARangeOfFramesIsThatPartOfTheWhole) {
    const RunSettings whole = settings("whole");
    ASSERT_EQ(run_scene(whole, {}).frames, kFrames);
    RunSettings part = settings("part");
    part.range = range_of_frames(part.scene, 8, 12);
    ASSERT_EQ(run_scene(part, {}).frames, 5);
    for (int frame = 8; frame <= 12; ++frame)
        EXPECT_EQ(content(picture(part, frame)), content(picture(whole, frame))) << frame;
    RunSettings unbound = settings("unbound");
    unbound.scene.render.light.cfa_clouds_per_frame = 0;
    unbound.scene_hash = whole.scene_hash;
    run_scene(unbound, {});
    EXPECT_NE(content(picture(unbound, kFrames)), content(picture(whole, kFrames)))
        << "the bound does not show: the test proves nothing";
}

TEST_F(LightInTurn, AnInterruptionLeavesNoTrace) {
    const RunSettings whole = settings("whole");
    ASSERT_TRUE(run_scene(whole, {}).complete);
    RunSettings stopped = settings("stopped");
    stopped.checkpoint_every_s = 0;
    int pieces = 0, interruptions = 0;
    const RunObserver stop{{}, [&] { return ++pieces % 9 == 0; }};
    RunReport report = run_scene(stopped, stop);
    stopped.resume = true;
    for (; interruptions < 100 && !report.complete; ++interruptions) report = run_scene(stopped, stop);
    ASSERT_TRUE(report.complete);
    EXPECT_GE(interruptions, 2);
    for (int frame = 1; frame <= kFrames; ++frame)
        EXPECT_EQ(content(picture(stopped, frame)), content(picture(whole, frame))) << frame;
}

// The thread that draws is in the middle of a picture, and what it draws stays until it is done (seen by AddressSanitizer).
TEST_F(LightInTurn, AFolderThatGoesWhileCloudsAreDrawnEndsTheRun) {
    std::string many = kScene;  // clouds, which are gathered and lit before a picture is drawn
    many.replace(many.find("clouds = 20"), 11, "clouds = 600");
    many.replace(many.find("width = 160"), 11, "width = 320");
    for (const int last : {1, 2, 3}) {
        RunSettings gone = settings_of(read_scene_text(many, "many.toml"), "gone" + std::to_string(last));
        const auto rename = [&](const RunProgress& progress) {
            if (progress.frames >= last && fs::exists(gone.folder))  // some are never told on a busy machine
                fs::rename(gone.folder, gone.folder.string() + " elsewhere");
        };
        try {
            run_scene(gone, {rename, {}});
            ADD_FAILURE() << "ended as if nothing had happened";
        } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::io);
            EXPECT_NE(std::string(error.what()).find("the folder was removed or renamed"), std::string::npos)
                << error.what();
        }
    }
}

}  // namespace
}  // namespace nephos
