// SPDX-License-Identifier: Apache-2.0

// The rain of a frame: from the cloud that is there, or none.

#include <string>
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
    const Weather weather = weather_of(scene, frames, {}, 0);
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

// Wind that grows with height: the top stays below the cloud, the foot lags, and each place finds the column above its top.
TEST(RainOfAFrame, LeansFromItsCloud) {
    std::string text = kScene;
    const std::string calm = "levels = [{ height_m = 0, east_m_per_s = 0, north_m_per_s = 0 }]";
    text.replace(text.find(calm), calm.size(),
                 "levels = [{ height_m = 0, east_m_per_s = 0, north_m_per_s = 0 }, "
                 "{ height_m = 2000, east_m_per_s = 12, north_m_per_s = 0 }]");
    const Scene scene = read_scene_text(text, "rain.toml");
    const Weather weather = weather_of(scene, std::vector{frame_of(scene, {area_at(500, 500)})}, {}, 0);
    ASSERT_EQ(weather.curtains.size(), 1u);
    const RainCurtain& curtain = weather.curtains.front();
    EXPECT_GT(curtain.lean_x, 0.1);
    EXPECT_NEAR(ellipse_at(curtain, curtain.base_m).x_m, 500, 1e-6);
    EXPECT_LT(ellipse_at(curtain, 0).x_m, 450);
    // Below the western edge of the cloud's east, along the lean, and as far beside it as the lean carries.
    const double foot = 900 - curtain.lean_x * curtain.base_m;
    EXPECT_GT(cloud_above(curtain, {foot, 500, 0}).water, 0.5);
    EXPECT_EQ(cloud_above(curtain, {foot + 300, 500, 0}).water, 0);
}

// However coarse the texels are beside it.
TEST(RainOfAFrame, FallsFromSmallAreas) {
    const Scene scene = read_scene_text(kScene, "rain.toml");
    RainArea small = area_at(501, 501);
    small.semi_a_m = small.semi_b_m = 20;
    const Weather weather = weather_of(scene, std::vector{frame_of(scene, {small})}, {}, 0);
    ASSERT_EQ(weather.curtains.size(), 1u);
    EXPECT_NEAR(weather.curtains[0].base_m, 850, 1);
}

TEST(RainOfAFrame, BeginsInTheMiddleOfTheBasesWithoutDensity) {
    const Scene scene = read_scene_text(kScene, "rain.toml");
    LayerFrame frame;
    frame.rain = {area_at(1500, 500)};
    const Weather weather = weather_of(scene, std::vector{frame}, {}, 0);
    ASSERT_EQ(weather.curtains.size(), 1u);
    EXPECT_EQ(weather.curtains[0].base_m, 1000);
    EXPECT_EQ(weather.curtains[0].cloud, nullptr);
    // As a density file of the whole scene is drawn.
    const DensityGrid file = frame_of(scene, {}).density;
    EXPECT_TRUE(weather_of(scene, std::vector{frame}, file, 0).curtains.empty()) << "no cloud in the east";
    frame.rain = {area_at(500, 500)};
    const Weather below = weather_of(scene, std::vector{frame}, file, 0);
    ASSERT_EQ(below.curtains.size(), 1u);
    EXPECT_NEAR(below.curtains[0].base_m, 850, 1);
}

}  // namespace
}  // namespace nephos
