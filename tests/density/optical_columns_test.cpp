// SPDX-License-Identifier: Apache-2.0

#include "density/optical_columns.h"

#include <cmath>

#include <gtest/gtest.h>

namespace nephos {
namespace {

// Half of the columns hold a slab of known depth, a quarter one that is too thin to count.
TEST(OpticalColumns, SlabsHaveTheirCoverAndHeights) {
    const Extent extent{16, 8, 10};
    std::vector<float> values(extent.cells(), 0.0f);
    for (int k = 3; k < 7; ++k)
        for (int j = 0; j < 8; ++j)
            for (int i = 0; i < 12; ++i) values[linear_index(extent, i, j, k)] = i < 8 ? 0.5f : 0.01f;
    const DensityGrid grid = DensityGrid::from_dense(values, extent, {{0, 0, 1000}, 100});
    const OpticalColumns c = optical_columns(grid, 0.05);
    EXPECT_DOUBLE_EQ(c.cover, 0.5);
    EXPECT_DOUBLE_EQ(optical_cover(grid, 0.05), 0.5);
    EXPECT_NEAR(c.median_depth, 0.5 * 0.05 * 400, 1e-6);
    EXPECT_DOUBLE_EQ(c.cloud_base_m, 1300);
    EXPECT_NEAR(c.base_m, 1320, 1e-3);  // 5 % of four levels
    EXPECT_NEAR(c.top_m, 1680, 1e-3);
    EXPECT_NEAR(c.mean_transmittance, 0.5 * std::exp(-10) + 0.25 * std::exp(-0.2) + 0.25, 1e-6);
}

TEST(OpticalColumns, NothingHasNoHeights) {
    const OpticalColumns c = optical_columns(
        DensityGrid::from_dense(std::vector<float>(512, 0.0f), {8, 8, 8}, {{0, 0, 0}, 10}), 1);
    EXPECT_EQ(c.cover, 0);
    EXPECT_TRUE(std::isnan(c.cloud_base_m) && std::isnan(c.base_m));
    EXPECT_EQ(optical_cover(DensityGrid(), 1), 0);
}

}  // namespace
}  // namespace nephos
