// SPDX-License-Identifier: Apache-2.0

// The rain of a frame: from the cloud that is there, or none.

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "render/options/camera.h"
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

// A sky of clouds of one billboard each, 600 m wide and 300 m high, their middles at 1000 m.
SkyOptions billboards() {
    BaseModel model;
    model.name = "one";
    Seed seed;
    seed.size_m = {1, 1, 1};
    seed.billboards = {1, 1};
    seed.billboard_width_m = {600, 600};
    seed.billboard_height_m = {300, 300};
    model.seeds = {seed};
    SkyOptions options;
    options.world = {-20'000, -20'000, 20'000, 20'000};
    options.models = {model};
    options.skies = {{"only", 0, 4, {{0, 1}}}};
    options.base_height_m = {1000, 1000};
    return options;
}

// Rain of clouds that are drawn directly begins at the underside of each billboard, and there is none beside it.
TEST(RainOfAFrame, BeginsAtTheBillboardsOfALayerWithoutVoxels) {
    const Scene scene = read_scene_text(kScene, "rain.toml");
    const SkySimulation sky(billboards());
    LayerFrame frame;
    frame.sky = &sky;
    frame.clouds.assign(sky.clouds().begin(), sky.clouds().begin() + 1);
    frame.direct = true;
    const Vec3 cloud = sky.position_m(frame.clouds.front());
    frame.rain = {area_at(cloud.x, cloud.y), area_at(cloud.x + 250, cloud.y), area_at(cloud.x + 900, cloud.y)};
    const Weather weather = weather_of(scene, std::vector{frame}, {}, 0);
    ASSERT_EQ(weather.curtains.size(), 2u) << "none where no billboard is above";
    for (const RainCurtain& curtain : weather.curtains) {
        ASSERT_NE(curtain.cloud, nullptr);
        EXPECT_NEAR(cloud_above(curtain, {cloud.x, cloud.y, 100}).base_m, 850, 2);
        EXPECT_NEAR(cloud_above(curtain, {cloud.x + 200, cloud.y, 100}).base_m, 1000 - 150 * std::sqrt(5.0) / 3, 10);
        EXPECT_GT(cloud_above(curtain, {cloud.x, cloud.y, 100}).water, 0.95);
        EXPECT_EQ(cloud_above(curtain, {cloud.x + 330, cloud.y, 100}).water, 0);
    }
    EXPECT_LE(weather.curtains[0].base_m, 1001);
    // A cloud that has hardly formed has no rain.
    frame.clouds.front().phase = 0;
    EXPECT_TRUE(weather_of(scene, std::vector{frame}, {}, 0).curtains.empty());
}

// The pixel of a place, in a picture that it lies in.
std::array<double, 2> pixel_of(const Camera& camera, const Vec3& place_m) {
    const CameraFrame view = camera_frame(camera);
    const Vec3 d = place_m - view.position_m;
    const double depth = dot(d, view.forward);
    return {camera.width * 0.5 * (1 + dot(d, view.right) / (depth * view.half_width)),
            camera.height * 0.5 * (1 - dot(d, view.up) / (depth * view.half_height))};
}

// The mean radiance of a square of 5 pixels with its centre at a place, which cuts the pixels at its sides.
std::array<double, 3> colour_at(const Picture& picture, const Camera& camera, const Vec3& place_m) {
    constexpr double kHalf = 2.5;
    const auto [x, y] = pixel_of(camera, place_m);
    const auto share = [](int pixel, double centre) {
        return std::max(0.0, std::min(pixel + 1.0, centre + kHalf) - std::max(double(pixel), centre - kHalf)) / (2 * kHalf);
    };
    std::array<double, 3> sum{};
    for (int row = int(y - kHalf); row <= int(y + kHalf); ++row)
        for (int column = int(x - kHalf); column <= int(x + kHalf); ++column) {
            EXPECT_TRUE(column >= 0 && column < picture.width && row >= 0 && row < picture.height) << "outside";
            for (std::size_t c = 0; c < 3; ++c)
                sum[c] += share(row, y) * share(column, x) *
                          double(picture.beauty.at(3 * std::size_t(row * picture.width + column) + c));
        }
    return sum;
}

// What a place in the rain looks like does not depend on what else the picture shows: its light is that of the place. The
// bar is 1 %, for a view that turns by 22 degrees to both sides and by 7 up and down, from dark cloud to bright sky.
TEST(RainOfAFrame, KeepsItsColourWhileTheCameraTurns) {
    const std::vector<std::string> settings{"precipitation.particles=0", "atmosphere.model=physical",
                                            "light_shafts.strength=0"};
    Scene scene = read_scene_text(kScene, "rain.toml", {}, settings);
    Camera& camera = scene.render.camera;
    camera.width = 320;
    camera.height = 240;
    camera.vertical_fov_deg = 50;
    camera.position_m = {900, -1900, 60};
    const std::vector<Vec3> targets{{600, 600, 450}, {1700, 600, 700}, {-500, 600, 150}};
    const std::vector<Vec3> places{{600, 600, 250}, {450, 600, 450}, {750, 600, 600}};
    std::vector<std::array<double, 3>> seen[2];
    for (const bool rains : {false, true}) {
        FramePainter painter(scene, {.splatting = Splatting::cpu});
        FrameResult frame;
        frame.layers = {frame_of(scene, {})};
        RainArea area = area_at(600, 600);
        area.intensity_mm_per_h = 60;
        if (rains) frame.layers.front().rain.push_back(area);
        for (const Vec3& target : targets) {
            camera.target_m = target;
            painter.set_scene(scene, true);
            const Picture picture = painter.draw(frame);
            for (const Vec3& place : places) seen[rains].push_back(colour_at(picture, camera, place));
        }
    }
    for (std::size_t n = 0; n < seen[1].size(); ++n) {
        const std::size_t first = n % places.size();
        SCOPED_TRACE(fmt::format("view {}, place {}", n / places.size(), first));
        double rain = 0;
        for (std::size_t c = 0; c < 3; ++c) {
            EXPECT_NEAR(seen[1][n][c], seen[1][first][c], 0.01 * seen[1][first][c]);
            rain = std::max(rain, std::abs(seen[1][n][c] / seen[0][n][c] - 1));
        }
        EXPECT_GT(rain, 0.06) << "the rain is hardly seen there";
    }
}

}  // namespace
}  // namespace nephos
