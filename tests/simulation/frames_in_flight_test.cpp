// SPDX-License-Identifier: Apache-2.0
// Runs whose pictures a device draws while the next are prepared leave the files of those that draw one by
// one.

#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "core/error.h"
#include "simulation/run_folder.h"
#include "simulation/simulation.h"
#include "tests/reference/with_threads.h"
#include "tests/simulation/file_content.h"
#include "tests/simulation/small_run.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

class FramesInFlight : public test::SmallRun {
  protected:
    static constexpr int kFrames = 8;

    RunSettings settings(const std::string& folder) const {
        Scene scene = small_scene(kFrames - 1);
        scene.frames.png = true;
        scene.render.camera.width = 120;
        scene.render.camera.height = 90;
        scene.render.shadow_map_size = 64;
        RunSettings s = settings_of(scene, folder);
        s.device.splatting = Splatting::vulkan;
        return s;
    }

    static fs::path picture(const RunSettings& s, int frame) {
        return RunFolder{s.folder, s.scene.name}.picture(frame, ".png");
    }
    static void expect_same_pictures(const RunSettings& a, const RunSettings& b) {
        for (int frame = 1; frame <= kFrames; ++frame)
            EXPECT_EQ(content(picture(a, frame)), content(picture(b, frame))) << frame;
    }
};

TEST_F(FramesInFlight, HaveTheSameFiles) {
    const RunSettings one = settings("one"), several = settings("several");
    const RunReport report = test::with_threads(1, [&] { return run_scene(one, {}); });
    EXPECT_EQ(report.frames, kFrames);
    EXPECT_EQ(test::with_threads(4, [&] { return run_scene(several, {}); }).frames, kFrames);
    expect_same_pictures(one, several);
    EXPECT_NE(content(picture(one, 1)), content(picture(one, kFrames))) << "the cloud grows";
}

// Stopped between any two pieces of work, pictures that were begun are finished and written.
TEST_F(FramesInFlight, MayBeInterrupted) {
    const RunSettings whole = settings("whole");
    run_scene(whole, {});
    RunSettings stopped = settings("stopped");
    stopped.checkpoint_every_s = 0;
    int pieces = 0;
    const RunObserver stop{{}, [&] { return ++pieces % 4 == 0; }};
    RunReport report = run_scene(stopped, stop);
    stopped.resume = true;
    for (int n = 0; n < 100 && !report.complete; ++n) {
        for (int frame = 1; frame <= report.frames; ++frame) EXPECT_TRUE(fs::exists(picture(stopped, frame)));
        report = run_scene(stopped, stop);
    }
    EXPECT_TRUE(report.complete);
    expect_same_pictures(whole, stopped);
}

// The pictures before one that cannot be written are all there.
TEST_F(FramesInFlight, EndWithTheFirstThatCannotBeWritten) {
    const RunSettings s = settings("full");
    const fs::path obstacle = picture(s, 5);
    bool placed = false;
    const RunObserver observer{[&](const RunProgress&) {
                                   if (placed || !fs::exists(obstacle.parent_path())) return;
                                   fs::create_directories(obstacle / "in the way");
                                   placed = true;
                               },
                               {}};
    try {
        run_scene(s, observer);
        ADD_FAILURE() << "a picture was written over a folder";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::io);
        EXPECT_NE(std::string(error.what()).find(obstacle.filename().string()), std::string::npos)
            << error.what();
    }
    ASSERT_TRUE(placed);
    for (int frame = 1; frame < 5; ++frame) EXPECT_TRUE(fs::is_regular_file(picture(s, frame))) << frame;
    for (int frame = 6; frame <= kFrames; ++frame) EXPECT_FALSE(fs::exists(picture(s, frame))) << frame;
}

}  // namespace
}  // namespace nephos
