// SPDX-License-Identifier: Apache-2.0
// Density files of lattices with periodic sides: finer voxels and the grid of all layers go on across them.

#include <string>

#include <gtest/gtest.h>

#include "density/vdb/vdb_file.h"
#include "scenes/format/reader.h"
#include "tests/simulation/small_run.h"

namespace nephos {
namespace {

// In which every cell is cloud after a few steps.
constexpr const char* kOvercast = R"(
name = "overcast"
[lattice]
cells = [8, 8, 8]
boundaries = "periodic"
[time]
steps = 6
[frames]
start_s = 60
count = 1
[field.background]
hum = 1
act = 1
ext = 0
)";

// The upper layer has voxels of twice the size, which the common grid interpolates.
constexpr const char* kLayers = R"(
[[model]]
name = "puff"
seeds = [{ size_m = [100, 100, 100] }]
[[sky]]
name = "few"
state = 0
clouds = 2
models = "puff"
[[layer]]
name = "low"
skies = "few"
base_height_m = [1100, 1200]
lattice = { cells = [16, 16, 8], cell_size_m = 50, origin_m = [0, 0, 1000] }
[[layer]]
name = "high"
skies = "few"
base_height_m = [2100, 2200]
lattice = { cells = [8, 8, 4], cell_size_m = 100, origin_m = [0, 0, 2000] }
)";

class PeriodicGrids : public test::SmallRun {
  protected:
    // The grid of the run's only frame.
    DensityGrid written(const std::string& text, int refine) const {
        Scene scene = read_scene_text(text, "overcast.toml", ".", {});
        scene.density.refine = refine;
        scene.density.detail.enabled = false;
        RunSettings settings = settings_of(scene, "out" + std::to_string(refine));
        settings.render = false;
        EXPECT_TRUE(run_scene(settings, {}).complete);
        return read_density(settings.folder / "density/overcast_0001.vdb");
    }
};

TEST_F(PeriodicGrids, AreSaturatedUpToTheirSides) {
    for (const int refine : {1, 2, 3}) {
        const DensityGrid grid = written(kOvercast, refine);
        ASSERT_EQ(grid.extent().x, 8 * refine);
        for (const float value : grid.to_dense()) ASSERT_EQ(value, 1.0f) << refine;
    }
}

TEST_F(PeriodicGrids, OfLayersAreSaturatedUpToTheSidesOfEach) {
    for (const int refine : {1, 2}) {
        const DensityGrid grid = written(std::string(kOvercast).append(kLayers), refine);
        ASSERT_EQ(grid.extent(), (Extent{16 * refine, 16 * refine, 28 * refine}));
        for (int k = 0; k < grid.extent().z; ++k) {
            const int cell = k / refine;
            const float expected = cell < 8 || cell >= 20 ? 1.0f : 0.0f;
            for (int j = 0; j < grid.extent().y; ++j) {
                for (int i = 0; i < grid.extent().x; ++i)
                    ASSERT_EQ(grid.value(i, j, k), expected) << refine << ": " << i << " " << j << " " << k;
            }
        }
    }
}

}  // namespace
}  // namespace nephos
