// SPDX-License-Identifier: Apache-2.0
#pragma once

// Numbers of events for the sparse draw of a block (docs/adr/0002).
//
// Throwing N ~ Poisson(512 * h) events uniformly, with replacement, on the 512 cells of a block hits every cell
// independently with probability 1 - exp(-h). With h = -ln(1 - p_level) this is p_level exactly; an event on a
// cell with p <= p_level is accepted with probability ln(1-p) / ln(1-p_level), which thins it to exactly p.
//
// p_level comes from a ladder (4 levels an octave, 2^-26 to 1/4), so that the tables are made once.

#include <array>
#include <cstdint>
#include <vector>

namespace nephos {

inline constexpr int kBlockCells = 512;       // 8 x 8 x 8
inline constexpr double kSparseLimit = 0.25;  // above it the dense draw is used

// Distribution of the number of events at one level.
struct PoissonTable {
    double p = 0;                            // probability that a cell is hit, 0..kSparseLimit
    float rate = 0;                          // -ln(1 - p), events per cell
    std::vector<std::uint32_t> thresholds;   // thresholds[n] = floor(2^32 * P(N <= n)), rising

    std::array<std::uint8_t, 256> start{};   // number of thresholds <= the lowest word with that top byte

    // Number of events for a uniform 32-bit word: how many thresholds are <= word.
    int events(std::uint32_t word) const {
        std::size_t n = start[word >> 24];
        while (n < thresholds.size() && thresholds[n] <= word) ++n;
        return int(n);
    }
};

// Computed with additions, multiplications and divisions alone, hence the same on every machine.
// p must be in 0..kSparseLimit.
PoissonTable make_poisson_table(double p);

// -ln(1 - p) for 0 <= p <= kSparseLimit, by the series of 2 artanh(p / (2 - p)); relative error < 1e-16.
double event_rate(double p);

// The levels in rising order. Immutable; made on first use of each simulation.
class PoissonLadder {
  public:
    PoissonLadder();
    // The lowest level with table.p >= p; p must be in 0..kSparseLimit.
    const PoissonTable& level(float p) const;

  private:
    std::vector<PoissonTable> tables_;
};

}  // namespace nephos
