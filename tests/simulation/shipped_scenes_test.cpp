// SPDX-License-Identifier: Apache-2.0
// Every way of drawing shows the same picture of every shipped scene, in every pixel.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "scenes/format/reader.h"
#include "simulation/simulation.h"
#include "tests/simulation/drawn_frame.h"

namespace nephos {
namespace {

std::filesystem::path scenes_folder() { return std::filesystem::path(NEPHOS_SOURCE_DIR) / "scenes"; }

// Paths from the folder of scenes on.
std::vector<std::string> shipped_scenes() {
    std::vector<std::string> scenes;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(scenes_folder()))
        if (entry.path().extension() == ".toml")
            scenes.push_back(std::filesystem::relative(entry.path(), scenes_folder()).string());
    std::ranges::sort(scenes);
    return scenes;
}

// Small pictures, in which voxels are merged as in those of the shipped size; all else is as shipped.
Scene small_pictures_of(const std::string& file) {
    Scene scene = read_scene(scenes_folder() / file);
    Camera& camera = scene.render.camera;
    scene.render.level_of_detail.pixels *= 108.0 / camera.height;
    camera.width = 144;
    camera.height = 108;
    return scene;
}

std::size_t metaball_count(const FrameResult& frame) {
    std::size_t count = frame.layers.empty() ? frame.density.active_voxels() : 0;
    for (const LayerFrame& layer : frame.layers) count += layer.direct ? 0 : layer.density.active_voxels();
    return count;
}

struct Comparison : SimulationSink {
    explicit Comparison(const Scene& s) : scene(s) {}
    void step(const StepResult&) override {}
    void frame(const FrameResult& frame) override {
        const Picture expected = test::drawn_frame(scene, frame, renderers[0], painters[0], false);
        given = metaball_count(frame);
        clearest = *std::ranges::min_element(expected.transmittance);
        for (std::size_t way = 1; way < std::size(renderers); ++way) {
            const Picture other = test::drawn_frame(scene, frame, renderers[way], painters[way], false);
            const float beauty = test::apart_by(expected.beauty, other.beauty),
                        transmittance = test::apart_by(expected.transmittance, other.transmittance);
            ASSERT_FALSE(std::isnan(beauty) || std::isnan(transmittance)) << "way " << way;
            apart[way] = std::max(beauty, transmittance);
        }
    }

    const Scene& scene;
    Renderer renderers[3] = {Renderer({.splatting = Splatting::blended}),
                             Renderer({.splatting = Splatting::cpu}),
                             Renderer({.splatting = Splatting::vulkan})};
    SkyPainter painters[3];
    float apart[3] = {}, clearest = 1;
    std::size_t given = 0;  // metaballs, before any are merged
};

class ShippedScenes : public testing::TestWithParam<std::string> {};

TEST_P(ShippedScenes, AreTheSameInEveryBackend) {
    const Scene scene = small_pictures_of(GetParam());
    Comparison comparison(scene);
    const int middle = (frame_count(scene) + 1) / 2;
    Simulation simulation(scene, range_of_frames(scene, middle, middle), std::string(32, '0'));
    while (!simulation.finished()) simulation.advance(comparison);
    EXPECT_LT(comparison.clearest, 0.99f) << "nothing to see";
    for (std::size_t way = 1; way < 3; ++way) EXPECT_LE(comparison.apart[way], 1.0f / 255) << "way " << way;
    std::printf("frame %d, %zu metaballs, least transmittance %.3f; apart by %.5f, %.5f\n", middle,
                comparison.given, double(comparison.clearest), double(comparison.apart[1]),
                double(comparison.apart[2]));
}

INSTANTIATE_TEST_SUITE_P(Scenes, ShippedScenes, testing::ValuesIn(shipped_scenes()), [](const auto& scene) {
    std::string name;
    for (const char c : scene.param.substr(0, scene.param.size() - 5))
        if (std::isalnum(static_cast<unsigned char>(c)) != 0) name += c;
    return name;
});

}  // namespace
}  // namespace nephos
