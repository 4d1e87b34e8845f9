// SPDX-License-Identifier: Apache-2.0
// Density carried by fractions of a voxel: equal to its naive twin, exact for whole voxels, as sharp and as heavy as before.

#include "density/carry.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"
#include "density/smoothing.h"
#include "tests/reference/with_threads.h"

namespace nephos {
namespace {

constexpr Extent kExtent{37, 22, 11};  // no whole blocks
const Placement kPlacement{{-100, 300, 900}, 40};
constexpr Boundaries kOpen{};
constexpr Boundaries kPeriodic{Boundary::periodic, Boundary::periodic, Boundary::open};

// Random bits, smoothed as the automaton's are.
DensityGrid clouds(unsigned seed) {
    BitPlane plane(kExtent);
    std::mt19937 random(seed);
    for (int n = 0; n < 30; ++n) {
        const int x = int(random() % 37), y = int(random() % 22), z = int(random() % 11);
        for (int cell = 0; cell < 50; ++cell)
            plane.set(std::min(36, x + int(random() % 6)), std::min(21, y + int(random() % 5)),
                      std::min(10, z + int(random() % 3)), true);
    }
    const std::vector<TimedPlane> planes{{plane.view(), 0}};
    return smooth(planes, SmoothingOptions{}, kPlacement, kPeriodic);
}

std::vector<Vec2> shifts(unsigned seed, double most) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> drawn(-most, most);
    std::vector<Vec2> result;
    for (int k = 0; k < kExtent.z; ++k) {
        const double x = drawn(random), y = drawn(random);
        result.emplace_back(x, y);
    }
    return result;
}

// One axis of the twin: Lagrange's polynomial through the voxels at -2 .. 3 around a place, limited to its neighbours.
template <typename Value>
double interpolated(double place, int voxels, bool periodic, const Value& value) {
    const auto at = [&](int i) {
        return value(periodic ? ((i % voxels) + voxels) % voxels : std::clamp(i, 0, voxels - 1));
    };
    const int below = int(std::floor(place));
    const double f = place - below;
    double sum = 0;
    for (int m = -2; m <= 3; ++m) {
        double weight = 1;
        for (int n = -2; n <= 3; ++n)
            if (n != m) weight *= (f - n) / (m - n);
        sum += weight * at(below + m);
    }
    return std::clamp(sum, std::min(at(below), at(below + 1)), std::max(at(below), at(below + 1)));
}

double twin(const DensityGrid& grid, const std::vector<Vec2>& shift, bool periodic, int i, int j, int k) {
    const double x = i - shift[std::size_t(k)].x, y = j - shift[std::size_t(k)].y;
    const auto within = [&](double at, int voxels) { return periodic || (at >= -1 && at <= voxels); };
    if (!within(x, kExtent.x) || !within(y, kExtent.y)) return 0;
    return interpolated(y, kExtent.y, periodic, [&](int row) {
        return interpolated(x, kExtent.x, periodic,
                            [&](int column) { return double(grid.value(column, row, k)); });
    });
}

TEST(Carry, EqualsTheTwin) {
    const DensityGrid grid = clouds(1);
    for (const bool periodic : {false, true}) {
        for (const double most : {0.7, 6.0, 90.0}) {
            const std::vector<Vec2> shift = shifts(7, most);
            const DensityGrid moved = carried({&grid, shift}, periodic ? kPeriodic : kOpen);
            double worst = 0;
            for (int k = 0; k < kExtent.z; ++k)
                for (int j = 0; j < kExtent.y; ++j)
                    for (int i = 0; i < kExtent.x; ++i)
                        worst = std::max(worst, std::abs(twin(grid, shift, periodic, i, j, k) -
                                                         double(moved.value(i, j, k))));
            EXPECT_LT(worst, 2e-6) << periodic << " " << most;
        }
    }
}

TEST(Carry, WholeVoxelsAreExact) {
    const DensityGrid grid = clouds(2);
    const std::vector<Vec2> shift(std::size_t(kExtent.z), Vec2(5, -3)), none(std::size_t(kExtent.z), Vec2(0));
    const DensityGrid moved = carried({&grid, shift}, kPeriodic);
    for (int k = 0; k < kExtent.z; ++k)
        for (int j = 0; j < kExtent.y; ++j)
            for (int i = 0; i < kExtent.x; ++i)
                ASSERT_EQ(moved.value((i + 5) % 37, (j + 19) % 22, k), grid.value(i, j, k))
                    << i << " " << j << " " << k;
    EXPECT_EQ(carried({&grid, none}, kOpen).to_dense(), grid.to_dense());
}

double gradients(const DensityGrid& grid) {
    double sum = 0;
    for (int k = 0; k < kExtent.z; ++k)
        for (int j = 0; j < kExtent.y; ++j)
            for (int i = 0; i < kExtent.x; ++i)
                sum += std::abs(double(grid.value((i + 1) % kExtent.x, j, k)) - double(grid.value(i, j, k)));
    return sum;
}

// Half a voxel is the worst. Linear interpolation loses 9 % of the gradients here, which the last line shows.
TEST(Carry, KeepsMassAndSharpness) {
    const DensityGrid grid = clouds(3);
    for (const double fraction : {0.1, 0.25, 0.5, 0.8}) {
        const std::vector<Vec2> shift(std::size_t(kExtent.z), Vec2(fraction, 0));
        const DensityGrid moved = carried({&grid, shift}, kPeriodic);
        EXPECT_NEAR(moved.sum(), grid.sum(), 0.002 * grid.sum()) << fraction;
        EXPECT_NEAR(gradients(moved), gradients(grid), 0.02 * gradients(grid)) << fraction;
    }
    const std::vector<Vec2> one(std::size_t(kExtent.z), Vec2(1, 0));
    const DensityGrid linear = mix(grid, carried({&grid, one}, kPeriodic), 0.5);
    EXPECT_LT(gradients(linear), 0.97 * gradients(grid));
}

// What flows in is known from the later state alone, what flows out from the earlier; neither is dimmed.
TEST(Carry, StatesThatDoNotReachLeaveTheOtherAlone) {
    const DensityGrid full =
        DensityGrid::from_dense(std::vector<float>(kExtent.cells(), 0.5f), kExtent, kPlacement);
    const std::vector<Vec2> forward(std::size_t(kExtent.z), Vec2(4.5, 0)),
        back(std::size_t(kExtent.z), Vec2(-4.5, 0));
    const DensityGrid mixed = carried_mix({&full, forward}, {&full, back}, 0.5, kOpen);
    for (const float value : mixed.to_dense()) ASSERT_NEAR(value, 0.5f, 1e-6f);
    const DensityGrid moved = carried({&full, forward}, kOpen);
    EXPECT_EQ(moved.value(3, 5, 5), 0.0f);
    EXPECT_EQ(moved.value(4, 5, 5), 0.5f);
}

TEST(Carry, HasTheSameBitsForAnyThreadsAndRefusesNonsense) {
    const DensityGrid a = clouds(4), b = clouds(5);
    const std::vector<Vec2> from = shifts(8, 3), to = shifts(9, 3);
    const auto mixed = [&] { return carried_mix({&a, from}, {&b, to}, 0.3, kPeriodic).to_dense(); };
    const std::vector<float> once = test::with_threads(1, mixed);
    for (const std::size_t threads : {2, 5}) EXPECT_TRUE(test::with_threads(threads, mixed) == once);
    const std::vector<Vec2> few(3, Vec2(0)), far(std::size_t(kExtent.z), Vec2(0x1p31, 0));
    EXPECT_THROW(carried({&a, few}, kOpen), Error);
    EXPECT_THROW(carried({&a, far}, kOpen), Error);
    EXPECT_THROW(carried_mix({&a, from}, {&b, to}, 1.5, kOpen), Error);
}

}  // namespace
}  // namespace nephos
