// SPDX-License-Identifier: Apache-2.0
// The exposure of a run's pictures: it follows from frame to frame, and an interruption changes no byte of it.

#include <cmath>
#include <filesystem>

#include <gtest/gtest.h>

#include "core/error.h"
#include "render/image/exposure.h"
#include "render/image/image_file.h"
#include "simulation/frame_painter.h"
#include "simulation/frame_writer.h"
#include "tests/simulation/file_content.h"
#include "tests/simulation/small_run.h"

namespace nephos {
namespace {

using FrameExposure = test::SmallRun;

Picture grey(float value) {
    Picture picture;
    picture.width = 16;
    picture.height = 12;
    picture.beauty.assign(3 * picture.pixels(), value);
    return picture;
}

TEST_F(FrameExposure, FollowsTheFrameBeforeAndOutlivesAnInterruption) {
    Scene scene = small_scene(4);
    scene.frames.per_second = 10;
    scene.render.camera.exposure = Exposure::automatic;
    scene.render.camera.adaptation_s = 0.2;
    const FramePainter painter(scene, DeviceOptions{.splatting = Splatting::cpu});
    const auto write = [&](FrameWriter& writer, int number) {
        FrameResult frame;
        frame.number = number;
        writer.write_picture(frame, grey(number < 2 ? 0.5f : 0.01f), painter);
    };
    const auto folder = [&](const char* name) {
        std::filesystem::create_directories(base_ / name / "frames");
        return RunFolder{base_ / name, scene.name};
    };
    const RunFolder whole = folder("whole"), broken = folder("broken");
    FrameWriter all(scene, whole), before(scene, broken), after(scene, broken);
    for (int number = 1; number <= 4; ++number) write(all, number);
    for (int number = 1; number <= 2; ++number) write(before, number);
    for (int number = 3; number <= 4; ++number) write(after, number);
    double last = metered_ev(grey(0.5f));
    EXPECT_EQ(read_png_exposure(whole.picture(1, ".png")), last);
    for (int number = 2; number <= 4; ++number) {
        const double target = metered_ev(grey(0.01f)), ev = read_png_exposure(whole.picture(number, ".png"));
        EXPECT_NEAR(ev, target + (last - target) * std::exp(-0.5), 1e-12);
        EXPECT_EQ(content(whole.picture(number, ".png")),
                  content(broken.picture(number, ".png")));
        last = ev;
    }
    FrameWriter lost(scene, folder("lost"));
    EXPECT_THROW(write(lost, 3), Error);  // the frame before is not there
    FrameWriter chosen(scene, folder("chosen"), 3);
    write(chosen, 3);  // the first that is asked for
    EXPECT_EQ(read_png_exposure(base_ / "chosen" / "frames" / whole.picture(3, ".png").filename()),
              metered_ev(grey(0.01f)));
}

}  // namespace
}  // namespace nephos
