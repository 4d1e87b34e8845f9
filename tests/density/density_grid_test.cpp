// SPDX-License-Identifier: Apache-2.0

// The grid as a container, the mix of two of them, and the statistics of a state.

#include "density/density_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <set>
#include <span>
#include <utility>

#include <gtest/gtest.h>

#include "core/error.h"
#include "density/smoothing.h"
#include "density/statistics.h"
#include "tests/density/naive_smoothing.h"

namespace nephos {
namespace {

std::vector<float> random_values(Extent extent, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::vector<float> values(extent.cells());
    for (float& v : values) v = random() % 2 ? 0.0f : float(random() % 1000 + 1) / 1000.0f;
    return values;
}

TEST(DensityGrid, VisitsTheBlocksOfTwoGrids) {
    constexpr Extent kExtent{21, 30, 17};
    for (const std::uint64_t seed : {1u, 2u, 3u}) {
        // Each has half of the blocks, of which some are of one value.
        std::array<std::vector<float>, 2> values{random_values(kExtent, seed),
                                                 random_values(kExtent, seed + 9)};
        for (std::size_t of = 0; of < 2; ++of) {
            std::mt19937_64 random(seed + 20 + of);
            for (int z = 0; z < kExtent.z; z += 8)
                for (int y = 0; y < kExtent.y; y += 8)
                    for (int x = 0; x < kExtent.x; x += 8) {
                        const auto kind = random() % 4;
                        if (kind < 2) continue;
                        for (int k = z; k < std::min(z + 8, kExtent.z); ++k)
                            for (int j = y; j < std::min(y + 8, kExtent.y); ++j)
                                for (int i = x; i < std::min(x + 8, kExtent.x); ++i)
                                    values[of][linear_index(kExtent, i, j, k)] = kind == 2 ? 0.0f : 0.5f;
                    }
        }
        const DensityGrid a = DensityGrid::from_dense(values[0], kExtent, {}),
                          b = DensityGrid::from_dense(values[1], kExtent, {});
        double found = 0, wanted = 0;
        std::multiset<std::pair<float, float>> pairs, all;
        a.visit_blocks(b, [&](std::span<const float> of_a, std::span<const float> of_b) {
            ASSERT_EQ(of_a.size(), of_b.size());
            for (std::size_t n = 0; n < of_a.size(); ++n) {
                found += std::abs(double(of_a[n]) - double(of_b[n]));
                if (of_a[n] > 0 || of_b[n] > 0) pairs.insert({of_a[n], of_b[n]});
            }
        });
        for (std::size_t n = 0; n < values[0].size(); ++n) {
            wanted += std::abs(double(values[0][n]) - double(values[1][n]));
            if (values[0][n] > 0 || values[1][n] > 0) all.insert({values[0][n], values[1][n]});
        }
        EXPECT_EQ(pairs, all);
        EXPECT_NEAR(found, wanted, 1e-9 * wanted);
    }
    EXPECT_THROW(
        DensityGrid().visit_blocks(DensityGrid::from_dense(std::vector<float>(8), {2, 2, 2}, {}), {}), Error);
}

TEST(DensityGrid, KeepsDenseValues) {
    for (const Extent extent : {Extent{1, 1, 1}, Extent{8, 8, 8}, Extent{21, 9, 17}, Extent{130, 3, 2}}) {
        const auto values = random_values(extent, 3);
        const Placement placement{{1, 2, 3}, 4};
        const DensityGrid grid = DensityGrid::from_dense(values, extent, placement);
        EXPECT_EQ(grid.to_dense(), values);
        EXPECT_EQ(grid.extent(), extent);
        EXPECT_EQ(grid.placement(), placement);
        std::uint64_t active = 0;
        double sum = 0;
        float largest = 0;
        VoxelBox box{{1000, 1000, 1000}, {-1, -1, -1}};
        for (int k = 0; k < extent.z; ++k) {
            for (int j = 0; j < extent.y; ++j) {
                for (int i = 0; i < extent.x; ++i) {
                    const float v = values[linear_index(extent, i, j, k)];
                    ASSERT_EQ(grid.value(i, j, k), v);
                    sum += double(v);
                    largest = std::max(largest, v);
                    if (v == 0) continue;
                    ++active;
                    const int at[] = {i, j, k};
                    for (std::size_t a = 0; a < 3; ++a) {
                        box.min[a] = std::min(box.min[a], at[a]);
                        box.max[a] = std::max(box.max[a], at[a]);
                    }
                }
            }
        }
        EXPECT_EQ(grid.active_voxels(), active);
        EXPECT_NEAR(grid.sum(), sum, 1e-9 * sum);
        EXPECT_EQ(grid.max_value(), largest);
        if (active > 0) {
            EXPECT_EQ(grid.bounding_box(), box);
        }
        EXPECT_EQ(grid.value(-1, 0, 0), 0.0f);
        EXPECT_EQ(grid.value(extent.x, 0, 0), 0.0f);
    }
}

TEST(DensityGrid, EmptyOnesAreEmpty) {
    for (const DensityGrid& grid :
         {DensityGrid(), DensityGrid::from_dense(std::vector<float>(60, 0.0f), {3, 4, 5}, {})}) {
        EXPECT_EQ(grid.active_voxels(), 0u);
        EXPECT_TRUE(grid.bounding_box().empty());
        EXPECT_EQ(grid.max_value(), 0.0f);
        EXPECT_EQ(grid.sum(), 0.0);
        EXPECT_EQ(grid.to_dense().size(), grid.extent().cells());
    }
}

TEST(DensityGrid, RejectsWhatIsNoDensity) {
    const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
    for (float bad : {-0.001f, nan, inf, -inf}) {
        std::vector<float> values(8, 0.5f);
        values[5] = bad;
        EXPECT_THROW(DensityGrid::from_dense(values, {2, 2, 2}, {}), Error) << bad;
    }
    EXPECT_THROW(DensityGrid::from_dense(std::vector<float>(7), {2, 2, 2}, {}), Error);
    EXPECT_THROW(DensityGrid::from_dense(std::vector<float>(8), {2, 2, 2}, {{}, 0}), Error);
    EXPECT_THROW(DensityGrid::from_dense(std::vector<float>(8), {2, 2, 2}, {{}, std::nan("")}), Error);
}

TEST(DensityGrid, MixesLinearlyInTime) {
    const Extent extent{35, 18, 20};
    auto a = random_values(extent, 1), b = random_values(extent, 2);
    // Whole blocks: both saturated, one saturated, both empty.
    for (int n = 0; n < 512; ++n) {
        const int i = n % 8, j = n / 8 % 8, k = n / 64;
        a[linear_index(extent, i, j, k)] = b[linear_index(extent, i, j, k)] = 1;
        a[linear_index(extent, i + 8, j, k)] = 1;
        a[linear_index(extent, i + 16, j, k)] = b[linear_index(extent, i + 16, j, k)] = 0;
        b[linear_index(extent, i + 24, j, k)] = 1;
        a[linear_index(extent, i + 24, j, k)] = 0;
    }
    const DensityGrid from = DensityGrid::from_dense(a, extent, {}),
                      to = DensityGrid::from_dense(b, extent, {});
    for (double fraction : {0.0, 0.25, 1.0 / 3.0, 0.9, 1.0}) {
        const auto mixed = mix(from, to, fraction).to_dense();
        for (std::size_t n = 0; n < mixed.size(); ++n) {
            ASSERT_NEAR(mixed[n], double(a[n]) * (1 - fraction) + double(b[n]) * fraction, 1e-6);
            if (a[n] == b[n]) {
                ASSERT_EQ(mixed[n], a[n]);
            }
        }
    }
    EXPECT_EQ(mix(from, to, 0).to_dense(), a);
    EXPECT_EQ(mix(from, to, 1).to_dense(), b);
    EXPECT_THROW(mix(from, to, -0.1), Error);
    EXPECT_THROW(mix(from, to, 1.1), Error);
    EXPECT_THROW(mix(from, DensityGrid::from_dense(b, extent, {{}, 3}), 0.5), Error);
    EXPECT_THROW(mix(from, DensityGrid(), 0.5), Error);
}

TEST(CloudStatistics, MatchesCountingCellByCell) {
    for (std::uint64_t seed = 1; seed < 20; ++seed) {
        std::mt19937_64 random(seed);
        const Extent extent{int(random() % 150) + 1, int(random() % 12) + 1, int(random() % 12) + 1};
        const double p = seed % 4 == 0 ? 0.0 : seed % 4 == 1 ? 0.002 : 0.1;
        const BitPlane hum = test::random_plane(extent, 0.4, seed),
                       act = test::random_plane(extent, 0.05, seed + 100);
        const BitPlane cld = test::random_plane(extent, p, seed + 200);
        std::uint64_t counts[3] = {};
        std::set<std::pair<int, int>> columns;
        int low = 1000, high = -1;
        for (int k = 0; k < extent.z; ++k) {
            for (int j = 0; j < extent.y; ++j) {
                for (int i = 0; i < extent.x; ++i) {
                    counts[0] += hum.get(i, j, k);
                    counts[1] += act.get(i, j, k);
                    if (!cld.get(i, j, k)) continue;
                    ++counts[2];
                    columns.insert({i, j});
                    low = std::min(low, k);
                    high = std::max(high, k);
                }
            }
        }
        const CloudStatistics s = cloud_statistics(hum.view(), act.view(), cld.view(), {{0, 0, 400}, 50});
        EXPECT_EQ(s.hum, counts[0]) << "seed " << seed;
        EXPECT_EQ(s.act, counts[1]) << "seed " << seed;
        EXPECT_EQ(s.cld, counts[2]) << "seed " << seed;
        EXPECT_DOUBLE_EQ(s.cover, double(columns.size()) / (extent.x * extent.y)) << "seed " << seed;
        EXPECT_DOUBLE_EQ(s.mean_density, double(counts[2]) / double(extent.cells())) << "seed " << seed;
        if (counts[2] == 0) {
            EXPECT_TRUE(std::isnan(s.base_m) && std::isnan(s.top_m));
        } else {
            EXPECT_DOUBLE_EQ(s.base_m, 400 + 50.0 * low);
            EXPECT_DOUBLE_EQ(s.top_m, 400 + 50.0 * (high + 1));
        }
    }
}

TEST(CloudStatistics, PlanesOfDifferentExtentsAreRefused) {
    const BitPlane cld({40, 24, 16});
    EXPECT_THROW(cloud_statistics(cld.view(), BitPlane({1, 1, 1}).view(), cld.view(), {}), Error);
}

// On a periodic box smoothing only moves density about: the mean stays that of the bits.
TEST(DensityGrid, SmoothingKeepsTheMeanOfAPeriodicBox) {
    const Extent extent{40, 24, 16};
    const BitPlane cld = test::random_plane(extent, 0.2, 9);
    const TimedPlane timed[] = {{cld.view(), 0}};
    const Boundaries periodic{Boundary::periodic, Boundary::periodic, Boundary::periodic};
    const DensityGrid grid = smooth(timed, {}, {}, periodic);
    EXPECT_NEAR(grid.sum() / double(extent.cells()), double(cld.count()) / double(extent.cells()), 1e-6);
}

}  // namespace
}  // namespace nephos
