// SPDX-License-Identifier: Apache-2.0
// Scenes that repeat: every file of a run goes on across its sides, and scenes that cannot repeat say why.

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "density/vdb/vdb_file.h"
#include "scenes/format/reader.h"
#include "scenes/format/writer.h"
#include "simulation/scene_place.h"
#include "simulation/simulation.h"
#include "simulation/verify.h"
#include "tests/simulation/small_run.h"

namespace nephos {
namespace {

// A lattice of clouds that the wind carries across the sides, one of other cells, and two veils, one with an area.
constexpr const char* kTile = R"(
name = "tile"
seed = 4
tile = true
[lattice]
origin_m = [0, 0, 1000]
[time]
steps = 24
[frames]
start_s = 205
time_scale = 240
count = 2
[density]
refine = 2
[[wind]]
levels = [{ height_m = 0, east_m_per_s = 11, north_m_per_s = -6 }, { height_m = 9000, east_m_per_s = 30, north_m_per_s = 12 }]
[[model]]
name = "puff"
seeds = [{ size_m = [500, 500, 300] }]
[[sky]]
name = "few"
state = 0
clouds = 9
models = "puff"
[[layer]]
name = "low"
skies = "few"
base_height_m = 1200
lattice = { cells = [48, 40, 12], cell_size_m = 50 }
coupling = { centre = { hum = 0.2, act = 0.02, ext = 0.05 } }
[[layer]]
name = "middle"
skies = "few"
base_height_m = 2200
lattice = { cells = [24, 20, 6], cell_size_m = 100, origin_m = [0, 0, 2000] }
coupling = { centre = { hum = 0.2, act = 0.02, ext = 0.05 } }
[[layer]]
name = "high"
opacity = 0.3
lattice = { cells = [24, 20, 8], cell_size_m = 100, origin_m = [0, 0, 4000] }
[layer.veil]
form = "cirrus"
octaves = 2
wavelength_m = 700
stretch = 1.5
margin_m = 400
[[layer]]
name = "patch"
opacity = 0.5
lattice = { cells = [24, 20, 8], cell_size_m = 100, origin_m = [0, 0, 5000] }
[layer.veil]
form = "stratus"
octaves = 2
wavelength_m = 600
coverage = 0.9
area = { x_m = 100, y_m = 1900, semi_a_m = 900, semi_b_m = 700, softness = 1 }
)";

class TileRun : public test::SmallRun {};

TEST_F(TileRun, EveryFileGoesOnAcrossItsSides) {
    const Scene scene = read_scene_text(kTile, "tile.toml", ".", {});
    EXPECT_EQ(scene, read_scene_text(to_toml(scene), "tile.toml", ".", {}));
    EXPECT_EQ(period_m(scene, std::nullopt), Vec3(2400, 2000, 0));
    RunSettings settings = settings_of(scene, "out");
    settings.render = false;
    ASSERT_TRUE(run_scene(settings, {}).complete);
    int files = 0;
    for (const char* const file :
         {"density/tile_0002.vdb", "density/low/tile_0002.vdb", "density/middle/tile_0002.vdb",
          "density/high/tile_0002.vdb", "density/patch/tile_0002.vdb"}) {
        const DensityGrid grid = read_density(settings.folder / file);
        const Extent e = grid.extent();
        EXPECT_GT(grid.max_value(), 0.05f) << file;
        const std::vector<float> density = grid.to_dense();
        double at_sides = 0;
        for (int k = 0; k < e.z; ++k)
            for (int j = 0; j < e.y; ++j) at_sides += double(density[linear_index(e, 0, j, k)]);
        EXPECT_GT(at_sides, 0) << file;  // there is something to cut
        for (int axis = 0; axis < 2; ++axis) {
            const Seam seam = seam_of(plane_steps(density, e.x, e.y, e.z, axis));
            EXPECT_FALSE(seam.shows()) << file << " " << axis << ": " << seam.at_seam << " " << seam.limit;
        }
        ++files;
    }
    EXPECT_EQ(files, 5);
}

// Without `tile` the same layers end at their sides, so that the check above can fail.
TEST_F(TileRun, WithoutTheKeyTheSeamShows) {
    std::string text = kTile;
    text.replace(text.find("tile = true"), 11, "");
    RunSettings settings = settings_of(read_scene_text(text, "tile.toml", ".", {}), "out");
    settings.render = false;
    ASSERT_TRUE(run_scene(settings, {}).complete);
    const DensityGrid grid = read_density(settings.folder / "density/patch/tile_0002.vdb");
    const Extent e = grid.extent();
    const Seam seam = seam_of(plane_steps(grid.to_dense(), e.x, e.y, e.z, 1));
    EXPECT_TRUE(seam.shows()) << seam.at_seam << " " << seam.limit;
}

// A box of clouds that repeats, x fastest: balls at places of the seed, which go on across the sides.
std::vector<float> repeating_clouds(int n, int nz, unsigned seed, int balls = 150) {
    std::vector<float> density(std::size_t(n) * std::size_t(n) * std::size_t(nz));
    std::mt19937 random(seed);
    for (int ball = 0; ball < balls; ++ball) {
        const int x = int(random() % unsigned(n)), y = int(random() % unsigned(n)), z = int(random() % unsigned(nz));
        const int radius = 2 + int(random() % 5);
        for (int k = std::max(0, z - radius); k < std::min(nz, z + radius); ++k)
            for (int j = -radius; j <= radius; ++j)
                for (int i = -radius; i <= radius; ++i) {
                    const double away = std::sqrt(double(i * i + j * j + (k - z) * (k - z))) / radius;
                    float& value = density[(std::size_t(k) * std::size_t(n) + std::size_t((y + j + n) % n)) * std::size_t(n) +
                                           std::size_t((x + i + n) % n)];
                    value = std::max(value, float(std::clamp(1.5 * (1 - away), 0.0, 0.7)));
                }
    }
    return density;
}

// Turns the box by `by` voxels along x, its clouds going in again on the other side.
std::vector<float> rolled(const std::vector<float>& density, int n, int by) {
    std::vector<float> result(density.size());
    for (std::size_t at = 0; at < density.size(); ++at) {
        const std::size_t x = at % std::size_t(n);
        result[at - x + (x + std::size_t(by)) % std::size_t(n)] = density[at];
    }
    return result;
}

// By hand, of a row 0 1 2 3 13 14: across its middle 10, of which 1.5 times 1 go on; across its seam 14, and 1.5 there, too.
TEST(Seam, WhatGoesOnIsNoBreak) {
    const std::vector<float> row{0, 1, 2, 3, 13, 14};
    for (int axis = 0; axis < 3; ++axis) {
        const PlaneSteps planes =
            plane_steps(row, axis == 0 ? 6 : 1, axis == 1 ? 6 : 1, axis == 2 ? 6 : 1, axis);
        EXPECT_EQ(planes.steps, (std::vector<double>{1, 1, 1, 10, 1, 14}));
        EXPECT_EQ(planes.breaks, (std::vector<double>{0, 0, 0, 8.5, 0, 12.5}));
        const Seam seam = seam_of(planes);
        EXPECT_EQ(seam.at_seam, 12.5);
        EXPECT_EQ(seam.inside, 8.5);
        EXPECT_EQ(seam.limit, 1.5 * 8.5);
    }
}

// Checks that one more break is no seam where every other step is a break, and that a larger one is.
TEST(Seam, BreaksEverywhereHideNoLargerOne) {
    EXPECT_FALSE(seam_of(plane_steps({0, 0, 2, 2, 0, 0, 2, 2}, 8, 1, 1, 0)).shows());
    const Seam seam = seam_of(plane_steps({0, 0, 2, 2, 4, 4, 6, 6}, 8, 1, 1, 0));
    EXPECT_EQ(seam.at_seam, 6);
    EXPECT_EQ(seam.limit, 3);
}

// Checks that no seam shows in a box of one to three planes, whatever is in it: nothing can be said of so few.
TEST(Seam, ThreePlanesHaveNone) {
    for (const std::vector<float>& row :
         {std::vector<float>{0.5f}, {0, 1}, {0.5f, 0.25f}, {0, 0.5f, 1}, {0, 0, 1}})
        EXPECT_FALSE(seam_of(plane_steps(row, int(row.size()), 1, 1, 0)).shows());
}

// Clouds that have just formed are a cell or two, smoothed: the seam may go through the only one.
TEST(Seam, SpecksOverItAreNone) {
    constexpr int kSide = 32, kHeight = 4;
    constexpr std::array<float, 5> kTent{1 / 9.0f, 2 / 9.0f, 3 / 9.0f, 2 / 9.0f, 1 / 9.0f};
    for (unsigned seed = 1; seed <= 12; ++seed) {
        std::mt19937 random(seed);
        std::vector<float> density(std::size_t(kSide) * kSide * kHeight);
        for (unsigned cell = 0; cell < 1 + seed / 2; ++cell) {
            const unsigned x = random() % kSide, y = random() % kSide, z = random() % kHeight;
            for (unsigned j = 0; j < 5; ++j)
                for (unsigned i = 0; i < 5; ++i)
                    density[(z * kSide + (y + j) % kSide) * kSide + (x + i) % kSide] += kTent[i] * kTent[j];
        }
        for (int by = 0; by < kSide; ++by)
            for (int axis = 0; axis < 2; ++axis) {
                const Seam seam =
                    seam_of(plane_steps(rolled(density, kSide, by), kSide, kSide, kHeight, axis));
                EXPECT_FALSE(seam.shows())
                    << seed << " " << by << ": " << seam.at_seam << " above " << seam.limit;
            }
    }
}

// Wherever a box that repeats is cut, its seam is one place of many alike: now and then that with the largest break of all, and
// no seam.
TEST(Seam, BreaksThatAreLargestByChanceAreNone) {
    constexpr int kSide = 64, kHeight = 12;
    int largest = 0;
    for (unsigned seed = 1; seed <= 6; ++seed) {
        const std::vector<float> density = repeating_clouds(kSide, kHeight, seed);
        for (int by = 0; by < kSide; ++by) {
            const Seam seam = seam_of(plane_steps(rolled(density, kSide, by), kSide, kSide, kHeight, 0));
            EXPECT_FALSE(seam.shows()) << seed << " " << by << ": " << seam.at_seam << " above " << seam.limit;
            largest += seam.at_seam > seam.inside;
        }
    }
    EXPECT_EQ(largest, 6);  // once a box: as often its largest break would be called a seam
}

// Few clouds make planes that are not alike: there are breaks where a cloud lies over the seam, and none of them is a cut.
TEST(Seam, FewCloudsOverItAreNone) {
    constexpr int kSide = 64, kHeight = 12;
    int largest = 0;
    for (unsigned seed = 1; seed <= 12; ++seed) {
        const std::vector<float> density = repeating_clouds(kSide, kHeight, seed, 1 + int(seed) / 2);
        for (int by = 0; by < kSide; ++by) {
            const Seam seam = seam_of(plane_steps(rolled(density, kSide, by), kSide, kSide, kHeight, 0));
            EXPECT_FALSE(seam.shows())
                << seed << " " << by << ": " << seam.at_seam << " above " << seam.limit;
            largest += seam.at_seam > seam.inside;
        }
    }
    EXPECT_GT(largest, 0);  // it happened
}

// The same box without its last voxels repeats no longer.
TEST(Seam, ACutShowsWhereverItIs) {
    constexpr int kSide = 64, kHeight = 12, kLeft = 52;
    for (unsigned seed = 1; seed <= 6; ++seed) {
        const std::vector<float> density = repeating_clouds(kSide, kHeight, seed);
        for (int by = 0; by < kSide; by += 5) {
            const std::vector<float> turned = rolled(density, kSide, by);
            std::vector<float> cut;
            for (std::size_t at = 0; at < turned.size(); ++at)
                if (int(at % kSide) < kLeft) cut.push_back(turned[at]);
            const Seam seam = seam_of(plane_steps(cut, kLeft, kSide, kHeight, 0));
            EXPECT_TRUE(seam.shows()) << seed << " " << by << ": " << seam.at_seam << " of " << seam.limit;
        }
    }
}

std::string problem_of(std::string text, const std::string& from, const std::string& to) {
    text.replace(text.find(from), from.size(), to);
    try {
        read_scene_text(text, "tile.toml", ".", {});
    } catch (const std::exception& error) {
        return error.what();
    }
    return "none";
}

TEST(Tile, ScenesThatCannotRepeatAreRefused) {
    EXPECT_NE(problem_of(kTile, "cells = [24, 20, 6]", "cells = [24, 21, 6]").find("share one period"),
              std::string::npos);
    EXPECT_NE(
        problem_of(kTile, "origin_m = [0, 0, 4000]", "origin_m = [50, 0, 4000]").find("50 to 2450 m along x"),
        std::string::npos);
    EXPECT_NE(problem_of(kTile, "cell_size_m = 50 }", "cell_size_m = 50, boundaries = \"open\" }")
                  .find("open in a tile"),
              std::string::npos);
    EXPECT_NE(problem_of(kTile, "base_height_m = 2200", "base_height_m = 2200\nautomaton = false")
                  .find("has no density"),
              std::string::npos);
    EXPECT_NE(problem_of(kTile, "wavelength_m = 700", "wavelength_m = 6000").find("does not fit into a tile"),
              std::string::npos);
    EXPECT_NE(problem_of("name = \"x\"\ntile = true\n[lattice]\nboundaries = \"open\"\n", "\"x\"", "\"y\"")
                  .find("open in a tile"),
              std::string::npos);
}

}  // namespace
}  // namespace nephos
