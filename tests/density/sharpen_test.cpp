// SPDX-License-Identifier: Apache-2.0
// Sums of gradients equal those of a naive twin; density gets back the sharpness that a mean of two states has lost, and
// keeps its mass, its place and its range.

#include "density/sharpen.h"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"
#include "density/carry.h"
#include "density/smoothing.h"
#include "tests/reference/with_threads.h"

namespace nephos {
namespace {

constexpr Extent kExtent{37, 22, 11};  // no whole blocks
const Placement kPlacement{{-100, 300, 900}, 40};
constexpr Boundaries kOpen{};
constexpr Boundaries kPeriodic{Boundary::periodic, Boundary::periodic, Boundary::open};

// Random bits in the middle of the box or, with `everywhere`, also at its sides.
DensityGrid clouds(unsigned seed, bool everywhere) {
    BitPlane plane(kExtent);
    std::mt19937 random(seed);
    const auto place = [&](int size) {
        return everywhere ? int(random() % unsigned(size)) : size / 4 + int(random() % unsigned(size / 2));
    };
    for (int n = 0; n < 500; ++n) {
        const int x = place(kExtent.x), y = place(kExtent.y), z = place(kExtent.z);
        plane.set(x, y, z, true);
    }
    const std::vector<TimedPlane> planes{{plane.view(), 0}};
    return smooth(planes, SmoothingOptions{}, kPlacement, everywhere ? kPeriodic : kOpen);
}

std::vector<Vec2> naive_gradients(const DensityGrid& grid, bool periodic) {
    const Extent e = grid.extent();
    std::vector<Vec2> sums(std::size_t(e.z), Vec2(0));
    for (int k = 0; k < e.z; ++k)
        for (int j = 0; j < e.y; ++j)
            for (int i = 0; i < e.x; ++i) {
                const double value = double(grid.value(i, j, k));
                Vec2& sum = sums[std::size_t(k)];
                if (periodic || i + 1 < e.x) sum.x += std::abs(double(grid.value((i + 1) % e.x, j, k)) - value);
                if (periodic || j + 1 < e.y) sum.y += std::abs(double(grid.value(i, (j + 1) % e.y, k)) - value);
            }
    return sums;
}

double sum_of(const std::vector<Vec2>& gradients) {
    double sum = 0;
    for (const Vec2& level : gradients) sum += level.x + level.y;
    return sum;
}

TEST(Sharpen, GradientsEqualTheTwin) {
    for (const bool periodic : {false, true}) {
        const DensityGrid grid = clouds(1, periodic);
        const std::vector<Vec2> expected = naive_gradients(grid, periodic),
                                found = gradients_of(grid, periodic ? kPeriodic : kOpen);
        ASSERT_EQ(found.size(), expected.size());
        for (std::size_t k = 0; k < found.size(); ++k) {
            EXPECT_NEAR(found[k].x, expected[k].x, 1e-4) << periodic << " " << k;
            EXPECT_NEAR(found[k].y, expected[k].y, 1e-4) << periodic << " " << k;
        }
    }
}

// The mean of a sky and its copy a voxel beside it, as linear interpolation half-way has it.
TEST(Sharpen, GivesBackWhatAMeanHasLost) {
    for (const bool periodic : {false, true}) {
        const Boundaries boundaries = periodic ? kPeriodic : kOpen;
        const DensityGrid a = clouds(2, periodic);
        const std::vector<Vec2> beside(std::size_t(kExtent.z), Vec2(1, 0));
        const DensityGrid mean = mix(a, carried({&a, beside}, boundaries), 0.5);
        const std::vector<Vec2> wanted = gradients_of(a, boundaries), blurred = gradients_of(mean, boundaries);
        EXPECT_LT(sum_of(blurred), 0.97 * sum_of(wanted));
        const DensityGrid sharp = sharpened(mean, wanted, boundaries);
        const std::vector<Vec2> found = gradients_of(sharp, boundaries);
        EXPECT_NEAR(sum_of(found), sum_of(wanted), 0.02 * sum_of(wanted)) << periodic;
        EXPECT_NEAR(sharp.sum(), mean.sum(), 1e-5 * mean.sum());
        EXPECT_LE(sharp.max_value(), 1.0f);
        double x = 0, y = 0;
        for (int k = 0; k < kExtent.z; ++k)
            for (int j = 0; j < kExtent.y; ++j)
                for (int i = 0; i < kExtent.x; ++i) {
                    const float before = mean.value(i, j, k), after = sharp.value(i, j, k);
                    EXPECT_GE(after, 0.0f);
                    if (before == 0) {
                        EXPECT_EQ(after, 0.0f);
                    }
                    x += i * (double(after) - double(before));
                    y += j * (double(after) - double(before));
                }
        if (periodic) continue;  // the middle is not where its parts are
        EXPECT_LT(std::abs(x / mean.sum()), 0.05);
        EXPECT_LT(std::abs(y / mean.sum()), 0.05);
    }
}

// Lattices of one row or column, or without structure along one axis: the other is sharpened alone.
TEST(Sharpen, OneAxisIsSharpenedAlone) {
    for (const Extent extent : {Extent{40, 1, 3}, Extent{1, 40, 3}, Extent{40, 16, 3}, Extent{16, 40, 3}}) {
        const bool along_x = extent.x == 40;
        const auto waves = [&](double moved) {
            std::vector<float> values;
            for (int k = 0; k < extent.z; ++k)
                for (int j = 0; j < extent.y; ++j)
                    for (int i = 0; i < extent.x; ++i)
                        values.push_back(
                            float(0.5 + 0.3 * std::sin(2 * 3.14159265 * ((along_x ? i : j) + moved) / 5)));
            return DensityGrid::from_dense(values, extent, kPlacement);
        };
        const DensityGrid a = waves(0), mean = mix(a, waves(1), 0.5);
        const std::vector<Vec2> wanted = gradients_of(a, kPeriodic);
        EXPECT_LT(sum_of(gradients_of(mean, kPeriodic)), 0.85 * sum_of(wanted));
        const DensityGrid sharp = sharpened(mean, wanted, kPeriodic);
        EXPECT_NEAR(sum_of(gradients_of(sharp, kPeriodic)), sum_of(wanted), 0.02 * sum_of(wanted))
            << extent.x;
        EXPECT_NEAR(sharp.sum(), mean.sum(), 1e-4 * mean.sum());
    }
}

TEST(Sharpen, WhatIsSharpEnoughStays) {
    const DensityGrid grid = clouds(4, true);
    std::vector<Vec2> wanted = gradients_of(grid, kPeriodic);
    EXPECT_TRUE(sharpened(grid, wanted, kPeriodic).to_dense() == grid.to_dense());
    for (Vec2& level : wanted) level = level * 0.5;
    EXPECT_TRUE(sharpened(grid, wanted, kPeriodic).to_dense() == grid.to_dense());
    const DensityGrid none = DensityGrid::from_dense(std::vector<float>(kExtent.cells()), kExtent, kPlacement);
    EXPECT_EQ(sharpened(none, wanted, kPeriodic).sum(), 0);
}

TEST(Sharpen, HasTheSameBitsForAnyThreadsAndRefusesNonsense) {
    const DensityGrid a = clouds(5, true), mean = mix(a, clouds(6, true), 0.3);
    const std::vector<Vec2> wanted = gradients_of(a, kPeriodic);
    const auto sharp = [&] { return sharpened(mean, wanted, kPeriodic).to_dense(); };
    const std::vector<float> once = test::with_threads(1, sharp);
    for (const std::size_t threads : {2, 5}) EXPECT_TRUE(test::with_threads(threads, sharp) == once);
    EXPECT_THROW(sharpened(mean, std::vector<Vec2>(3, Vec2(0)), kPeriodic), Error);
}

}  // namespace
}  // namespace nephos
