// SPDX-License-Identifier: Apache-2.0

// The lowest cloud of each column, as rain falls from it.

#include "density/cloud_bases.h"

#include <cmath>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace nephos {
namespace {

constexpr Extent kExtent{6, 4, 10};
const Placement kPlacement{{1000, -500, 700}, 100};

DensityGrid grid_of(const std::vector<float>& values) {
    return DensityGrid::from_dense(values, kExtent, kPlacement);
}

std::size_t at(int i, int j, int k) { return std::size_t((k * kExtent.y + j) * kExtent.x + i); }

TEST(CloudBases, AreTheLowestLevelsOfTheColumns) {
    std::vector<float> values(kExtent.cells(), 0.0f);
    for (int k = 3; k < 8; ++k) values[at(2, 1, k)] = 0.8f;
    values[at(2, 1, 1)] = 0.05f;  // haze below the cloud, less than a tenth of it
    for (int k = 6; k < 7; ++k) values[at(4, 2, k)] = 0.2f;
    const CloudBases bases = cloud_bases(grid_of(values), 0.02);
    EXPECT_EQ(bases.columns, 6);
    EXPECT_EQ(bases.rows, 4);
    const CloudBases::Column thick = bases.at(1250, -350), thin = bases.at(1450, -250),
                             none = bases.at(1050, -450);
    EXPECT_NEAR(thick.base_m, 1050, 0.01);  // the middle of level 3
    EXPECT_NEAR(thick.water, 1 - std::exp(-(5 * 0.8 + 0.05) * 2 / 10), 1e-5);
    EXPECT_NEAR(thin.base_m, 1350, 0.01);
    EXPECT_NEAR(thin.water, 1 - std::exp(-0.2 * 2 / 10), 1e-5);
    EXPECT_EQ(none.water, 0);
    EXPECT_EQ(bases.at(0, 0).water, 0) << "beyond the grid";
    // Between cloud and none the base is that of the cloud, with less water.
    const CloudBases::Column edge = bases.at(1300, -350);
    EXPECT_NEAR(edge.base_m, thick.base_m, 0.01);
    EXPECT_NEAR(edge.water, 0.5 * thick.water, 1e-5);
}

TEST(CloudBases, OfLargeGridsHaveFewerTexels) {
    const Extent wide{400, 30, 4};
    std::vector<float> values(wide.cells(), 0.0f);
    for (int j = 0; j < wide.y; ++j)
        for (int i = 0; i < wide.x; ++i) values[std::size_t((2 * wide.y + j) * wide.x + i)] = 1.0f;
    const CloudBases bases = cloud_bases(DensityGrid::from_dense(values, wide, kPlacement), 0.05);
    EXPECT_LE(bases.columns, CloudBases::kMostTexels);
    EXPECT_NEAR(bases.texel_m, 300, 1e-9);
    const CloudBases::Column middle = bases.at(1000 + 15'000, -500 + 1500);
    EXPECT_NEAR(middle.base_m, 950, 0.05);
    EXPECT_NEAR(middle.water, 1 - std::exp(-0.5), 1e-4);
}

// Beyond a periodic side the cloud at the opposite one begins; texels fit the period.
TEST(CloudBases, RepeatWithTheirGrid) {
    std::vector<float> values(kExtent.cells(), 0.0f);
    for (int k = 3; k < 8; ++k) values[at(0, 3, k)] = 0.8f;
    const CloudBases open = cloud_bases(grid_of(values), 0.02),
                     bases = cloud_bases(grid_of(values), 0.02,
                                         {Boundary::periodic, Boundary::periodic, Boundary::open});
    const CloudBases::Column in = bases.at(1050, -150);
    EXPECT_GT(in.water, 0.3);
    for (const auto& [x, y] :
         {std::pair{1050 + 600, -150}, {1050 - 1800, -150}, {1050, -150 - 400}, {1050 + 1200, -150 + 800}}) {
        EXPECT_NEAR(bases.at(x, y).water, in.water, 1e-9) << x << " " << y;
        EXPECT_NEAR(bases.at(x, y).base_m, in.base_m, 1e-6);
        EXPECT_EQ(open.at(x, y).water, 0);
    }
    EXPECT_NEAR(bases.at(1000, -150).water, 0.5 * in.water, 1e-9) << "on the seam";
    const Extent wide{400, 30, 1};
    const CloudBases coarse =
        cloud_bases(DensityGrid::from_dense(std::vector<float>(wide.cells(), 1.0f), wide, kPlacement), 0.05,
                    {Boundary::periodic, Boundary::periodic, Boundary::open});
    EXPECT_NEAR(coarse.texel_m, 500, 1e-9);  // the least number of columns from 3 on that divides 400 and 30
    EXPECT_EQ(coarse.columns * 5, wide.x);
}

// No number of whole columns divides a prime side.
TEST(CloudBases, OfPrimeSidesKeepToTheirTexelsAndTheirWater) {
    constexpr Boundaries kPeriodic{Boundary::periodic, Boundary::periodic, Boundary::open};
    const Extent prime{197, 197, 2};
    std::vector<float> values(prime.cells(), 0.0f);
    for (int j = 60; j < 140; ++j)
        for (int i = 0; i < 50; ++i) values[std::size_t((1 * prime.y + j) * prime.x + i)] = 0.8f;
    const CloudBases bases = cloud_bases(DensityGrid::from_dense(values, prime, kPlacement), 0.02, kPeriodic);
    EXPECT_LE(bases.columns, CloudBases::kMostTexels);
    EXPECT_EQ(bases.columns, bases.rows);
    EXPECT_NEAR(bases.columns * bases.texel_m, 19'700, 1e-6);  // the period
    const double water = 1 - std::exp(-0.8 * 2 / 10);
    double sum = 0;
    for (const float each : bases.water) sum += double(each);
    EXPECT_NEAR(sum * bases.texel_m * bases.texel_m, water * 5000 * 8000, 1e-4 * water * 5000 * 8000);
    for (const double more : {0.0, 19'700.0, -39'400.0}) {
        const CloudBases::Column in = bases.at(1000 + 2500 + more, -500 + 10'000 - more);
        EXPECT_NEAR(in.water, water, 1e-5);
        EXPECT_NEAR(in.base_m, 850, 1e-2);
        EXPECT_EQ(bases.at(1000 + 9000 + more, -500 + 10'000).water, 0);
    }
    const Extent wide{400, 197, 1};  // nothing in common
    const CloudBases all =
        cloud_bases(DensityGrid::from_dense(std::vector<float>(wide.cells(), 1.0f), wide, kPlacement), 0.05, kPeriodic);
    EXPECT_EQ(all.columns, 400);
    EXPECT_EQ(all.rows, 197);
    const CloudBases row = cloud_bases(DensityGrid::from_dense(std::vector<float>(wide.cells(), 1.0f), wide, kPlacement), 0.05,
                                       {Boundary::open, Boundary::periodic, Boundary::open});
    EXPECT_LE(row.columns, CloudBases::kMostTexels);
    EXPECT_NEAR(row.rows * row.texel_m, 19'700, 1e-6);
}

TEST(CloudBases, OfNothingAreDry) {
    EXPECT_EQ(cloud_bases(DensityGrid(), 0.05).columns, 0);
    EXPECT_EQ(cloud_bases(grid_of(std::vector<float>(kExtent.cells(), 0.0f)), 0.05).at(1250, -350).water, 0);
    EXPECT_EQ(CloudBases().at(0, 0).water, 0);
}

}  // namespace
}  // namespace nephos
