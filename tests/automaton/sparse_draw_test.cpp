// SPDX-License-Identifier: Apache-2.0

// Rare draws beside frequent ones: a sparse birth belongs to each draw with its share of the level's rate,
// however small, in any order of the rates, and the cells of a lattice are hit as often. Extinctions of every rate, too.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>

#include <gtest/gtest.h>

#include "automaton/automaton.h"
#include "automaton/kernels.h"
#include "automaton/poisson.h"

namespace nephos {
namespace {

constexpr std::int64_t kValues = std::int64_t{1} << 53;  // of v

int draw_of_value(std::int64_t v, double level, const std::array<float, 2>& rates) {
    return sparse_birth(std::uint32_t(v & 0x3FFFFF) << 10, std::uint32_t(v >> 22) << 1, level, rates);
}

// How many values of v belong to draws below `draw`: they come first.
std::int64_t values_below(int draw, double level, const std::array<float, 2>& rates) {
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
        std::array<float, 2> rates{sparse_rate(float(0.12 / ratio)), sparse_rate(0.12f)};
        do {
            const double level = ladder.level((rates[0] + rates[1]) * 1.00001f).rate;
            std::int64_t below = 0;
            for (int draw = 0; draw < 2; ++draw) {
                const std::int64_t up_to = values_below(draw + 1, level, rates);
                const double rate = rates[std::size_t(draw)];
                EXPECT_NEAR(double(up_to - below) / double(kValues) * level, rate, 1e-6 * rate)
                    << "draw " << draw << ", ratio " << ratio;
                below = up_to;
            }
            EXPECT_EQ(draw_of_value(kValues - 1, level, rates), 2);
        } while (std::ranges::next_permutation(rates).found);
    }
}

TEST(SparseDraw, TakesNoBitOfTheCell) {
    const std::array<float, 2> rates{0.1f, 1e-9f};
    for (std::uint32_t second = 0; second < 0xFFF00000u; second += 0x10001u) {
        EXPECT_EQ(sparse_birth(0, second, 0.125, rates), sparse_birth(0x3FFu, second, 0.125, rates));
    }
}

// The share of the values of an extinction's v below a rate is the rate over the largest v: to 10^-6 of itself, down to a rate of
// 10^-9 of the largest. Values are counted as they are drawn, in order: by the second word, and where that ties by what the
// choice of a cell leaves of the first, which are the multiples of n in thin cloud (of one cell every other), and of 512 in thick cloud.
TEST(SparseExtinction, HasTheShareOfItsRate) {
    const PoissonLadder ladder;
    for (int cloud : {1, 3, 80, 127, 128, 512}) {
        const std::int64_t apart = cloud < kThickCloud ? std::max(cloud, 2) : 512, left = (std::int64_t{1} << 32) / apart;
        for (double ratio = 1; ratio < 2e9; ratio *= 10) {
            const float rate = sparse_rate(float(0.2 / ratio));
            const PoissonTable& level = ladder.level(extinction_rate(sparse_rate(0.2f) * 1.00001f, cloud));
            const float unit = extinction_unit(float(level.rate), cloud);
            const double largest = level.rate * (cloud < kThickCloud ? 512.0 / cloud : 1);
            std::int64_t low = 0, high = left << 31;
            while (low < high) {
                const std::int64_t middle = low + (high - low) / 2;
                if (sparse_extinction(std::uint32_t(middle % left * apart), std::uint32_t(middle / left) << 1, unit, rate)) {
                    low = middle + 1;
                } else {
                    high = middle;
                }
            }
            EXPECT_NEAR(double(low) / double(left << 31) * largest, rate, 1e-6 * rate) << cloud << " cells, ratio " << ratio;
        }
    }
}

// A draw whose rate is less than half a unit in the last place of a frequent one's, as often as its p says:
// 20 births are expected, and a Poisson count of that mean is below 3 or above 46 with a probability of
// 10^-6. The frequent draw is hum, whose rate is in the upper half of the level's, where float32 is coarsest.
TEST(Births, KeepARareDrawBesideAFrequentOne) {
    constexpr double kFrequent = 0.1, kRare = 3.7e-9, kExpected = 20;
    AutomatonOptions o{.extent = {512, 512, 64}, .seed = 20};
    o.field.background = {kFrequent, kRare, 0};
    const auto cells = double(o.extent.cells());
    const int steps = int(std::lround(kExpected / (kRare * cells)));
    std::size_t births = 0;
    for (int step = 0; step < steps; ++step) {
        // Starts from an empty lattice each time, so that no birth makes others.
        Automaton automaton(o, Lattice{BitPlane(o.extent), BitPlane(o.extent), BitPlane(o.extent)});
        automaton.step();
        const BitPlaneView act = automaton.act();
        for (std::size_t n = 0; n < act.word_count(); ++n) births += std::size_t(std::popcount(act.words[n]));
        ++o.seed;
    }
    EXPECT_GE(births, 3u) << "expected " << kExpected << " in " << steps << " steps";
    EXPECT_LE(births, 46u) << "expected " << kExpected << " in " << steps << " steps";
}

std::span<const std::uint64_t> words_of(BitPlaneView plane) { return {plane.words, plane.word_count()}; }

// Extinctions draw nothing that births see: with one seed, hum and act are the same whatever p_ext is, so that runs which
// differ in it have common random numbers. Winds of whole levels move the planes alike.
TEST(Births, AreTheSameForAnyExtinction) {
    AutomatonOptions o{.extent = {130, 70, 20}, .seed = 9};
    o.boundaries = {Boundary::periodic, Boundary::periodic, Boundary::open};
    Ellipsoid parcel;
    parcel.centre_m = {3000, 1500, 500};
    parcel.centre = {0.3, 0.02, 0.01};
    o.field.ellipsoids = {parcel};
    o.wind.keyframes = {{0, {{0, {11, -3}}, {1000, {17, 5}}}}};
    const auto run = [&](double ext) {
        o.field.background = {0.02, 0.001, ext};
        Automaton automaton(o);
        for (int step = 0; step < 30; ++step) automaton.step();
        return automaton;
    };
    const Automaton none = run(0);
    std::size_t cloud = 0;
    for (double ext : {0.01, 0.2, 0.9}) {
        const Automaton other = run(ext);
        EXPECT_TRUE(std::ranges::equal(words_of(none.hum()), words_of(other.hum()))) << ext;
        EXPECT_TRUE(std::ranges::equal(words_of(none.act()), words_of(other.act()))) << ext;
        EXPECT_FALSE(std::ranges::equal(words_of(none.cld()), words_of(other.cld()))) << ext;
        for (std::uint64_t word : words_of(other.cld())) cloud += std::size_t(std::popcount(word));
    }
    EXPECT_GT(cloud, 0u);
}

}  // namespace
}  // namespace nephos
