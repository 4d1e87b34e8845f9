// SPDX-License-Identifier: Apache-2.0

// The lowest cloud of each column, as rain falls from it.

#include "density/cloud_bases.h"

#include <cmath>
#include <numbers>
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

// Two discs at different heights beside each other, and a gap: within a texel of the true underside.
TEST(CloudBases, OfPiecesAreTheirUndersides) {
    const std::vector<CloudPiece> pieces{{{0, 0, 1000}, 800, 400, 1}, {{2000, 0, 1600}, 800, 600, 0.5}};
    const CloudBases bases = cloud_bases(pieces, {-1000, -1000}, {3000, 1000});
    EXPECT_LE(bases.columns, CloudBases::kMostTexels);
    EXPECT_NEAR(bases.at(0, 0).base_m, 800, 1);
    EXPECT_NEAR(bases.at(0, 0).water, 1, 1e-2);
    EXPECT_NEAR(bases.at(2000, 0).base_m, 1300, 1);
    EXPECT_NEAR(bases.at(2000, 0).water, 0.5, 1e-2);
    EXPECT_NEAR(bases.at(200, 0).base_m, 1000 - 200 * std::sqrt(0.75), 3);
    EXPECT_NEAR(bases.at(200, 0).water, 0.75, 1e-2);
    for (const double x_m : {-900.0, 450.0, 1000.0, 1550.0, 2950.0, 5000.0}) EXPECT_EQ(bases.at(x_m, 0).water, 0) << x_m;
    EXPECT_EQ(bases.at(0, 450).water, 0);
}

// Pieces that cover others add their opacity; the lower one is the base, unless it is hardly there.
TEST(CloudBases, OfPiecesAreThoseOfTheLowest) {
    const CloudPiece high{{0, 0, 1500}, 800, 400, 0.5}, low{{0, 0, 900}, 800, 200, 0.5}, shred{{0, 0, 300}, 800, 100, 0.05};
    const auto column = [](const std::vector<CloudPiece>& pieces) {
        return cloud_bases(pieces, {-500, -500}, {500, 500}).at(0, 0);
    };
    EXPECT_NEAR(column({high, low}).base_m, 800, 1);
    EXPECT_NEAR(column({low, high}).water, 0.75, 1e-2);
    EXPECT_NEAR(column({high, shred}).base_m, 1300, 1);
    EXPECT_NEAR(column({shred}).base_m, 250, 1);
}

// However many small pieces there are in a texel, they cover what they cover.
TEST(CloudBases, OfPiecesSmallerThanATexelKeepTheirWater) {
    std::vector<CloudPiece> pieces;
    for (int n = 0; n < 100; ++n) pieces.push_back({{150.0 * n, 70.0 * (n % 7), 1000}, 40, 30, 0.5});
    const CloudBases bases = cloud_bases(pieces, {-5000, -10'000}, {25'000, 10'000});
    ASSERT_GT(bases.texel_m, 100);
    double sum = 0;
    for (const float water : bases.water) sum += double(water) * bases.texel_m * bases.texel_m;
    const double each = 0.5 * 0.5 * std::numbers::pi * 20 * 20;  // the mean of 1 - r^2 is a half
    EXPECT_NEAR(sum, 100 * each, 0.15 * 100 * each);
}

TEST(CloudBases, OfNothingAreDry) {
    EXPECT_EQ(cloud_bases(DensityGrid(), 0.05).columns, 0);
    EXPECT_EQ(cloud_bases(grid_of(std::vector<float>(kExtent.cells(), 0.0f)), 0.05).at(1250, -350).water, 0);
    EXPECT_EQ(CloudBases().at(0, 0).water, 0);
    EXPECT_EQ(cloud_bases({}, {0, 0}, {1000, 1000}).at(500, 500).water, 0);
}

}  // namespace
}  // namespace nephos
