// SPDX-License-Identifier: Apache-2.0
// Grids of several layers as one: bit by bit where voxels agree, linear between voxels where they do not.

#include "density/combine.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "core/error.h"

namespace nephos {
namespace {

DensityGrid random_grid(Extent extent, const Placement& placement, unsigned seed, double filled) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> value(0.0f, 0.9f);
    std::vector<float> values(extent.cells(), 0.0f);
    for (float& v : values) {
        const float drawn = value(random);
        if (value(random) < 0.9 * filled) v = drawn;
    }
    return DensityGrid::from_dense(values, extent, placement);
}

TEST(CommonBox, HasTheSmallestVoxelsAndHoldsAll) {
    const GridBox low{{10, 12, 8}, {{0, 0, 1000}, 100}};
    const GridBox high{{30, 20, 5}, {{-75, 20, 4010}, 50}};
    const std::vector<GridBox> both{low, high};
    const GridBox box = common_box(both);
    EXPECT_EQ(box.placement.cell_size_m, 50);
    // In voxels of 50 m from (-75, 20, 4010): x 0..30 and 1.5..21.5, y 0..20 and -0.4..23.6, z 0..5 and
    // -60.2..-44.2.
    EXPECT_EQ(box.placement.origin_m, (Vec3{-75, -30, 960}));
    EXPECT_EQ(box.extent, (Extent{30, 25, 66}));
    const std::vector<GridBox> one{low};
    EXPECT_EQ(common_box(one), low);
    EXPECT_THROW(common_box({}), Error);
    const std::vector<GridBox> far{low, {{1, 1, 1}, {{1e7, 0, 0}, 1e-3}}};
    EXPECT_THROW(common_box(far), Error);
}

// Decimal fractions that are no binary ones must not shift the box by a voxel.
TEST(CommonBox, TakesRoundingForWhatItIs) {
    const std::vector<GridBox> boxes{{{30, 30, 30}, {{0.1, 0.2, 0.3}, 0.1}},
                                     {{3, 3, 3}, {{0.7, 0.5, 0.9}, 0.1}}};
    EXPECT_EQ(common_box(boxes).extent, (Extent{30, 30, 30}));
    EXPECT_EQ(common_box(boxes).placement, boxes[0].placement);
}

TEST(Combine, CopiesGridsOfTheSameVoxelsBitByBit) {
    const DensityGrid a = random_grid({37, 21, 13}, {{0, 0, 1000}, 50}, 1, 0.4);
    const DensityGrid b = random_grid({20, 20, 20}, {{500, -200, 2000}, 50}, 2, 0.4);
    const std::vector<DensityGrid> grids{a, b};
    const DensityGrid both = combine(grids);
    EXPECT_EQ(both.placement(), (Placement{{0, -200, 1000}, 50}));
    EXPECT_EQ(both.extent(), (Extent{37, 25, 40}));
    const Extent e = both.extent();
    const std::vector<float> dense = both.to_dense();
    for (int k = 0; k < e.z; ++k) {
        for (int j = 0; j < e.y; ++j) {
            for (int i = 0; i < e.x; ++i) {
                const float expected = a.value(i, j - 4, k) + b.value(i - 10, j, k - 20);
                ASSERT_EQ(dense[linear_index(e, i, j, k)], expected) << i << " " << j << " " << k;
            }
        }
    }
    EXPECT_EQ(both.active_voxels(), a.active_voxels() + b.active_voxels());
}

TEST(Combine, AddsUpToOneWhereGridsOverlap) {
    const std::vector<float> values{0.25f, 0.75f};
    const DensityGrid a = DensityGrid::from_dense(values, {2, 1, 1}, {{0, 0, 0}, 10});
    const std::vector<DensityGrid> grids{a, a};
    EXPECT_EQ(combine(grids).to_dense(), (std::vector<float>{0.5f, 1.0f}));
    const std::vector<DensityGrid> one{a};
    EXPECT_EQ(combine(one).to_dense(), values);
}

// A coarse grid against the formula of linear interpolation, voxel by voxel.
TEST(Combine, InterpolatesCoarserGrids) {
    const DensityGrid fine = random_grid({40, 30, 10}, {{0, 0, 0}, 20}, 3, 0.2);
    const DensityGrid coarse = random_grid({9, 8, 7}, {{35, -60, 150}, 70}, 4, 0.6);
    const std::vector<DensityGrid> grids{fine, coarse};
    const DensityGrid both = combine(grids);
    const Extent e = both.extent();
    const Vec3 origin = both.placement().origin_m;
    const std::vector<float> dense = both.to_dense();
    const auto offset_of_fine = [](double m) { return int(std::lround(m / 20)); };
    double largest = 0;
    for (int k = 0; k < e.z; ++k) {
        for (int j = 0; j < e.y; ++j) {
            for (int i = 0; i < e.x; ++i) {
                const double x = (origin.x + (i + 0.5) * 20 - 35) / 70 - 0.5;
                const double y = (origin.y + (j + 0.5) * 20 + 60) / 70 - 0.5;
                const double z = (origin.z + (k + 0.5) * 20 - 150) / 70 - 0.5;
                double expected = 0;
                for (int c = int(std::floor(z)); c <= int(std::floor(z)) + 1; ++c) {
                    for (int b = int(std::floor(y)); b <= int(std::floor(y)) + 1; ++b) {
                        for (int a = int(std::floor(x)); a <= int(std::floor(x)) + 1; ++a) {
                            expected += double(coarse.value(a, b, c)) * (1 - std::abs(x - a)) *
                                        (1 - std::abs(y - b)) * (1 - std::abs(z - c));
                        }
                    }
                }
                expected += double(fine.value(i + offset_of_fine(origin.x), j + offset_of_fine(origin.y),
                                              k + offset_of_fine(origin.z)));
                ASSERT_NEAR(dense[linear_index(e, i, j, k)], std::min(1.0, expected), 1e-6)
                    << i << " " << j << " " << k;
                largest = std::max(largest, expected);
            }
        }
    }
    EXPECT_GT(largest, 0.5) << "an empty sky proves nothing";
}

// A coarse grid with periodic sides lies in the common box as the middle one of its copies would, and ends at
// its sides.
TEST(Combine, InterpolatesAcrossPeriodicSides) {
    const Extent extent{12, 5, 9};
    const Placement placement{{30, -60, 150}, 70};
    const DensityGrid fine = DensityGrid::from_dense(std::vector<float>(1), {1, 1, 1}, {{0, 0, 0}, 20});
    const DensityGrid coarse = random_grid(extent, placement, 6, 0.5);
    const Extent many{extent.x * 3, extent.y * 3, extent.z};
    std::vector<float> copies(many.cells());
    for (int k = 0; k < many.z; ++k) {
        for (int j = 0; j < many.y; ++j) {
            for (int i = 0; i < many.x; ++i)
                copies[linear_index(many, i, j, k)] = coarse.value(i % extent.x, j % extent.y, k);
        }
    }
    const Placement west_south{{30 - extent.x * 70.0, -60 - extent.y * 70.0, 150}, 70};
    const std::vector<DensityGrid> grids{fine, coarse},
        twins{fine, DensityGrid::from_dense(copies, many, west_south)};
    const std::vector<Boundaries> boundaries{{}, {Boundary::periodic, Boundary::periodic, Boundary::open}};
    const DensityGrid both = combine(grids, boundaries), twin = combine(twins);
    const Vec3 from = both.placement().origin_m, twin_from = twin.placement().origin_m;
    const auto offset = [](double a, double b) { return int(std::lround((a - b) / 20)); };
    const int dx = offset(from.x, twin_from.x), dy = offset(from.y, twin_from.y),
              dz = offset(from.z, twin_from.z);
    const Extent e = both.extent();
    float at_sides = 0;
    for (int k = 0; k < e.z; ++k) {
        for (int j = 0; j < e.y; ++j) {
            for (int i = 0; i < e.x; ++i) {
                const double x = from.x + (i + 0.5) * 20 - 30, y = from.y + (j + 0.5) * 20 + 60;
                const bool inside = x >= 0 && x < extent.x * 70 && y >= 0 && y < extent.y * 70;
                const float expected = inside ? twin.value(i + dx, j + dy, k + dz) : 0.0f;
                ASSERT_NEAR(both.value(i, j, k), expected, 1e-6) << i << " " << j << " " << k;
                if (x < 35) at_sides = std::max(at_sides, both.value(i, j, k));
            }
        }
    }
    EXPECT_GT(at_sides, 0.3f) << "empty sides prove nothing";
    EXPECT_THROW(combine(grids, std::vector<Boundaries>(3)), Error);
}

TEST(Scaled, MultipliesEveryValue) {
    const DensityGrid a = random_grid({17, 9, 20}, {{0, 0, 0}, 10}, 5, 0.5);
    const std::vector<float> before = a.to_dense(), after = scaled(a, 0.25).to_dense();
    for (std::size_t n = 0; n < before.size(); ++n) ASSERT_EQ(after[n], before[n] * 0.25f);
    EXPECT_EQ(scaled(a, 1).to_dense(), before);
    EXPECT_THROW(scaled(a, 0), Error);
    EXPECT_THROW(scaled(a, 1.5), Error);
}

}  // namespace
}  // namespace nephos
