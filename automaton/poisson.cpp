// SPDX-License-Identifier: Apache-2.0
#include "automaton/poisson.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>

namespace nephos {
namespace {

// exp(-x) for 0 <= x <= 1 by its series; the first term left out is below 1e-19.
double exp_minus(double x) {
    double sum = 1;
    for (int n = 20; n >= 1; --n) sum = 1 - sum * x / n;
    return sum;
}

}  // namespace

PoissonTable make_poisson_table(double rate) {
    assert(rate >= 0 && rate <= 1);
    PoissonTable table;
    table.rate = rate;

    const double mean = kBlockCells * rate;
    double probability = exp_minus(rate);  // P(N = 0) = exp(-rate)^512, by nine squarings
    for (int i = 0; i < 9; ++i) probability *= probability;
    double cumulative = 0;
    for (int n = 0; n < 2 * kBlockCells; ++n) {
        cumulative += probability;
        const double threshold = std::floor(cumulative * 0x1p32);
        if (threshold >= 0x1p32 - 1) break;  // what is left weighs less than 2^-32
        table.thresholds.push_back(std::uint32_t(threshold));
        if (n > mean && probability * 0x1p32 < 0.5) break;
        probability *= mean / (n + 1);
    }
    for (std::size_t byte = 0; byte < table.start.size(); ++byte) {
        const auto lowest = std::uint32_t(byte << 24);
        table.start[byte] =
            std::uint16_t(std::ranges::upper_bound(table.thresholds, lowest) - table.thresholds.begin());
    }
    return table;
}

PoissonLadder::PoissonLadder() {
    for (int octave = kLowestOctave; octave < 0; ++octave) {
        for (double mantissa : {1.0, 1.25, 1.5, 1.75}) {
            tables_.push_back(make_poisson_table(std::ldexp(mantissa, octave)));
        }
    }
    tables_.push_back(make_poisson_table(1));
    for (const PoissonTable& table : tables_) {
        rates_.push_back(float(table.rate));
        none_.push_back(table.thresholds.front());
    }
}

}  // namespace nephos
