// SPDX-License-Identifier: Apache-2.0
// The shipped storm, in which everything that weather has is on at once: each way of drawing clouds shows the
// same picture of it, whatever was drawn before and by however many threads.

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "scenes/format/reader.h"
#include "simulation/frame_painter.h"
#include "simulation/simulation.h"
#include "tests/reference/with_threads.h"
#include "tests/simulation/apart_by.h"

namespace nephos {
namespace {

// With cells three to four times as large, to be quick, and with fog: then everything is on.
Scene coarse_storm() {
    const std::vector<std::string> overrides{"camera.width=96",
                                             "camera.height=72",
                                             "layer[0].lattice.cells=[60, 67, 9]",
                                             "layer[0].lattice.cell_size_m=300",
                                             "layer[1].lattice.cells=[50, 50, 16]",
                                             "layer[1].lattice.cell_size_m=640",
                                             "layer[2].lattice.cells=[128, 115, 8]",
                                             "layer[2].lattice.cell_size_m=250",
                                             "wet_ground.texels=64",
                                             "precipitation.particles=5000",
                                             "fog.extinction_per_m=0.0002",
                                             "fog.height_m=300",
                                             "frames.exr=true",
                                             // `blended` has none; ShippedScenes and MarchBackends compare it.
                                             "detail.enabled=false", "layer[0].detail.enabled=false",
                                             "layer[2].detail.enabled=false"};
    return read_scene(std::filesystem::path(NEPHOS_SOURCE_DIR) / "scenes/storm.toml", overrides);
}

struct Comparison : SimulationSink {
    explicit Comparison(const Scene& s) : scene(s) {}
    void step(const StepResult&) override {}
    void frame(const FrameResult& frame) override {
        if (frame.number != 30 && frame.number != 47 && frame.number != 81) return;
        const std::vector<float> expected = painters[0].draw(frame).beauty;
        const auto [least, most] = std::ranges::minmax(expected);
        EXPECT_GT(most, 2 * least) << "nothing to see";
        for (std::size_t way = 1; way < 3; ++way) {
            const std::vector<float> other = painters[way].draw(frame).beauty;
            const float apart = test::apart_by(expected, other);
            // Tiles end at a transmittance of 1/4096, some a few balls sooner: what stands by a flash behind
            // them may have a radiance of 30.
            const bool flashes = flash_at(scene.render.lightning, frame.time_s).has_value();
            EXPECT_LT(apart, flashes ? 1.0f / 255 + 30.0f / 4096 : 1.0f / 255)
                << "frame " << frame.number << ", way " << way;
        }
        FramePainter new_painter(scene, {.splatting = Splatting::cpu});
        for (const std::size_t threads : {1, 3})
            EXPECT_EQ(test::with_threads(threads, [&] { return new_painter.draw(frame).beauty; }), expected)
                << "frame " << frame.number << ", " << threads << " threads";
        ++compared;
    }

    const Scene& scene;
    FramePainter painters[3] = {FramePainter(scene, {.validation = true, .splatting = Splatting::cpu}),
                                FramePainter(scene, {.validation = true, .splatting = Splatting::vulkan}),
                                FramePainter(scene, {.validation = true, .splatting = Splatting::blended})};
    int compared = 0;
};

TEST(Storm, IsTheSameInEveryBackend) {
    const Scene scene = coarse_storm();
    Comparison comparison(scene);
    Simulation simulation(scene, full_range(scene), std::string(32, '0'));
    while (!simulation.finished()) simulation.advance(comparison);
    EXPECT_EQ(comparison.compared, 3);
    for (const FramePainter& painter : comparison.painters)
        for (const std::string& message : painter.renderer().validation_messages()) ADD_FAILURE() << message;
}

}  // namespace
}  // namespace nephos
