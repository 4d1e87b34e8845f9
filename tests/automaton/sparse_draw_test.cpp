// SPDX-License-Identifier: Apache-2.0

// Rare draws beside frequent ones: a sparse event belongs to each draw with its share of the level's rate,
// however small, in any order of the rates, and the cells of a lattice are hit as often.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <utility>

#include <gtest/gtest.h>

#include "automaton/automaton.h"
#include "automaton/kernels.h"
#include "automaton/poisson.h"

namespace nephos {
namespace {

constexpr std::int64_t kValues = std::int64_t{1} << 53;  // of v

int draw_of_value(std::int64_t v, double level, const std::array<float, 3>& rates) {
    return sparse_draw(std::uint32_t(v & 0x3FFFFF) << 10, std::uint32_t(v >> 22) << 1, level, rates);
}

// How many values of v belong to draws below `draw`: they come first.
std::int64_t values_below(int draw, double level, const std::array<float, 3>& rates) {
    std::int64_t low = 0, high = kValues;
    while (low < high) {
        const std::int64_t middle = low + (high - low) / 2;
        if (draw_of_value(middle, level, rates) < draw) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

// The share of all values of v, counted rather than sampled, is the draw's rate over the level's to 10^-6 of
// itself. Rates of a cell stand in ratios of 1 to 10^9, in each order.
TEST(SparseDraw, GivesEachDrawItsShareOfAllValues) {
    const PoissonLadder ladder;
    for (double ratio = 1; ratio < 2e9; ratio *= 10) {
        std::array<float, 3> rates{sparse_rate(float(0.12 / ratio)),
                                   sparse_rate(float(0.12 / std::sqrt(ratio))), sparse_rate(0.12f)};
        do {
            const double level = ladder.level((rates[0] + rates[1] + rates[2]) * 1.00001f).rate;
            std::int64_t below = 0;
            for (int draw = 0; draw < 3; ++draw) {
                const std::int64_t up_to = values_below(draw + 1, level, rates);
                const double rate = rates[std::size_t(draw)];
                EXPECT_NEAR(double(up_to - below) / double(kValues) * level, rate, 1e-6 * rate)
                    << "draw " << draw << ", ratio " << ratio;
                below = up_to;
            }
            EXPECT_EQ(draw_of_value(kValues - 1, level, rates), 3);
        } while (std::ranges::next_permutation(rates).found);
    }
}

TEST(SparseDraw, TakesNoBitOfTheCell) {
    const std::array<float, 3> rates{0.1f, 1e-9f, 0.02f};
    for (std::uint32_t second = 0; second < 0xFFF00000u; second += 0x10001u) {
        EXPECT_EQ(sparse_draw(0, second, 0.125, rates), sparse_draw(0x3FFu, second, 0.125, rates));
    }
}

// A draw whose rate is less than half a unit in the last place of a frequent one's, as often as its p says:
// 20 deaths are expected, and a Poisson count of that mean is below 3 or above 46 with a probability of
// 10^-6. The frequent draw is hum, whose rate is in the upper half of the level's, where float32 is coarsest.
TEST(Births, KeepARareDrawBesideAFrequentOne) {
    constexpr double kFrequent = 0.1, kRare = 3.7e-9, kExpected = 20;
    AutomatonOptions o{.extent = {512, 512, 64}, .seed = 20};
    o.field.background = {kFrequent, 0, kRare};
    Lattice start{BitPlane(o.extent), BitPlane(o.extent), BitPlane(o.extent)};
    std::ranges::fill(start.cld.words(), ~std::uint64_t{0});
    const auto cells = double(o.extent.cells());
    Automaton automaton(o, std::move(start));
    const int steps = int(std::lround(kExpected / (kRare * cells)));
    for (int step = 0; step < steps; ++step) automaton.step();
    const BitPlaneView cld = automaton.cld();
    std::size_t deaths = o.extent.cells();
    for (std::size_t n = 0; n < cld.word_count(); ++n) deaths -= std::size_t(std::popcount(cld.words[n]));
    EXPECT_GE(deaths, 3u) << "expected " << kExpected << " in " << steps << " steps";
    EXPECT_LE(deaths, 46u) << "expected " << kExpected << " in " << steps << " steps";
}

}  // namespace
}  // namespace nephos
