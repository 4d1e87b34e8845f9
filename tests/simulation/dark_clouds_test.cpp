// SPDX-License-Identifier: Apache-2.0
// Dark clouds beside bright ones in one layer of an automaton: base models with a light distance absorb the light of the voxels
// in their ellipsoids (seeds/parcel_absorption.h), the same in every back-end and for either kind of lighting.

#include <algorithm>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "density/metaballs.h"
#include "scenes/format/reader.h"
#include "seeds/parcel_absorption.h"
#include "simulation/frame_painter.h"
#include "simulation/simulation.h"
#include "tests/simulation/apart_by.h"

namespace nephos {
namespace {

Scene small_scene(std::vector<std::string> more) {
    std::vector<std::string> overrides{"camera.width=96",
                                       "camera.height=72",
                                       "layer[0].lattice.cells=[128, 100, 24]",
                                       "layer[0].lattice.cell_size_m=80",
                                       "model[1].light_distance_m=300",
                                       "time.step_s=20",
                                       "time.steps=20",
                                       "frames.start_s=390",
                                       "frames.exr=true"};  // pictures have the light of their metaballs
    overrides.insert(overrides.end(), more.begin(), more.end());
    return read_scene(std::filesystem::path(NEPHOS_SOURCE_DIR) / "scenes/torchelsen/dark-and-bright.toml",
                      overrides);
}

const std::string kMetaballs = "detail.enabled=false";

// Calls work(frame) for the frame of a scene.
struct OneFrame : SimulationSink {
    explicit OneFrame(std::function<void(const FrameResult&)> w) : work(std::move(w)) {}
    void step(const StepResult&) override {}
    void frame(const FrameResult& frame) override {
        work(frame);
        ++frames;
    }
    std::function<void(const FrameResult&)> work;
    int frames = 0;
};

void with_frame(const Scene& scene, const std::function<void(const FrameResult&)>& work) {
    OneFrame sink(work);
    Simulation simulation(scene, full_range(scene), std::string(32, '0'));
    while (!simulation.finished()) simulation.advance(sink);
    ASSERT_EQ(sink.frames, 1);
}

Picture drawn(const Scene& scene, const FrameResult& frame, Splatting way = Splatting::cpu) {
    FramePainter painter(scene, {.validation = true, .splatting = way});
    Picture picture = painter.draw(frame);
    for (const std::string& message : painter.renderer().validation_messages()) ADD_FAILURE() << message;
    return picture;
}

// Each metaball has the light that it has without absorption, times what the clouds leave at its centre: the light pass and the
// absorption of voxels alike.
TEST(DarkClouds, LoseLightWhereTheirEllipsoidsAre) {
    for (const std::string lighting : {"light_pass", "cfa"}) {
        const Scene with = small_scene({kMetaballs, "light.lighting=" + lighting}),
                    without = small_scene(
                        {kMetaballs, "light.lighting=" + lighting, "layer[0].light_absorption=0"});
        with_frame(with, [&](const FrameResult& frame) {
            const LayerFrame& layer = frame.layers[0];
            std::vector<AbsorbingCloud> clouds;
            append_absorbing(clouds, *layer.sky, layer.clouds, with.layers[0].coupling, {}, frame.time_s);
            ASSERT_FALSE(clouds.empty());
            ASSERT_LT(clouds.size(), layer.clouds.size()) << "fair clouds absorb nothing";
            const ParcelAbsorption absorption(clouds, direction_to_sun(with.render.sun));
            const Picture dark = drawn(with, frame), bright = drawn(without, frame);
            const std::vector<Metaball> balls = metaballs(layer.density, with.density.metaball_radius_cells);
            ASSERT_EQ(dark.light.size(), balls.size());
            std::size_t dimmed = 0, whole = 0;
            for (std::size_t i = 0; i < balls.size(); ++i) {
                const double left = absorption.sunlight_at({balls[i].x, balls[i].y, balls[i].z});
                ASSERT_NEAR(dark.light[i], double(bright.light[i]) * left, 1e-5) << lighting << ' ' << i;
                dimmed += left < 0.5;
                whole += left == 1;
                if (left < 1) continue;
                ASSERT_EQ(dark.light[i], bright.light[i]);
            }
            EXPECT_GT(dimmed, balls.size() / 8);
            EXPECT_GT(whole, balls.size() / 8);
            EXPECT_EQ(dark.shadow, bright.shadow) << "the ground is shaded by the cloud alone";
            EXPECT_NE(dark.beauty, bright.beauty);
        });
    }
}

// By night a lightning leaves dark clouds darker than bright ones, in every back-end, and nothing is brighter for it.
TEST(DarkClouds, LoseLightningToo) {
    const std::vector<std::string> night{
        kMetaballs, "frames.exr=false", "camera.exposure=manual", "sun.elevation_deg=-15",
        "lightning=[{position_m=[0,4000,1500], time_s=389.9, intensity=3}]"};
    std::vector<std::string> none = night;
    none.push_back("layer[0].light_absorption=0");
    const Scene with = small_scene(night), without = small_scene(none);
    with_frame(with, [&](const FrameResult& frame) {
        const Picture dark = drawn(with, frame), bright = drawn(without, frame);
        double taken = 0, sum = 0;
        for (std::size_t i = 0; i < dark.beauty.size(); ++i) {
            EXPECT_LE(dark.beauty[i], bright.beauty[i] * 1.001f + 1e-4f) << i;
            taken += double(bright.beauty[i] - dark.beauty[i]);
            sum += double(bright.beauty[i]);
        }
        EXPECT_GT(taken, 0.02 * sum);
        for (const Splatting way : {Splatting::vulkan, Splatting::blended})
            EXPECT_LT(test::apart_by(dark.beauty, drawn(with, frame, way).beauty), 1.0f / 255);
    });
}

TEST(DarkClouds, AreTheSameInEveryBackend) {
    const Scene plain = small_scene({kMetaballs, "frames.exr=false"}),
                detailed = small_scene({"frames.exr=false"});
    with_frame(plain, [&](const FrameResult& frame) {
        const Picture expected = drawn(plain, frame);
        for (const Splatting way : {Splatting::vulkan, Splatting::blended})
            EXPECT_LT(test::apart_by(expected.beauty, drawn(plain, frame, way).beauty), 1.0f / 255);
    });
    with_frame(detailed, [&](const FrameResult& frame) {
        const Picture expected = drawn(detailed, frame);
        EXPECT_LT(test::apart_by(expected.beauty, drawn(detailed, frame, Splatting::vulkan).beauty),
                  1.0f / 100);
    });
}

// Marched voxels are darker, too, and none becomes brighter.
TEST(DarkClouds, HaveDetailToo) {
    const Scene with = small_scene({"frames.exr=false", "camera.exposure=manual"}),
                without = small_scene(
                    {"frames.exr=false", "camera.exposure=manual", "layer[0].light_absorption=0"});
    with_frame(with, [&](const FrameResult& frame) {
        const Picture dark = drawn(with, frame), bright = drawn(without, frame);
        double taken = 0, sum = 0;
        for (std::size_t i = 0; i < dark.beauty.size(); ++i) {
            EXPECT_LE(dark.beauty[i], bright.beauty[i] * 1.001f + 1e-4f) << i;
            taken += double(bright.beauty[i] - dark.beauty[i]);
            sum += double(bright.beauty[i]);
        }
        EXPECT_GT(taken, 0.02 * sum);
    });
}

// Infinite light distances, of all or by no key at all, leave every bit of a picture.
TEST(DarkClouds, AreNoneWithoutALightDistance) {
    const Scene infinite = small_scene({"model[1].light_distance_m=inf", "frames.exr=false"}),
                none = small_scene({"layer[0].light_absorption=0", "frames.exr=false"});
    EXPECT_FALSE(absorbs_in_voxels(infinite, 0));
    EXPECT_FALSE(absorbs_in_voxels(none, 0));
    EXPECT_TRUE(absorbs_in_voxels(small_scene({}), 0));
    with_frame(infinite, [&](const FrameResult& frame) {
        EXPECT_EQ(drawn(infinite, frame).beauty, drawn(none, frame).beauty);
    });
}

}  // namespace
}  // namespace nephos
