// SPDX-License-Identifier: Apache-2.0

// Smoothing against its naive twin on random bits, and the promises of its header: saturated is exactly 1,
// above 0 exactly where a cell of the window is cloud, the same bits whatever the number of threads.

#include "density/smoothing.h"

#include <cmath>
#include <iterator>
#include <string>

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include "core/error.h"
#include "tests/density/naive_smoothing.h"
#include "tests/reference/with_threads.h"

namespace nephos {
namespace {

using test::full_plane;
using test::naive_smooth;
using test::random_plane;

constexpr Boundary kOpen = Boundary::open, kPeriodic = Boundary::periodic;
constexpr SmoothingKernel kKernels[] = {SmoothingKernel::box, SmoothingKernel::tent,
                                        SmoothingKernel::gaussian};

std::string describe(const Extent& e, const SmoothingOptions& o, const Boundaries& b, std::uint64_t seed) {
    return "extent " + std::to_string(e.x) + "x" + std::to_string(e.y) + "x" + std::to_string(e.z) +
           " kernel " + std::to_string(int(o.kernel)) + " radii " + std::to_string(o.i0) + " " +
           std::to_string(o.j0) + " " + std::to_string(o.k0) + " " + std::to_string(o.t0) + " periodic " +
           std::to_string(int(b.x)) + std::to_string(int(b.y)) + std::to_string(int(b.z)) + " seed " +
           std::to_string(seed);
}

std::vector<float> smooth_dense(std::span<const TimedPlane> planes, const SmoothingOptions& options,
                                const Boundaries& boundaries) {
    return smooth(planes, options, Placement{}, boundaries).to_dense();
}

// Against the twin: equal to a relative 2^-22 (one rounding of r, one of the product, one of the sum), 0 where
// the twin is 0.
void expect_matches_twin(std::span<const TimedPlane> planes, const SmoothingOptions& options,
                         const Boundaries& boundaries, std::uint64_t seed) {
    const Extent extent = planes.front().cld.extent;
    SCOPED_TRACE(describe(extent, options, boundaries, seed));
    const auto expected = naive_smooth(planes, options, boundaries);
    const DensityGrid grid = smooth(planes, options, Placement{}, boundaries);
    const std::vector<float> dense = grid.to_dense();
    ASSERT_EQ(dense.size(), expected.size());
    std::uint64_t active = 0;
    for (std::size_t n = 0; n < expected.size(); ++n) {
        ASSERT_NEAR(dense[n], expected[n], expected[n] * 0x1p-22) << "at position " << n;
        if (expected[n] == 1) {
            ASSERT_EQ(dense[n], 1.0f) << "at position " << n;
        }
        active += expected[n] > 0;
    }
    EXPECT_EQ(grid.active_voxels(), active);
    EXPECT_EQ(grid.extent(), extent);
}

TEST(Smoothing, MatchesNaiveTwinForEveryKernelAndBoundary) {
    std::uint64_t seed = 1;
    for (SmoothingKernel kernel : kKernels) {
        for (int periodic = 0; periodic < 8; ++periodic) {
            for (const Extent extent :
                 {Extent{37, 19, 13}, Extent{70, 9, 5}, Extent{1, 1, 1}, Extent{5, 40, 3}}) {
                const BitPlane plane = random_plane(extent, 0.3, ++seed);
                const Boundaries boundaries{periodic & 1 ? kPeriodic : kOpen,
                                            periodic & 2 ? kPeriodic : kOpen,
                                            periodic & 4 ? kPeriodic : kOpen};
                const TimedPlane timed[] = {{plane.view(), 0}};
                expect_matches_twin(timed, {kernel, 2, 2, 1, 0}, boundaries, seed);
            }
        }
    }
}

TEST(Smoothing, MatchesNaiveTwinForRandomWindows) {
    std::mt19937_64 random(7);
    const auto draw = [&](int low, int high) {
        return std::uniform_int_distribution<int>(low, high)(random);
    };
    for (std::uint64_t seed = 100; seed < 160; ++seed) {
        const Extent extent{draw(1, 140), draw(1, 20), draw(1, 20)};
        SmoothingOptions options{kKernels[draw(0, 2)], draw(0, 4), draw(0, 4), draw(0, 3), draw(0, 2)};
        const auto boundary = [&] { return draw(0, 1) ? kPeriodic : kOpen; };
        const Boundaries boundaries{boundary(), boundary(), boundary()};
        std::vector<BitPlane> planes;
        std::vector<TimedPlane> timed;
        for (int t = -options.t0; t <= options.t0; ++t) {
            planes.push_back(random_plane(extent, draw(0, 4) * 0.25, seed * 10 + std::uint64_t(t + 2)));
        }
        for (int t = -options.t0; t <= options.t0; ++t) {
            if (t == 0 || draw(0, 3)) timed.push_back({planes[std::size_t(t + options.t0)].view(), t});
        }
        expect_matches_twin(timed, options, boundaries, seed);
    }
}

// Windows far wider than the box, where periodic axes meet themselves several times and sums need 64 bits.
TEST(Smoothing, MatchesNaiveTwinForLargestWindows) {
    for (SmoothingKernel kernel : kKernels) {
        for (Boundary boundary : {kOpen, kPeriodic}) {
            const Extent extent{7, 5, 3};
            const BitPlane plane = random_plane(extent, 0.5, 77);
            const TimedPlane timed[] = {{plane.view(), -16}, {plane.view(), 3}};
            expect_matches_twin(timed, {kernel, 16, 16, 16, 16}, {boundary, boundary, boundary}, 77);
        }
    }
}

// The tile grid: more than one tile in x and in y, blocks without any bit between, and bits in the last
// cells.
TEST(Smoothing, MatchesNaiveTwinAcrossTiles) {
    const Extent extent{203, 75, 26};
    BitPlane plane(extent);
    std::mt19937_64 random(5);
    for (int n = 0; n < 60; ++n) {
        plane.set(int(random() % 203), int(random() % 75), int(random() % 26), true);
    }
    plane.set(202, 74, 25, true);
    plane.set(0, 0, 0, true);
    plane.set(63, 31, 7, true);
    plane.set(64, 32, 8, true);
    for (SmoothingKernel kernel : kKernels) {
        for (Boundary boundary : {kOpen, kPeriodic}) {
            const TimedPlane timed[] = {{plane.view(), 0}};
            expect_matches_twin(timed, {kernel, 2, 2, 2, 0}, {boundary, boundary, boundary}, 5);
        }
    }
}

// All cells cloud: exactly 1 everywhere on a periodic box, and deep inside an open one, for every window.
TEST(Smoothing, SaturatedIsExactlyOne) {
    const Extent extent{41, 37, 38};
    const BitPlane plane = full_plane(extent);
    const TimedPlane one[] = {{plane.view(), 0}};
    const TimedPlane three[] = {{plane.view(), -1}, {plane.view(), 0}, {plane.view(), 1}};
    for (SmoothingKernel kernel : kKernels) {
        for (int radius : {0, 1, 2, 3, 5, 8, 11, 16}) {
            for (int variant = 0; variant < 3; ++variant) {
                const SmoothingOptions options{kernel, radius, variant == 1 ? 0 : radius,
                                               variant == 2 ? 1 : radius, 1};
                SCOPED_TRACE(describe(extent, options, {}, 0));
                const std::span<const TimedPlane> planes =
                    variant == 2 ? std::span<const TimedPlane>(three) : one;
                for (float q : smooth_dense(planes, options, {kPeriodic, kPeriodic, kPeriodic}))
                    ASSERT_EQ(q, 1.0f);
                const std::vector<float> dense = smooth_dense(planes, options, {});
                for (int k = options.k0; k < extent.z - options.k0; ++k) {
                    for (int j = options.j0; j < extent.y - options.j0; ++j) {
                        for (int i = options.i0; i < extent.x - options.i0; ++i) {
                            ASSERT_EQ(dense[linear_index(extent, i, j, k)], 1.0f)
                                << i << " " << j << " " << k;
                        }
                    }
                }
                if (radius > 0) {
                    ASSERT_LT(dense.front(), 1.0f);  // open: emptiness outside counts
                }
            }
        }
    }
}

// Closed form: one cell in a box window of 5x5x5 gives exactly 1/125 in its neighbourhood and 0 elsewhere.
TEST(Smoothing, SingleCellSpreadsOverItsWindow) {
    const Extent extent{20, 20, 20};
    BitPlane plane(extent);
    plane.set(10, 9, 8, true);
    const TimedPlane timed[] = {{plane.view(), 0}};
    const DensityGrid grid = smooth(timed, {SmoothingKernel::box, 2, 2, 2, 0}, Placement{}, {});
    EXPECT_EQ(grid.active_voxels(), 125u);
    EXPECT_EQ(grid.bounding_box(), (VoxelBox{{8, 7, 6}, {12, 11, 10}}));
    EXPECT_FLOAT_EQ(grid.value(12, 11, 10), 1.0f / 125.0f);
    EXPECT_EQ(grid.value(13, 9, 8), 0.0f);
    const DensityGrid tent = smooth(timed, {SmoothingKernel::tent, 2, 1, 0, 0}, Placement{}, {});
    EXPECT_EQ(tent.active_voxels(), 15u);
    EXPECT_FLOAT_EQ(tent.value(10, 9, 8), 3.0f * 2.0f / (9.0f * 4.0f));
    EXPECT_FLOAT_EQ(tent.value(12, 10, 8), 1.0f / 36.0f);
}

// A step that is not given has no weight: the mean of the others is taken.
TEST(Smoothing, MissingStepsHaveNoWeight) {
    const Extent extent{9, 9, 9};
    const BitPlane full = full_plane(extent), empty(extent);
    const SmoothingOptions options{SmoothingKernel::tent, 0, 0, 0, 2};
    const TimedPlane only_full[] = {{full.view(), 0}, {full.view(), 2}};
    EXPECT_EQ(smooth_dense(only_full, options, {})[0], 1.0f);
    const TimedPlane mixed[] = {{full.view(), 0}, {empty.view(), 2}};  // weights 3 and 1
    EXPECT_FLOAT_EQ(smooth_dense(mixed, options, {})[0], 0.75f);
}

TEST(Smoothing, DoesNotDependOnThreads) {
    const Extent extent{200, 130, 40};
    const BitPlane plane = random_plane(extent, 0.02, 3);
    const TimedPlane timed[] = {{plane.view(), 0}};
    const SmoothingOptions options{SmoothingKernel::tent, 2, 2, 1, 1};
    std::vector<std::vector<float>> results;
    for (std::size_t threads : {1, 2, 3, 7}) {
        results.push_back(
            test::with_threads(threads, [&] { return smooth(timed, options, Placement{}, {}).to_dense(); }));
    }
    for (const auto& result : results) EXPECT_EQ(result, results.front());
}

// Every instruction set that this machine has, and the portable form: bit for bit the same.
TEST(Smoothing, DoesNotDependOnTheInstructionSet) {
    const Extent extent{203, 41, 19};
    const BitPlane plane = random_plane(extent, 0.3, 13);
    const TimedPlane timed[] = {{plane.view(), 0}};
    const SmoothingOptions windows[] = {{SmoothingKernel::box, 2, 2, 2, 0},        // 8-bit sums
                                        {SmoothingKernel::tent, 2, 2, 1, 1},       // 16 bit
                                        {SmoothingKernel::gaussian, 2, 2, 2, 0},   // 32 bit
                                        {SmoothingKernel::gaussian, 5, 5, 5, 1}};  // double
    const std::int64_t supported = hwy::SupportedTargets();
    int targets = 0;
    std::vector<std::vector<float>> expected;
    for (std::int64_t target = HWY_SCALAR; target > 0; target >>= 1) {
        if ((target & (supported | HWY_SCALAR)) == 0) continue;
        hwy::SetSupportedTargetsForTest(target);
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
        for (std::size_t n = 0; n < std::size(windows); ++n) {
            const std::vector<float> dense = smooth_dense(timed, windows[n], {});
            if (expected.size() == n) expected.push_back(dense);
            EXPECT_EQ(dense, expected[n]) << hwy::TargetName(target) << " window " << n;
        }
        ++targets;
    }
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().DeInit();
    EXPECT_GE(targets, 1);
}

TEST(Smoothing, KernelWeightsAreAsDocumented) {
    EXPECT_EQ(kernel_weights(SmoothingKernel::box, 2), (std::vector<std::uint32_t>{1, 1, 1, 1, 1}));
    EXPECT_EQ(kernel_weights(SmoothingKernel::tent, 2), (std::vector<std::uint32_t>{1, 2, 3, 2, 1}));
    EXPECT_EQ(kernel_weights(SmoothingKernel::gaussian, 0), (std::vector<std::uint32_t>{64}));
    for (int radius = 1; radius <= 16; ++radius) {
        const auto weights = kernel_weights(SmoothingKernel::gaussian, radius);
        ASSERT_EQ(weights.size(), std::size_t(2 * radius + 1));
        for (int n = -radius; n <= radius; ++n) {
            const double x = n / ((radius + 0.5) / 2);
            EXPECT_EQ(weights[std::size_t(n + radius)],
                      std::uint32_t(std::lround(64 * std::exp(-x * x / 2))));
            EXPECT_GT(weights[std::size_t(n + radius)], 0u);
        }
    }
}

TEST(Smoothing, RejectsWhatMakesNoSense) {
    const BitPlane a(Extent{8, 8, 8}), b(Extent{8, 8, 9});
    const auto code_of = [&](std::span<const TimedPlane> planes, const SmoothingOptions& options) {
        try {
            (void)smooth(planes, options, Placement{}, {});
        } catch (const Error& error) {
            return int(error.code());
        }
        return 0;
    };
    const TimedPlane good[] = {{a.view(), 0}}, differ[] = {{a.view(), 0}, {b.view(), 1}};
    const TimedPlane twice[] = {{a.view(), 0}, {a.view(), 0}}, outside[] = {{a.view(), 2}};
    EXPECT_EQ(code_of(good, {}), 0);
    EXPECT_EQ(code_of({}, {}), int(ErrorCode::usage));
    EXPECT_EQ(code_of(differ, {}), int(ErrorCode::usage));
    EXPECT_EQ(code_of(twice, {}), int(ErrorCode::usage));
    EXPECT_EQ(code_of(outside, {}), int(ErrorCode::usage));
    EXPECT_EQ(code_of(good, {SmoothingKernel::box, 17, 1, 1, 1}), int(ErrorCode::usage));
    EXPECT_EQ(code_of(good, {SmoothingKernel::box, 1, 1, -1, 1}), int(ErrorCode::usage));
}

}  // namespace
}  // namespace nephos
