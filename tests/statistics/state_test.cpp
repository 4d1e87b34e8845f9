// SPDX-License-Identifier: Apache-2.0

// Counts of a state, overlap and correlation against the same definitions cell by cell.

#include <algorithm>
#include <cmath>

#include "statistics/cloud_statistics.h"
#include "statistics/structure.h"
#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/statistics/random_planes.h"

namespace nephos {
namespace {

struct Case {
    std::uint64_t seed;
    Extent extent;
    Boundaries boundaries;
    BitPlane cld;
};

Case random_case(std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const Extent extent{int(random() % 150) + 1, int(random() % 12) + 1, int(random() % 10) + 1};
    const double p = seed % 4 == 0 ? 0.0 : seed % 4 == 1 ? 0.01 : seed % 4 == 2 ? 0.2 : 1.0;
    const Boundaries boundaries = test::random_boundaries(random);
    return {seed, extent, boundaries, test::random_cells(extent, p, random)};
}

bool covered(const BitPlane& cld, int i, int j) {
    for (int k = 0; k < cld.extent().z; ++k)
        if (cld.get(i, j, k)) return true;
    return false;
}

TEST(CloudCounts, MatchCountingCellByCell) {
    for (std::uint64_t seed = 1; seed < 60; ++seed) {
        const Case c = random_case(seed);
        SCOPED_TRACE(seed);
        CloudCounts expected;
        expected.level_cells.resize(std::size_t(c.extent.z));
        expected.bases = expected.tops = expected.level_cells;
        double base_sum = 0, top_sum = 0;
        for (int j = 0; j < c.extent.y; ++j) {
            for (int i = 0; i < c.extent.x; ++i) {
                int low = -1, high = -1;
                for (int k = 0; k < c.extent.z; ++k) {
                    if (!c.cld.get(i, j, k)) continue;
                    ++expected.level_cells[std::size_t(k)];
                    ++expected.cells;
                    if (low < 0) low = k;
                    high = k;
                }
                const int east = test::neighbour(i, 1, c.extent.x, c.boundaries.x);
                const int north = test::neighbour(j, 1, c.extent.y, c.boundaries.y);
                if (east >= 0 && covered(c.cld, i, j) != covered(c.cld, east, j)) ++expected.edges;
                if (north >= 0 && covered(c.cld, i, j) != covered(c.cld, i, north)) ++expected.edges;
                if (low < 0) continue;
                ++expected.columns;
                ++expected.bases[std::size_t(low)];
                ++expected.tops[std::size_t(high)];
                base_sum += 400 + 50.0 * low;
                top_sum += 400 + 50.0 * (high + 1);
            }
        }
        const CloudCounts got = count_cloud(c.cld.view(), c.boundaries);
        EXPECT_EQ(got.cells, expected.cells);
        EXPECT_EQ(got.columns, expected.columns);
        EXPECT_EQ(got.edges, expected.edges);
        EXPECT_EQ(got.level_cells, expected.level_cells);
        EXPECT_EQ(got.bases, expected.bases);
        EXPECT_EQ(got.tops, expected.tops);
        const CloudStatistics s = cloud_statistics(got, {{0, 0, 400}, 50});
        EXPECT_DOUBLE_EQ(s.perimeter_m, 50.0 * double(expected.edges));
        EXPECT_DOUBLE_EQ(s.cover, double(expected.columns) / (c.extent.x * c.extent.y));
        if (expected.columns == 0) {
            EXPECT_TRUE(std::isnan(s.base_mean_m) && std::isnan(s.top_mean_m) && std::isnan(s.base_m));
        } else {
            EXPECT_NEAR(s.base_mean_m, base_sum / double(expected.columns), 1e-9);
            EXPECT_NEAR(s.top_mean_m, top_sum / double(expected.columns), 1e-9);
        }
    }
}

TEST(CloudCounts, QuantilesAreThoseOfTheSortedHeights) {
    CloudCounts counts;
    counts.extent = {10, 1, 4};
    counts.bases = {1, 0, 8, 1};
    const Placement at{{0, 0, 100}, 10};
    EXPECT_EQ(height_quantile_m(counts, CloudLimit::base, 0, at), 100);
    EXPECT_EQ(height_quantile_m(counts, CloudLimit::base, 0.1, at), 100);
    EXPECT_EQ(height_quantile_m(counts, CloudLimit::base, 0.11, at), 120);
    EXPECT_EQ(height_quantile_m(counts, CloudLimit::base, 0.9, at), 120);
    EXPECT_EQ(height_quantile_m(counts, CloudLimit::base, 1, at), 130);
}

TEST(CloudCounts, DeathsAreCellsThatWereAndAreNot) {
    for (std::uint64_t seed = 1; seed < 20; ++seed) {
        std::mt19937_64 random(seed);
        const Extent extent{int(random() % 150) + 1, int(random() % 12) + 1, int(random() % 10) + 1};
        BitPlane before = test::random_cells(extent, 0.3, random);
        const BitPlane after = test::random_cells(extent, 0.3, random);
        std::uint64_t deaths = 0;
        for (int k = 0; k < extent.z; ++k)
            for (int j = 0; j < extent.y; ++j)
                for (int i = 0; i < extent.x; ++i) deaths += before.get(i, j, k) && !after.get(i, j, k);
        EXPECT_EQ(count_deaths_and_replace(before, after.view()), deaths) << "seed " << seed;
        EXPECT_TRUE(std::ranges::equal(before.words(), after.words())) << "seed " << seed;
    }
    BitPlane other({1, 1, 1});
    EXPECT_THROW(count_deaths_and_replace(other, BitPlane({2, 1, 1}).view()), Error);
}

TEST(Structure, OverlapOfTwoLevelsIsItsDefinition) {
    // f = 1/2, g = 1/4: together 1/2 is maximum (1), 5/8 random (0), 3/4 minimum ((3/4 - 5/8) / (1/2 - 5/8) = -1).
    const auto overlap = [](int begin) {
        BitPlane cld({8, 1, 2});
        for (int i = 0; i < 4; ++i) cld.set(i, 0, 0, true);
        for (int i = begin; i < begin + 2; ++i) cld.set(i, 0, 1, true);
        return level_overlaps(cld.view()).front().mean;
    };
    EXPECT_DOUBLE_EQ(overlap(0), 1);
    EXPECT_DOUBLE_EQ(overlap(3), 0);
    EXPECT_DOUBLE_EQ(overlap(6), -1);
    const std::vector<LevelOverlap> none = level_overlaps(BitPlane({8, 1, 2}).view());
    EXPECT_EQ(none.front().pairs, 0);
    EXPECT_TRUE(std::isnan(none.front().mean));
    // exp(-dz / z0) gives z0 back.
    std::vector<LevelOverlap> exponential;
    for (int n = 1; n < 6; ++n) exponential.push_back({n, std::exp(-n * 50 / 180.0), 10 - n});
    EXPECT_NEAR(overlap_length_m(exponential, 50), 180, 1e-9);
}

TEST(Structure, CorrelationMatchesCountingPairs) {
    for (std::uint64_t seed = 1; seed < 25; ++seed) {
        std::mt19937_64 random(seed);
        const Extent extent{int(random() % 140) + 4, int(random() % 20) + 4, 1};
        const Boundaries boundaries = test::random_boundaries(random);
        const BitPlane s = test::random_cells(extent, 0.4, random);
        const double c = double(count_cells(s.view())) / double(extent.cells());
        for (const Correlation& got : shadow_correlation(s.view(), boundaries)) {
            double covered = 0, all = 0;
            for (int j = 0; j < extent.y; ++j) {
                for (int i = 0; i < extent.x; ++i) {
                    const int east = test::neighbour(i, got.distance, extent.x, boundaries.x);
                    const int north = test::neighbour(j, got.distance, extent.y, boundaries.y);
                    if (east >= 0) {
                        ++all;
                        covered += s.get(i, j, 0) && s.get(east, j, 0);
                    }
                    if (north >= 0) {
                        ++all;
                        covered += s.get(i, j, 0) && s.get(i, north, 0);
                    }
                }
            }
            EXPECT_NEAR(got.value, (covered / all - c * c) / (c - c * c), 1e-12)
                << "seed " << seed << " r " << got.distance;
        }
    }
    EXPECT_NEAR(correlation_length_m({{1, 0.8}, {2, 0.3}}, 50), 50 * (1 + (0.8 - std::exp(-1)) / 0.5), 1e-9);
    EXPECT_TRUE(std::isnan(correlation_length_m({{1, 0.8}}, 50)));
}

// Rectangles of `side` columns at random places, so that the correlation falls over that distance.
BitPlane random_rectangles(const Extent& extent, int side, int count, std::mt19937_64& random) {
    BitPlane plane(extent);
    for (int n = 0; n < count; ++n) {
        const int i0 = int(random() % std::uint64_t(extent.x)), j0 = int(random() % std::uint64_t(extent.y));
        for (int j = j0; j < std::min(j0 + side, extent.y); ++j)
            for (int i = i0; i < std::min(i0 + side, extent.x); ++i) plane.set(i, j, 0, true);
    }
    return plane;
}

// Of a shadow rho is computed no farther than 1/e: the length is that of all distances, bit for bit.
TEST(Structure, CorrelationLengthOfAShadowIsThatOfAllItsDistances) {
    int far = 0, never = 0;
    for (std::uint64_t seed = 1; seed < 60; ++seed) {
        SCOPED_TRACE(seed);
        std::mt19937_64 random(seed);
        const Extent extent{int(random() % 140) + 1, int(random() % 60) + 1, 1};
        const Boundaries boundaries = test::random_boundaries(random);
        const BitPlane s = random_rectangles(extent, 1 << seed % 6, int(seed % 9), random);
        const double length = correlation_length_m(s.view(), boundaries, 50),
                     expected = correlation_length_m(shadow_correlation(s.view(), boundaries), 50);
        if (std::isnan(expected)) {
            EXPECT_TRUE(std::isnan(length)) << length;
            ++never;
        } else {
            EXPECT_EQ(length, expected);
            far += length > 4 * 50;
        }
    }
    EXPECT_GT(far, 5) << "lengths of several distances";
    EXPECT_GT(never, 5) << "shadows without a length";
}

}  // namespace
}  // namespace nephos
