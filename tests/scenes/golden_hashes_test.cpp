// SPDX-License-Identifier: Apache-2.0

// Every shipped scene is stepped, and its states have the hashes of tests/golden/state_hashes.txt, whatever
// the number of threads. To change one of them is a decision about the random stream or about the scene
// (docs/adr/0002); the lines are what `nephos hash SCENE --steps N` prints, preceded by the scene.

#include <fstream>
#include <map>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include "automaton/automaton.h"
#include "scenes/format/reader.h"
#include "tests/reference/with_threads.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

const fs::path kSource = NEPHOS_SOURCE_DIR;

std::map<std::string, std::map<std::uint64_t, std::string>> golden_hashes() {
    std::ifstream in(kSource / "tests/golden/state_hashes.txt");
    std::map<std::string, std::map<std::uint64_t, std::string>> hashes;
    std::string scene, hash;
    for (std::uint64_t step = 0; in >> scene >> step >> hash;) hashes[scene][step] = hash;
    return hashes;
}

TEST(GoldenHashes, CoverEveryShippedScene) {
    std::set<std::string> shipped, covered;
    for (const auto& entry : fs::directory_iterator(kSource / "scenes")) {
        if (entry.path().extension() != ".toml") continue;
        // Scenes with layers are stepped by tests/simulation/climate_test.cpp.
        if (read_scene(entry.path()).layers.empty()) shipped.insert(entry.path().filename());
    }
    for (const auto& [scene, steps] : golden_hashes()) covered.insert(scene);
    EXPECT_EQ(covered, shipped);
    EXPECT_GE(shipped.size(), 4u);
}

TEST(GoldenHashes, AreReachedWithAnyNumberOfThreads) {
    for (const auto& [name, hashes] : golden_hashes()) {
        const Scene scene = read_scene(kSource / "scenes" / name);
        for (std::size_t threads : {1, 2, 3, 8}) {
            test::with_threads(threads, [&, &name = name, &hashes = hashes] {
                Automaton automaton(scene.automaton);
                for (const auto& [step, hash] : hashes) {
                    while (automaton.steps() < step) automaton.step();
                    EXPECT_EQ(automaton.hash().hex(), hash)
                        << name << ", step " << step << ", " << threads << " threads";
                }
            });
        }
    }
}

}  // namespace
}  // namespace nephos
