// SPDX-License-Identifier: Apache-2.0
#include "automaton/poisson.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>

namespace nephos {
namespace {

constexpr int kLowestOctave = -26;

}  // namespace

double event_rate(double p) {
    assert(p >= 0 && p <= kSparseLimit);
    const double z = p / (2 - p);  // <= 1/7
    const double z2 = z * z;
    double sum = 0;
    for (int n = 19; n >= 1; n -= 2) sum = sum * z2 + 1.0 / n;
    return 2 * z * sum;
}

PoissonTable make_poisson_table(double p) {
    PoissonTable table;
    table.p = p;
    const double rate = event_rate(p);
    table.rate = float(rate);
    if (p == 0) return table;

    const double mean = kBlockCells * rate;
    double probability = 1 - p;  // P(N = 0) = (1 - p)^512, by nine squarings
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
    assert(table.thresholds.size() < 256);
    for (std::size_t byte = 0; byte < table.start.size(); ++byte) {
        const auto lowest = std::uint32_t(byte << 24);
        table.start[byte] = std::uint8_t(std::ranges::upper_bound(table.thresholds, lowest) - table.thresholds.begin());
    }
    return table;
}

PoissonLadder::PoissonLadder() {
    for (int octave = kLowestOctave; octave < -2; ++octave) {
        for (double mantissa : {1.0, 1.25, 1.5, 1.75}) {
            tables_.push_back(make_poisson_table(std::ldexp(mantissa, octave)));
        }
    }
    tables_.push_back(make_poisson_table(kSparseLimit));
}

const PoissonTable& PoissonLadder::level(float p) const {
    assert(p <= float(kSparseLimit));
    // Exponent and two bits of mantissa, rounded up, are the number of the level.
    const int number = int((std::bit_cast<std::uint32_t>(p) + 0x1FFFFFu) >> 21) - ((127 + kLowestOctave) << 2);
    return tables_[std::size_t(std::max(number, 0))];
}

}  // namespace nephos
