// SPDX-License-Identifier: Apache-2.0

// Gradient noise: equal to its naive twin, the same bits with every kind of vector and on every machine, and
// without the marks of its lattice: no direction, no place in a cell and no distance stands out.

#include "core/noise.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include "automaton/checkpoint.h"
#include "core/error.h"
#include "tests/reference/reference_noise.h"
#include "tests/reference/with_threads.h"

namespace nephos {
namespace {

struct Points {
    std::vector<float> x, y, z;
};

Points random_points(std::size_t count, double reach, std::uint32_t seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> at(float(-reach), float(reach));
    Points points;
    for (std::size_t n = 0; n < count; ++n) {
        points.x.push_back(at(random));
        points.y.push_back(at(random));
        points.z.push_back(at(random));
    }
    return points;
}

std::vector<float> noise_at(const Points& p, const NoiseOptions& options = {}) {
    std::vector<float> out(p.x.size());
    gradient_noise(p.x, p.y, p.z, options, out);
    return out;
}

std::string hash_text(const std::vector<float>& values) {
    return hash_of_bytes(std::as_bytes(std::span(values))).hex();
}

// A block of 24^3 points, 0.17 cells apart, over cells of both signs.
Points block() {
    Points points;
    for (int n = 0; n < 24 * 24 * 24; ++n) {
        points.x.push_back(float(n % 24 - 12) * 0.17f);
        points.y.push_back(float(n / 24 % 24 - 12) * 0.17f);
        points.z.push_back(float(n / 576 - 12) * 0.17f);
    }
    return points;
}

// Within a few roundings of sums of numbers below 1.
TEST(Noise, EqualsTheTwin) {
    const Points points = random_points(20'001, 100, 1);
    for (const NoiseOptions& options :
         {NoiseOptions{}, NoiseOptions{77, {5, 0, 12}}, NoiseOptions{1u << 31, {1, 2, 3}}}) {
        const std::vector<float> values = noise_at(points, options);
        double worst = 0;
        for (std::size_t n = 0; n < values.size(); ++n) {
            const double expected =
                test::reference_noise(double(points.x[n]), double(points.y[n]), double(points.z[n]),
                                      options.seed, options.period[0], options.period[1], options.period[2]);
            worst = std::max(worst, std::abs(double(values[n]) - expected));
        }
        EXPECT_LT(worst, 0x1p-20);
    }
}

// A golden hash: no bit may depend on compiler, flags, libraries or vectors.
TEST(Noise, HasTheSameBitsEverywhere) {
    const std::int64_t supported = hwy::SupportedTargets();
    const Points points = block(), few = random_points(37, 1000, 3);
    int targets = 0;
    for (std::int64_t target = HWY_SCALAR; target > 0; target >>= 1) {
        if ((target & (supported | HWY_SCALAR)) == 0) continue;
        hwy::SetSupportedTargetsForTest(target);
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
        EXPECT_EQ(hash_text(noise_at(points, {42, {}})), "3263763508508ac8f40fbc19b1693ad8")
            << hwy::TargetName(target);
        EXPECT_EQ(hash_text(noise_at(few, {7, {16, 9, 0}})), "11163bf3bd85b2a495e0a42cc814ced4")
            << hwy::TargetName(target);
        ++targets;
    }
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().DeInit();
    EXPECT_GE(targets, 1);
}

TEST(Noise, RepeatsAfterItsPeriodAndNotBefore) {
    const NoiseOptions options{9, {6, 10, 0}};
    const Points points = random_points(3000, 30, 4);
    const std::vector<float> values = noise_at(points, options);
    Points moved = points;
    for (float& x : moved.x) x += 6;
    for (float& y : moved.y) y -= 20;
    const std::vector<float> again = noise_at(moved, options);
    double difference = 0;
    for (std::size_t n = 0; n < values.size(); ++n) {
        EXPECT_NEAR(again[n], values[n], 2e-5);
        difference += std::abs(double(values[n]));
    }
    for (float& x : moved.x) x -= 3;
    const std::vector<float> other = noise_at(moved, options);
    double changed = 0;
    for (std::size_t n = 0; n < values.size(); ++n) changed += std::abs(double(other[n]) - double(values[n]));
    EXPECT_GT(changed, difference);
}

struct Moments {
    double mean = 0, deviation = 0, low = 1, high = -1;
};

Moments moments(const std::vector<float>& values) {
    Moments m;
    double sum = 0, squares = 0;
    for (const float v : values) {
        sum += double(v);
        squares += double(v) * double(v);
        m.low = std::min(m.low, double(v));
        m.high = std::max(m.high, double(v));
    }
    m.mean = sum / double(values.size());
    m.deviation = std::sqrt(squares / double(values.size()) - m.mean * m.mean);
    return m;
}

// 400,000 independent places: the mean's own deviation is 0.0003.
TEST(Noise, HasMeanZeroAndKeepsItsRange) {
    const Moments m = moments(noise_at(random_points(400'000, 1e4, 5)));
    EXPECT_NEAR(m.mean, 0, 0.0015);
    EXPECT_NEAR(m.deviation, 0.127, 0.005);
    EXPECT_GE(m.low, -1);
    EXPECT_LE(m.high, 1);
    EXPECT_LT(m.low, -0.4);
    EXPECT_GT(m.high, 0.4);
    Points whole;
    for (int n = 0; n < 1000; ++n) {
        whole.x.push_back(float(n % 10));
        whole.y.push_back(float(n / 10 % 10));
        whole.z.push_back(float(n / 100));
    }
    for (const float v : noise_at(whole)) EXPECT_EQ(v, 0);
}

// Mean square difference of values a distance apart along a direction.
double structure(const Points& points, const std::vector<float>& values, double dx, double dy, double dz) {
    Points moved = points;
    for (float& x : moved.x) x += float(dx);
    for (float& y : moved.y) y += float(dy);
    for (float& z : moved.z) z += float(dz);
    const std::vector<float> there = noise_at(moved);
    double sum = 0;
    for (std::size_t n = 0; n < values.size(); ++n) {
        const double d = double(there[n]) - double(values[n]);
        sum += d * d;
    }
    return sum / double(values.size());
}

// The structure function along axes and diagonals: a lattice shows as a difference between the two. Beyond
// two cells nothing is left of the correlation.
TEST(Noise, HasNoPreferredDirectionAndNoEchoes) {
    const Points points = random_points(150'000, 5000, 6);
    const std::vector<float> values = noise_at(points);
    const double r2 = std::sqrt(0.5), r3 = std::sqrt(1.0 / 3);
    for (const double r : {0.25, 0.5}) {
        const double x = structure(points, values, r, 0, 0), y = structure(points, values, 0, r, 0);
        const double z = structure(points, values, 0, 0, r);
        EXPECT_NEAR(y / x, 1, 0.03);
        EXPECT_NEAR(z / x, 1, 0.03);
        EXPECT_NEAR(structure(points, values, r * r2, -r * r2, 0) / x, 1, 0.12) << r;
        EXPECT_NEAR(structure(points, values, r * r3, r * r3, r * r3) / x, 1, 0.12) << r;
    }
    const double far = 2 * std::pow(moments(values).deviation, 2);
    for (const double r : {2.0, 3.0, 16.0, 64.0, 1024.0}) {
        EXPECT_NEAR(structure(points, values, r, 0, 0) / far, 1, 0.03) << r;
        EXPECT_NEAR(structure(points, values, r, r, 0) / far, 1, 0.03) << r;
        EXPECT_NEAR(structure(points, values, 0, r, -r) / far, 1, 0.03) << r;
    }
}

TEST(Noise, OfAnotherSeedIsAnother) {
    const Points points = random_points(50'000, 1000, 7);
    const std::vector<float> a = noise_at(points, {1, {}}), b = noise_at(points, {2, {}});
    double product = 0;
    for (std::size_t n = 0; n < a.size(); ++n) product += double(a[n]) * double(b[n]);
    EXPECT_LT(std::abs(product / double(a.size())), 0.001);  // variance: 0.016
}

TEST(NoiseVolume, TilesInAllDirections) {
    const NoiseVolumeOptions options{3, 24, 4, 2, 0.5};
    const std::vector<float> volume = noise_volume(options);
    const Extent extent{24, 24, 24};
    ASSERT_EQ(volume.size(), extent.cells());
    // The step across the seam is no larger than those within.
    const auto largest = [&](int from, int to, int axis) {
        double most = 0;
        for (int a = 0; a < 24; ++a) {
            for (int b = 0; b < 24; ++b) {
                const auto at = [&](int n) {
                    return axis == 0   ? linear_index(extent, n, a, b)
                           : axis == 1 ? linear_index(extent, a, n, b)
                                       : linear_index(extent, a, b, n);
                };
                most = std::max(most, std::abs(double(volume[at(from)]) - double(volume[at(to)])));
            }
        }
        return most;
    };
    for (int axis = 0; axis < 3; ++axis) {
        double within = 0;
        for (int n = 0; n + 1 < 24; ++n) within = std::max(within, largest(n, n + 1, axis));
        EXPECT_LE(largest(23, 0, axis), within) << axis;
    }
    const Moments m = moments(volume);
    EXPECT_NEAR(m.mean, 0.5, 0.01);
    EXPECT_NEAR(m.deviation, 0.2, 0.01);
    EXPECT_GE(m.low, 0);
    EXPECT_LE(m.high, 1);
}

TEST(NoiseVolume, DoesNotDependOnThreads) {
    const auto one = test::with_threads(1, [] { return noise_volume({}); });
    EXPECT_EQ(one, test::with_threads(5, [] { return noise_volume({}); }));
}

TEST(Noise, RefusesBadInput) {
    std::vector<float> a(3), b(2), out(3);
    EXPECT_THROW(gradient_noise(a, a, b, {}, out), Error);
    EXPECT_THROW(gradient_noise(a, a, a, {1, {-1, 0, 0}}, out), Error);
    EXPECT_THROW(gradient_noise(a, a, a, {1, {0, 0, (1 << 20) + 1}}, out), Error);
    a[1] = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW(gradient_noise(a, out, out, {}, out), Error);
    for (const NoiseVolumeOptions& bad :
         {NoiseVolumeOptions{1, 1}, NoiseVolumeOptions{1, 513}, NoiseVolumeOptions{1, 32, 17},
          NoiseVolumeOptions{1, 32, 4, 4}, NoiseVolumeOptions{1, 32, 4, 0},
          NoiseVolumeOptions{1, 32, 4, 2, 0}}) {
        EXPECT_THROW(noise_volume(bad), Error);
    }
}

}  // namespace
}  // namespace nephos
