// SPDX-License-Identifier: Apache-2.0

// The rain of a frame: from the cloud that is there, or none.

#include <vector>

#include <gtest/gtest.h>

#include "scenes/format/reader.h"
#include "simulation/frame_painter.h"

namespace nephos {
namespace {

const char* const kScene = R"(
name = "rain"
seed = 1
[time]
step_s = 10
steps = 1
[[wind]]
levels = [{ height_m = 0, east_m_per_s = 0, north_m_per_s = 0 }]
[[sky]]
name = "none"
state = 0
clouds = 0
[[layer]]
name = "low"
skies = "none"
base_height_m = [900, 1100]
lattice = { cells = [20, 20, 10], cell_size_m = 100, origin_m = [0, 0, 500] }
[precipitation]
enabled = true
)";

// A cloud of 10 x 20 columns in the west; its base is at 800 m, at 1200 m in the north.
LayerFrame frame_of(const Scene& scene, std::vector<RainArea> rain) {
    const LayerOptions& layer = scene.layers.front();
    std::vector<float> values(layer.extent.cells(), 0.0f);
    for (int k = 3; k < 10; ++k)
        for (int j = 0; j < 20; ++j)
            for (int i = 0; i < 10; ++i)
                if (j < 10 || k >= 7) values[std::size_t((k * 20 + j) * 20 + i)] = 1.0f;
    LayerFrame frame;
    frame.density = DensityGrid::from_dense(values, layer.extent, layer.placement);
    frame.rain = std::move(rain);
    return frame;
}

RainArea area_at(double x_m, double y_m) {
    RainArea area;
    area.x_m = x_m;
    area.y_m = y_m;
    area.semi_a_m = area.semi_b_m = 300;
    return area;
}

TEST(RainOfAFrame, BeginsAtTheCloudThatIsThere) {
    const Scene scene = read_scene_text(kScene, "rain.toml");
    const std::vector<LayerFrame> frames{
        frame_of(scene, {area_at(500, 500), area_at(500, 1500), area_at(1500, 500), area_at(500, 1000)})};
    const Weather weather = weather_of(scene, frames, 0);
    ASSERT_EQ(weather.curtains.size(), 3u) << "none in the east, where there is no cloud";
    EXPECT_NEAR(weather.curtains[0].base_m, 850, 1);  // the middle of the lowest voxels
    EXPECT_NEAR(weather.curtains[1].base_m, 1250, 1);
    EXPECT_NEAR(weather.curtains[2].base_m, 1250, 1) << "the higher of both";
    ASSERT_NE(weather.curtains[2].cloud, nullptr);
    EXPECT_NEAR(cloud_above(weather.curtains[2], {500, 850, 100}).base_m, 850, 1);
    EXPECT_NEAR(cloud_above(weather.curtains[2], {500, 1150, 100}).base_m, 1250, 1);
    EXPECT_GT(cloud_above(weather.curtains[2], {500, 850, 100}).water, 0.5);
    EXPECT_EQ(cloud_above(weather.curtains[2], {1500, 850, 100}).water, 0);
}

TEST(RainOfAFrame, BeginsInTheMiddleOfTheBasesWithoutDensity) {
    const Scene scene = read_scene_text(kScene, "rain.toml");
    LayerFrame frame;
    frame.rain = {area_at(1500, 500)};
    const Weather weather = weather_of(scene, std::vector{frame}, 0);
    ASSERT_EQ(weather.curtains.size(), 1u);
    EXPECT_EQ(weather.curtains[0].base_m, 1000);
    EXPECT_EQ(weather.curtains[0].cloud, nullptr);
}

}  // namespace
}  // namespace nephos
