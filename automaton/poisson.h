// SPDX-License-Identifier: Apache-2.0
#pragma once

// The number of events of a block's sparse draw (docs/adr/0002): a Poisson distribution by inversion.
//
// Throwing N ~ Poisson(512 * rate) events uniformly, with replacement, on n cells of a block gives every one of
// them independently a Poisson number of events of mean 512 rate / n: `rate` where they are all 512 cells.
// Keeping an event with probability r over that mean thins the cell to mean r: it is hit with probability
// 1 - exp(-r), which is p for r = -ln(1 - p).
//
// Rates come from a ladder, 4 an octave, so that the tables are made once.

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstdint>
#include <vector>

namespace nephos {

inline constexpr int kBlockCells = 512;  // 8 x 8 x 8

// Distribution of the number of events in a block at one rate.
struct PoissonTable {
    double rate = 0;                         // events per cell, 0..1
    std::vector<std::uint32_t> thresholds;   // thresholds[n] = floor(2^32 * P(N <= n)), rising
    std::array<std::uint16_t, 256> start{};  // number of thresholds <= the lowest word with that top byte

    // Returns the number of events for a uniform 32-bit word: the count of thresholds <= word.
    int events(std::uint32_t word) const {
        std::size_t n = start[word >> 24];
        while (n < thresholds.size() && thresholds[n] <= word) ++n;
        return int(n);
    }
};

// Computes the table of a rate in 0..1 with additions, multiplications and divisions alone, hence with the
// same bits on every machine.
PoissonTable make_poisson_table(double rate);

// Tables in rising order of their rates, 2^-28 to 1. Immutable.
class PoissonLadder {
  public:
    PoissonLadder();
    // Returns the number of the level with the lowest rate >= `rate`, which must be in 0..1.
    int number_of(float rate) const {
        assert(rate >= 0 && rate <= 1);
        // Exponent and two bits of mantissa, rounded up.
        const int number = int((std::bit_cast<std::uint32_t>(rate) + 0x1FFFFFu) >> 21) - ((127 + kLowestOctave) << 2);
        return std::max(number, 0);
    }
    const PoissonTable& level(float rate) const { return tables_[std::size_t(number_of(rate))]; }
    // Returns the rate of a level; every one is a float32.
    float rate(int number) const { return rates_[std::size_t(number)]; }
    // Returns the number of events of a level for a uniform 32-bit word. Most words of low levels have none: they read no table.
    int events(int number, std::uint32_t word) const {
        return word < none_[std::size_t(number)] ? 0 : tables_[std::size_t(number)].events(word);
    }

  private:
    static constexpr int kLowestOctave = -28;
    std::vector<PoissonTable> tables_;
    std::vector<float> rates_;         // of the tables
    std::vector<std::uint32_t> none_;  // their first thresholds
};

}  // namespace nephos
