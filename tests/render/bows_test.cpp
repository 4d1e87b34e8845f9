// SPDX-License-Identifier: Apache-2.0

// The bows of raindrops and the halo of ice: where they are, in which order their colours stand, and how much light they have.

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include <gtest/gtest.h>

#include "render/options/halo_phase.h"
#include "render/rain/rainbow.h"

namespace nephos {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

// By the angle from the point opposite to the sun.
std::array<double, 3> bow_at(double degrees) { return rainbow().at(std::cos((180 - degrees) * kDegree)); }

template <class Phase>
double brightest(std::size_t colour, double low, double high, Phase&& phase) {
    double best = low;
    for (double at = low; at < high; at += 0.02)
        if (phase(at)[colour] > phase(best)[colour]) best = at;
    return best;
}

TEST(Rainbow, HasItsBowsWhereTheyAre) {
    const double red = brightest(0, 38, 46, bow_at), green = brightest(1, 38, 46, bow_at),
                 blue = brightest(2, 38, 46, bow_at);
    EXPECT_NEAR(red, 42.0, 0.4);
    EXPECT_NEAR(blue, 40.6, 0.5);
    EXPECT_GT(red, green + 0.2);
    EXPECT_GT(green, blue + 0.2);
    const double second_red = brightest(0, 48, 58, bow_at), second_blue = brightest(2, 48, 58, bow_at);
    EXPECT_NEAR(second_red, 50.9, 0.6);
    EXPECT_NEAR(second_blue, 53.3, 0.8);  // in reverse order
    // Alexander's band is dark, within the primary bow it is bright, and the secondary bow is the fainter.
    for (std::size_t c = 0; c < 3; ++c) {
        EXPECT_LT(bow_at(46)[c], 0.03 * bow_at(30)[c]);
        EXPECT_GT(bow_at(30)[c], 3 * bow_at(60)[c]);
    }
    EXPECT_LT(bow_at(second_red)[0], 0.4 * bow_at(red)[0]);
}

// The energy of rays that leave after one and two reflections: van de Hulst's table for drops of index 1.333 has about
// 4 and 1 % of what meets the drop.
TEST(Rainbow, HasItsShareOfTheLight) {
    EXPECT_NEAR(rainbow().share, 0.047, 0.006);
    double sum = 0;
    const int steps = 200'000;
    for (int i = 0; i < steps; ++i) sum += rainbow().at(-1 + 2 * (i + 0.5) / steps)[1];
    EXPECT_NEAR(sum * 2 / steps * 2, rainbow().share,
                0.1 * rainbow().share);  // 2 pi d(cos), of pi times the phase
}

std::array<double, 3> halo_at(double degrees) {
    static const HaloPhase phase;
    return phase.at(std::cos(degrees * kDegree));
}

TEST(Halo, BeginsAtTwentyTwoDegreesWithRed) {
    EXPECT_EQ(halo_at(20.5)[1], 0);
    const double red = brightest(0, 20, 30, halo_at), blue = brightest(2, 20, 30, halo_at);
    EXPECT_NEAR(red, 21.9, 0.4);
    EXPECT_GT(blue, red + 0.3);
    EXPECT_GT(halo_at(21.6)[0], 1);
    EXPECT_EQ(halo_at(21.6)[2], 0);
    EXPECT_LT(halo_at(30)[1], 0.4 * halo_at(22.5)[1]);
}

TEST(Halo, IntegratesToOne) {
    for (std::size_t c = 0; c < 3; ++c) {
        double sum = 0;
        const int steps = 20'000;
        for (int i = 0; i < steps; ++i) {
            const double angle = 20 + 30 * (i + 0.5) / steps;
            sum +=
                halo_at(angle)[c] * 2 * std::numbers::pi * std::sin(angle * kDegree) * 30 * kDegree / steps;
        }
        EXPECT_NEAR(sum, 1, 0.01);
    }
}

}  // namespace
}  // namespace nephos
