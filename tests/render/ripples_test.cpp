// SPDX-License-Identifier: Apache-2.0

// The surface of puddles against what is known of the wave equation: standing waves, energy, memory.

#include "render/ground/ripples.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <gtest/gtest.h>

namespace nephos {
namespace {

constexpr double kPi = std::numbers::pi;

std::size_t at(int column, int row) { return std::size_t(row) * kRippleTexels + std::size_t(column); }

// cos(k x) cos(l y) is an eigenfunction of the equation and of the nine-point Laplacian alike: its height
// swings as exp(-d t) cos(v |k| t).
TEST(RipplesTest, AStandingWaveSwingsAsItShould) {
    constexpr int kAcross = 6, kUp = 4;  // waves on the square
    const double k = 2 * kPi * kAcross / kRippleSize_m, l = 2 * kPi * kUp / kRippleSize_m;
    const double frequency = kRippleSpeed_m_per_s * std::hypot(k, l);
    const auto swing = [&](double t) {
        return std::exp(-kRippleDamping_per_s * t) * std::cos(frequency * t);
    };
    Ripples ripples = still_water();
    for (int row = 0; row < kRippleTexels; ++row) {
        for (int column = 0; column < kRippleTexels; ++column) {
            const double shape = std::cos(2 * kPi * kAcross * column / kRippleTexels) *
                                 std::cos(2 * kPi * kUp * row / kRippleTexels);
            ripples.before[at(column, row)] = float(1e-3 * shape * swing(0));
            ripples.now[at(column, row)] = float(1e-3 * shape * swing(kRippleStep_s));
        }
    }
    double worst = 0;
    for (int n = 2; n <= 60; ++n) {
        step(ripples);
        worst = std::max(worst, std::abs(ripples.now[0] - 1e-3 * swing(n * kRippleStep_s)));
        EXPECT_NEAR(ripples.now[at(kRippleTexels / 2, 0)], ripples.now[0], 1e-8) << "it stands";
    }
    EXPECT_LT(worst, 3e-5) << "3 % of its height";
}

// A ring is as far along the diagonal as along the axes.
TEST(RipplesTest, RingsAreRound) {
    Ripples ripples = still_water();
    for (int row = 0; row < kRippleTexels; ++row)
        for (int column = 0; column < kRippleTexels; ++column) {
            const double r2 = std::pow(column - 64, 2) + std::pow(row - 64, 2);
            ripples.now[at(column, row)] = float(std::exp(-r2 / 8));
        }
    ripples.before = ripples.now;
    for (int n = 0; n < 60; ++n) step(ripples);
    const auto crest = [&](int up, double step) {  // distance and height of the highest point outwards
        double highest = 0, distance = 0;
        for (int i = 4; i < 60; ++i) {
            const double z = ripples.now[at(64 + i, 64 + up * i)];
            if (z > highest) highest = z, distance = i * step;
        }
        return std::pair(distance, highest);
    };
    const auto straight = crest(0, 1), diagonal = crest(1, std::sqrt(2.0));
    const double radius = 60 * kRippleSpeed_m_per_s * kRippleStep_s * kRippleTexels / kRippleSize_m;
    EXPECT_NEAR(straight.first, radius, 3);
    EXPECT_NEAR(straight.first, diagonal.first, 1.5);
    EXPECT_NEAR(straight.second, diagonal.second, 0.1 * straight.second);
}

// The discrete energy of the head of ripples.h, per area of a texel and unit mass.
double energy(const Ripples& ripples) {
    constexpr int kSide = kRippleTexels;
    const auto old = [&](int i, int j) {
        return double(ripples.before[at((i + kSide) % kSide, (j + kSide) % kSide)]);
    };
    const double grown = std::exp(kRippleDamping_per_s * kRippleStep_s);
    double moving = 0, bent = 0;
    for (int j = 0; j < kSide; ++j) {
        for (int i = 0; i < kSide; ++i) {
            const double now = grown * double(ripples.now[at(i, j)]), change = now - old(i, j);
            const double beside = old(i - 1, j) + old(i + 1, j) + old(i, j - 1) + old(i, j + 1);
            const double corners =
                old(i - 1, j - 1) + old(i + 1, j - 1) + old(i - 1, j + 1) + old(i + 1, j + 1);
            moving += change * change;
            bent -= (4 * beside + corners - 20 * old(i, j)) / 6 * now;
        }
    }
    const double per_texel = kRippleSpeed_m_per_s * kSide / kRippleSize_m;
    return 0.5 * (moving / (kRippleStep_s * kRippleStep_s) + per_texel * per_texel * bent);
}

// Whatever a frame's time: between frames of any length the energy only falls once no drop falls any more.
TEST(RipplesTest, EnergyNeverGrowsForAnyFrameTime) {
    for (const double frame_s : {1e-4, 3e-3, 0.02, 0.05, 0.7, 10.0}) {
        Ripples ripples = ripples_at(5.0, 30);
        double last = energy(ripples);
        ASSERT_GT(last, 0);
        std::int64_t done = 0;
        for (int frame = 1; frame <= 200; ++frame) {
            const auto due = std::int64_t(std::floor(frame * frame_s / kRippleStep_s));
            for (; done < std::min<std::int64_t>(due, 600); ++done) {
                step(ripples);
                const double now = energy(ripples);
                ASSERT_LE(now, last * (1 + 1e-6)) << frame_s << ' ' << done;
                ASSERT_GE(now, -1e-12);
                last = now;
            }
        }
    }
}

TEST(RipplesTest, HeavyRainStaysBounded) {
    double highest = 0;
    for (const double time_s : {0.0, 1e-4, 10.0, 1234.567, 1e6}) {
        const Ripples ripples = ripples_at(time_s, 100);
        for (const float z : ripples.now) highest = std::max(highest, std::abs(double(z)));
    }
    EXPECT_GT(highest, 1e-4);
    EXPECT_LT(highest, 0.05);
}

// What happened before its memory cannot be told any more.
TEST(RipplesTest, ALongerHistoryChangesNothingButRounding) {
    const Ripples usual = ripples_at(100.37, 12);
    const Ripples longer = ripples_at(100.37, 12, 3 * kRippleMemory_s);
    double highest = 0;
    for (const float z : usual.now) highest = std::max(highest, std::abs(double(z)));
    ASSERT_GT(highest, 1e-4);
    for (std::size_t i = 0; i < usual.now.size(); ++i)
        ASSERT_NEAR(usual.now[i], longer.now[i], 3e-6 * highest) << i;
}

TEST(RipplesTest, SlopesAreAFunctionOfTimeAndRain) {
    const RippleSlopes slopes = ripple_slopes(41.234, 10);
    EXPECT_EQ(slopes.x, ripple_slopes(41.234, 10).x);
    EXPECT_NE(slopes.x, ripple_slopes(41.236, 10).x) << "moves within a step";
    EXPECT_EQ(ripple_slopes(41.234, 0).variance, 0);
    const double rms = std::sqrt(slopes.variance);
    EXPECT_GT(rms, 0.02) << "can be seen";
    EXPECT_LT(rms, 0.2) << "is water, not a saw";
    EXPECT_LT(ripple_slopes(41.234, 1).variance, slopes.variance);
    EXPECT_GT(ripple_slopes(41.234, 60).variance, slopes.variance);
}

}  // namespace
}  // namespace nephos
