// SPDX-License-Identifier: Apache-2.0
// Every scene in scenes/ loads, says what its name promises, and survives being written and read again.

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "scenes/memory.h"
#include "scenes/reader.h"
#include "scenes/writer.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

const fs::path kFolder = fs::path(NEPHOS_SOURCE_DIR) / "scenes";

std::vector<fs::path> shipped_scenes() {
    std::vector<fs::path> paths;
    for (const auto& entry : fs::directory_iterator(kFolder)) {
        if (entry.path().extension() == ".toml") paths.push_back(entry.path());
    }
    std::sort(paths.begin(), paths.end());
    return paths;
}

TEST(ShippedScenes, LoadAndKeepTheirMeaning) {
    const std::vector<fs::path> paths = shipped_scenes();
    ASSERT_GE(paths.size(), 4u);
    for (const fs::path& path : paths) {
        SCOPED_TRACE(path.filename().string());
        const Scene scene = read_scene(path);
        EXPECT_EQ(scene.name, path.stem().string());
        EXPECT_NO_THROW(check(scene.automaton));
        const std::string text = to_toml(scene);
        EXPECT_EQ(read_scene_text(text, "again.toml"), scene) << text;
        EXPECT_GT(frame_count(scene), 0);
        EXPECT_FALSE(scene.automaton.field.ellipsoids.empty() && scene.automaton.field.scatters.empty());
        EXPECT_FALSE(scene.automaton.wind.keyframes.empty());
        // Small enough for the machines that the project is for.
        EXPECT_LT(memory_estimate_bytes(scene), std::size_t(6) << 30);
    }
}

TEST(ShippedScenes, BeginWithTheirSchema) {
    for (const fs::path& path : shipped_scenes()) {
        std::ifstream file(path);
        std::string line;
        std::getline(file, line);
        EXPECT_EQ(line, "#:schema ./nephos.schema.json") << path;
    }
}

// The lattices of the examples of Dobashi et al., and their probabilities at the centre of an ellipsoid.
TEST(ShippedScenes, HaveTheNumbersOfTheirSource) {
    const Scene cumulus = read_scene(kFolder / "cumulus.toml");
    EXPECT_EQ(cumulus.automaton.extent, (Extent{256, 128, 20}));
    ASSERT_EQ(cumulus.automaton.field.scatters.size(), 1u);
    EXPECT_EQ(cumulus.automaton.field.scatters[0].centre, (Probabilities{0.1, 0.001, 0.1}));
    EXPECT_TRUE(cumulus.automaton.field.ellipsoids.empty());
    const Scene by_hand = read_scene(kFolder / "cumulus-by-hand.toml");
    EXPECT_EQ(by_hand.automaton.extent, (Extent{256, 128, 20}));
    EXPECT_TRUE(by_hand.automaton.field.scatters.empty());
    EXPECT_GE(by_hand.automaton.field.ellipsoids.size(), 3u);
    EXPECT_EQ(read_scene(kFolder / "stratus.toml").automaton.extent, (Extent{256, 256, 20}));
    EXPECT_EQ(read_scene(kFolder / "large.toml").automaton.extent, (Extent{1024, 1024, 64}));
}

}  // namespace
}  // namespace nephos
