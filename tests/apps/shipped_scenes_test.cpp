// SPDX-License-Identifier: Apache-2.0
// Every way of drawing shows the same picture of every shipped scene, in every pixel.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "apps/pipeline.h"
#include "scenes/reader.h"
#include "tests/apps/drawn_frame.h"

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

// Small pictures; all else is as shipped.
Scene small_pictures_of(const std::string& file) {
    const std::vector<std::string> overrides{"camera.width=144", "camera.height=108"};
    return read_scene(scenes_folder() / file, overrides);
}

struct Comparison : PipelineSink {
    explicit Comparison(const Scene& s) : scene(s) {}
    void step(const StepResult&) override {}
    void frame(const FrameResult& frame) override {
        const Picture expected = test::drawn_frame(scene, frame, renderers[0], painters[0], false);
        clearest = *std::ranges::min_element(expected.transmittance);
        for (std::size_t way = 1; way < std::size(renderers); ++way) {
            const Picture other = test::drawn_frame(scene, frame, renderers[way], painters[way], false);
            for (std::size_t i = 0; i < expected.beauty.size(); ++i)
                apart[way] = std::max(apart[way], std::abs(other.beauty[i] - expected.beauty[i]) /
                                                      std::max(1.0f, expected.beauty[i]));
        }
    }

    const Scene& scene;
    Renderer renderers[4] = {Renderer({.splatting = Splatting::billboards}),
                             Renderer({.splatting = Splatting::processor}),
                             Renderer({.splatting = Splatting::tiles, .lists = TileLists::host}),
                             Renderer({.splatting = Splatting::tiles, .lists = TileLists::device})};
    SkyPainter painters[4];
    float apart[4] = {}, clearest = 1;
};

class ShippedScenes : public testing::TestWithParam<std::string> {};

TEST_P(ShippedScenes, AreTheSameInEveryWayOfDrawing) {
    const Scene scene = small_pictures_of(GetParam());
    Comparison comparison(scene);
    const int middle = (frame_count(scene) + 1) / 2;
    Pipeline pipeline(scene, range_of_frames(scene, middle, middle), std::string(32, '0'));
    while (!pipeline.finished()) pipeline.advance(comparison);
    EXPECT_LT(comparison.clearest, 0.99f) << "nothing to see";
    for (std::size_t way = 1; way < 4; ++way) EXPECT_LE(comparison.apart[way], 1.0f / 255) << "way " << way;
    std::printf("frame %d, least transmittance %.3f; apart by %.5f, %.5f, %.5f\n", middle,
                double(comparison.clearest), double(comparison.apart[1]), double(comparison.apart[2]),
                double(comparison.apart[3]));
}

INSTANTIATE_TEST_SUITE_P(Scenes, ShippedScenes, testing::ValuesIn(shipped_scenes()), [](const auto& scene) {
    std::string name;
    for (const char c : scene.param.substr(0, scene.param.size() - 5))
        if (std::isalnum(static_cast<unsigned char>(c)) != 0) name += c;
    return name;
});

}  // namespace
}  // namespace nephos
