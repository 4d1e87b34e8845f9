// SPDX-License-Identifier: Apache-2.0
// Periodic density knows no first cell: rolling the automaton's bits by n cells rolls all that is made of them, smoothed,
// refined, refined with detail, and the common grid of lattices of different voxels.

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "density/combine.h"
#include "density/detail.h"
#include "density/metaballs.h"
#include "density/smoothing.h"

namespace nephos {
namespace {

constexpr Extent kCells{40, 24, 12};
constexpr int kEast = 13, kNorth = -7;
constexpr Boundaries kPeriodic{Boundary::periodic, Boundary::periodic, Boundary::open};
const Placement kPlacement{{-1000, 300, 900}, 40};

int rolled_index(int i, int by, int n) { return ((i - by) % n + n) % n; }

// Clumps of cloud cells, also across the sides; rolled by whole cells.
BitPlane clumps(int east, int north) {
    BitPlane plane(kCells);
    std::mt19937 random(5);
    for (int n = 0; n < 40; ++n) {
        const int x = int(random() % 40), y = int(random() % 24), z = 1 + int(random() % 10);
        for (int cell = 0; cell < 60; ++cell) {
            const int i = x + int(random() % 7) + east, j = y + int(random() % 5) + north;
            plane.set(rolled_index(i, 0, kCells.x), rolled_index(j, 0, kCells.y), std::min(11, z + int(random() % 3)), true);
        }
    }
    return plane;
}

DensityGrid smoothed(int east, int north) {
    const BitPlane plane = clumps(east, north);
    const std::vector<TimedPlane> planes{{plane.view(), 0}};
    return smooth(planes, SmoothingOptions{}, kPlacement, kPeriodic);
}

// The largest difference between a grid rolled by voxels and another.
double apart(const DensityGrid& grid, const DensityGrid& other, int east, int north) {
    const Extent e = grid.extent();
    EXPECT_EQ(e, other.extent());
    const std::vector<float> from = grid.to_dense(), to = other.to_dense();
    double worst = 0;
    for (int k = 0; k < e.z; ++k)
        for (int j = 0; j < e.y; ++j)
            for (int i = 0; i < e.x; ++i)
                worst = std::max(worst, std::abs(double(to[linear_index(e, i, j, k)]) -
                                                 double(from[linear_index(e, rolled_index(i, east, e.x),
                                                                          rolled_index(j, north, e.y), k)])));
    return worst;
}

TEST(Tile, SmoothedBitsRoll) {
    const DensityGrid home = smoothed(0, 0);
    EXPECT_GT(home.max_value(), 0.3f);
    EXPECT_EQ(apart(home, smoothed(kEast, kNorth), kEast, kNorth), 0);
    EXPECT_GT(apart(home, smoothed(kEast, kNorth), kEast + 1, kNorth), 0.1);
}

TEST(Tile, RefinedGridsRoll) {
    const DensityGrid home = smoothed(0, 0), rolled = smoothed(kEast, kNorth);
    for (const int refine : {2, 3}) {
        EXPECT_LT(apart(resample(home, refine, 2, kPeriodic), resample(rolled, refine, 2, kPeriodic), refine * kEast,
                        refine * kNorth),
                  1e-6);
    }
}

// The noise rolls with the air that it is fixed in. Nodes hold 8 bits, so places of other rounding differ a little.
TEST(Tile, DetailRollsWithTheAir) {
    const auto detailed = [](const DensityGrid& grid, int east, int north) {
        DetailSetting setting;
        setting.extinction_per_m = 0.15;
        setting.metaball_radius_cells = 1.5;
        setting.boundaries = kPeriodic;
        setting.drift_m = {east * 40.0, north * 40.0, 0};
        const CoverageField field(grid, setting);
        return resample_with_detail(field, grid.extent(), grid.placement(), 2);
    };
    const DensityGrid home = detailed(smoothed(0, 0), 0, 0), rolled = detailed(smoothed(kEast, kNorth), kEast, kNorth);
    EXPECT_GT(home.max_value(), 0.3f);
    EXPECT_LT(apart(home, rolled, 2 * kEast, 2 * kNorth), 0.01);
}

// A coarse grid above the fine one: twice the voxel, so it rolls by an even number of the fine one's.
TEST(Tile, TheCommonGridRolls) {
    const auto common = [](int east, int north) {
        std::vector<float> coarse(20 * 12 * 4);
        for (int k = 0; k < 4; ++k)
            for (int j = 0; j < 12; ++j)
                for (int i = 0; i < 20; ++i)
                    coarse[linear_index({20, 12, 4}, rolled_index(i, -east, 20), rolled_index(j, -north, 12), k)] =
                        float((i * 7 + j * 5 + k * 3) % 11) / 11;
        const std::vector<DensityGrid> grids{
            smoothed(2 * east, 2 * north),
            DensityGrid::from_dense(coarse, {20, 12, 4}, {{-1000, 300, 2000}, 80})};
        const std::vector<Boundaries> boundaries{kPeriodic, kPeriodic};
        return combine(grids, boundaries);
    };
    const DensityGrid home = common(0, 0);
    EXPECT_EQ(home.extent(), (Extent{40, 24, 36}));
    EXPECT_LT(apart(home, common(3, -4), 6, -8), 1e-6);
}

}  // namespace
}  // namespace nephos
