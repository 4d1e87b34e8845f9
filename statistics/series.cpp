// SPDX-License-Identifier: Apache-2.0
#include "statistics/series.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

namespace nephos {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kBatch = 5;    // MSER-5
constexpr double kLeastPulse = 0.3;  // of the second maximum
constexpr double kLeastRise = 0.2;   // of it above the minimum before
constexpr std::size_t kLeastPeriods = 20;
constexpr double kLeastTimes = 20;  // upper bounds of tau in a steady series
// The same of whole periods: 10 take a third more steps, and cover the truth of swelling() in series_test.cpp no better.
constexpr double kLeastPulseTimes = 7;
constexpr double kForgotten = 2;       // tau of strengths in the warm-up
constexpr double kLargestShare = 0.5;  // of the values, in the window of lags
constexpr double kHalves = 3;          // standard errors between two halves
constexpr double kSparse = 0.01, kOvercast = 0.95;

double mean_of(std::span<const double> values) {
    return std::accumulate(values.begin(), values.end(), 0.0) / double(values.size());
}

double variance_of(std::span<const double> values) {
    const double mean = mean_of(values);
    double sum = 0;
    for (const double value : values) sum += (value - mean) * (value - mean);
    return values.size() > 1 ? sum / double(values.size() - 1) : 0;
}

std::vector<double> batch_means(std::span<const double> values, std::size_t batch) {
    std::vector<double> means;
    for (std::size_t n = 0; n + batch <= values.size(); n += batch)
        means.push_back(mean_of(values.subspan(n, batch)));
    return means;
}

// Mean and variance of the values within one period after the other.
struct Periods {
    std::vector<double> means, strengths;

    void drop_first(std::size_t count) {
        means.erase(means.begin(), means.begin() + std::ptrdiff_t(count));
        strengths.erase(strengths.begin(), strengths.begin() + std::ptrdiff_t(count));
    }
};

// Of the values at the steps first, first + stride, ... of a series that begins at `begin`: where the period is no multiple of
// the stride, some have a value more than others.
Periods periods_of(std::span<const double> values, std::size_t first, std::size_t begin, std::size_t period,
                   std::size_t stride) {
    Periods periods;
    std::size_t at = 0;
    for (std::size_t end = begin + period; at < values.size(); end += period) {
        const std::size_t start = at;
        while (at < values.size() && first + at * stride < end) ++at;
        if (at == start) continue;
        periods.means.push_back(mean_of(values.subspan(start, at - start)));
        periods.strengths.push_back(variance_of(values.subspan(start, at - start)));
    }
    return periods;
}

// The first maximum of rho that rises far enough above the lowest value before it: lag and height; lag 0 if none.
struct Pulse {
    std::size_t lag = 0;
    double height = 0;
};

Pulse second_maximum(std::span<const double> rho) {
    // The highest value that follows the first descent to a minimum: neighbouring bumps of noise do not end the search
    // before rho falls again by the least rise.
    double lowest = 1;
    Pulse best;
    for (std::size_t lag = 1; lag < rho.size(); ++lag) {
        if (best.lag == 0 || rho[lag] > best.height) {
            if (rho[lag] > kLeastPulse && rho[lag] > lowest + kLeastRise) best = {lag, rho[lag]};
        }
        if (best.lag != 0 && rho[lag] < best.height - kLeastRise) return best;
        if (best.lag == 0) lowest = std::min(lowest, rho[lag]);
    }
    // A rise that goes on to the last lag has no maximum yet.
    return {};
}

// The deviations of a series from its mean, for its autocorrelation. Lags are summed up several at a time, each in the order
// of the series: the sums are those of one after the other, bit for bit.
class Deviations {
  public:
    explicit Deviations(std::span<const double> series)
        : size_(series.size()), values_(series.size() + kTogether, 0.0) {
        if (series.empty()) return;
        const double mean = mean_of(series);
        for (std::size_t n = 0; n < size_; ++n) {
            values_[n] = series[n] - mean;
            variance_ += values_[n] * values_[n];
        }
        // A constant has deviations of rounding alone.
        constant_ = variance_ <= 1e-24 * std::max(1.0, mean * mean) * double(size_);
    }
    bool are_constant() const { return constant_; }

    // Sets rho[first], rho[first + 1] ...; precondition: rho.size() <= size of the series.
    void fill(std::span<double> rho, std::size_t first) const {
        for (std::size_t lag = first; lag < rho.size(); lag += kTogether) {
            // Behind the series are zeros: what they add changes no sum.
            std::array<double, kTogether> sums{};
            for (std::size_t n = 0; n + lag < size_; ++n)
                for (std::size_t one = 0; one < kTogether; ++one)
                    sums[one] += values_[n] * values_[n + lag + one];
            for (std::size_t one = 0; one < std::min(kTogether, rho.size() - lag); ++one)
                rho[lag + one] = sums[one] / variance_;
        }
    }
    static constexpr std::size_t kTogether = 16;

  private:
    std::size_t size_;
    std::vector<double> values_;
    double variance_ = 0;
    bool constant_ = true;
};

// The first lag of the first pair that is not positive: there integrated_time() ends, whatever follows.
std::size_t end_of_pairs(std::span<const double> rho) {
    std::size_t lag = 0;
    while (lag + 1 < rho.size() && rho[lag] + rho[lag + 1] > 0) lag += 2;
    return lag;
}

// rho of at most as many lags as half of the values. Lags beyond the end of pairs do not count, and are not computed.
std::vector<double> counted_lags(std::span<const double> values) {
    const Deviations deviations(values);
    std::vector<double> rho(values.size() / 2 + 1, 0.0);
    rho[0] = 1;
    if (deviations.are_constant()) return rho;
    for (std::size_t known = 1; known < rho.size();) {
        const std::size_t next = std::min(rho.size(), known + Deviations::kTogether);
        deviations.fill(std::span(rho).first(next), known);
        known = next;
        if (end_of_pairs(std::span(rho).first(known)) + 1 < known) break;
    }
    return rho;
}

struct Memory {
    double time = 1;   // tau, in values
    double bound = 1;  // larger by its standard error
};

// Geyer's sum is too small, for the deviations are from a mean that follows the values: each of its 2 W + 1 lags of both signs
// lacks variance tau / size (Wolff, Comput. Phys. Commun. 156, 2004). The standard error of tau is
// tau sqrt(2 (2 W + 1) / size) (Madras and Sokal, J. Stat. Phys. 50, 1988).
Memory memory_of(std::span<const double> rho, std::size_t size) {
    const double last = std::max(1.0, double(end_of_pairs(rho))) - 1;  // W
    const double share = std::min((2 * last + 1) / double(size), kLargestShare);
    const double time = integrated_time(rho) / (1 - share);
    return {time, time * (1 + std::sqrt(2 * share))};
}

Memory memory_of(std::span<const double> values) { return memory_of(counted_lags(values), values.size()); }

// Upper bound of tau of pulses, in periods. It is at least that of their strengths, which the means follow: below the noise of
// single periods a long memory of the means alone is hardly seen.
double bound_of(const Periods& periods) {
    return std::max(memory_of(periods.means).bound, memory_of(periods.strengths).bound);
}

double error_of(std::span<const double> values, double tau) {
    return std::sqrt(variance_of(values) * tau / double(values.size()));
}

bool halves_agree(std::span<const double> values, double error_of_mean) {
    const std::size_t half = values.size() / 2;
    const double difference = mean_of(values.first(half)) - mean_of(values.last(half));
    // Each half has an error sqrt(2) larger than the whole, their difference one twice as large.
    return std::abs(difference) <= kHalves * 2 * error_of_mean + 1e-12;
}

// Pulses whose level and strength have both settled, seen long enough to tell.
bool are_steady(const Periods& periods) {
    const double size = double(periods.means.size());
    if (periods.means.size() < kLeastPeriods || size < kLeastPulseTimes * bound_of(periods)) return false;
    const double strengths_tau = memory_of(periods.strengths).time;
    return halves_agree(periods.means, error_of(periods.means, bound_of(periods))) &&
           halves_agree(periods.strengths, error_of(periods.strengths, strengths_tau));
}

// Judges a series that oscillates. The first pulses after a start are not like the others: a common start fires all cells at
// once, and they fall out of step over many periods. They have forgotten the strength that they start with after twice tau, by
// when an exponential memory, tau / 2 long, has fallen to 2 %. A cut where the error is least, as MSER-5, would choose by chance
// the end at which pulses are weak, and a mean of that end alone is biased.
void judge_pulses(std::span<const double> cover, std::size_t period, Judgement& result) {
    result.period = period;
    result.warm_up = 2 * period;
    if (result.warm_up >= cover.size()) return;
    const std::size_t count = (cover.size() - result.warm_up) / period;
    Periods periods = periods_of(cover.subspan(result.warm_up, count * period), 0, 0, period, 1);
    const std::size_t forgotten = std::size_t(std::ceil(kForgotten * memory_of(periods.strengths).time));
    const std::size_t cut = std::min(forgotten, count / 2);
    result.warm_up += cut * period;
    result.used = (count - cut) * period;
    periods.drop_first(cut);
    // With a warm-up above half the series it still drifts where it ends.
    if (result.warm_up <= cover.size() / 2 && are_steady(periods)) result.regime = Regime::pulsing;
}

bool is_dead(std::span<const double> cover, bool can_revive) {
    if (cover.empty() || cover.back() != 0) return false;
    if (!can_revive) return true;
    const std::size_t half = cover.size() / 2;
    return cover.size() >= 100 && std::ranges::all_of(cover.last(half), [](double c) { return c == 0; });
}

Regime regime_of_level(double mean, Regime otherwise) {
    if (mean < kSparse) return Regime::sparse;
    return mean > kOvercast ? Regime::overcast : otherwise;
}

}  // namespace

std::string_view regime_name(Regime regime) {
    constexpr std::array<std::string_view, 6> kNames{"dead",    "sparse",   "steady",
                                                     "pulsing", "overcast", "not_steady"};
    return kNames.at(std::size_t(regime));
}

std::vector<double> autocorrelation(std::span<const double> series, std::size_t lags) {
    std::vector<double> rho(lags + 1, 0.0);
    rho[0] = 1;
    const Deviations deviations(series);
    if (deviations.are_constant()) return rho;
    deviations.fill(std::span(rho).first(std::min(lags + 1, series.size())), 1);
    return rho;
}

double integrated_time(std::span<const double> rho) {
    // The first pair is rho(0) + rho(1); the sum over all lags of both signs is twice that of the pairs, less rho(0).
    double sum = 0;
    const std::size_t end = end_of_pairs(rho);
    for (std::size_t lag = 0; lag < end; lag += 2) sum += rho[lag] + rho[lag + 1];
    return std::max(1.0, 2 * sum - 1);
}

std::size_t mser_5(std::span<const double> series) {
    const std::vector<double> batches = batch_means(series, kBatch);
    const std::size_t most = batches.size() / 2;
    // Sums from the end: of what is left after a cut.
    double sum = 0, squares = 0, best = std::numeric_limits<double>::infinity();
    std::size_t cut = 0;
    const double centre = batches.empty() ? 0 : batches.back();
    for (std::size_t n = batches.size(); n-- > 0;) {
        const double value = batches[n] - centre, count = double(batches.size() - n);
        sum += value;
        squares += value * value;
        if (n > most) continue;
        const double error = std::max(0.0, squares - sum * sum / count) / (count * count);
        if (error <= best) {
            best = error;
            cut = n;
        }
    }
    return cut * kBatch;
}

Judgement judge(std::span<const double> cover, bool can_revive) {
    Judgement result;
    if (is_dead(cover, can_revive)) {
        result.regime = Regime::dead;
        // From the first step on after which there is no cloud any more.
        result.warm_up = cover.size();
        while (result.warm_up > 0 && cover[result.warm_up - 1] == 0) --result.warm_up;
        result.used = cover.size() - result.warm_up;
        return result;
    }
    if (cover.size() < 4 * kBatch) return result;
    result.warm_up = mser_5(cover);
    // A cut at its limit says that the series still drifts where it ends.
    const bool at_limit = result.warm_up / kBatch == cover.size() / kBatch / 2;
    const std::span<const double> left = cover.subspan(result.warm_up);
    const std::vector<double> rho = autocorrelation(left, left.size() / 2);
    const Pulse pulse = second_maximum(rho);
    if (pulse.lag > 0) {
        result.pulse = pulse.height;
        judge_pulses(cover, pulse.lag, result);
        return result;
    }
    result.used = left.size();
    const double tau = memory_of(rho, left.size()).bound;
    if (at_limit || double(left.size()) < kLeastTimes * tau || !halves_agree(left, error_of(left, tau)))
        return result;
    result.regime = regime_of_level(mean_of(left), Regime::steady);
    return result;
}

SeriesMean mean_over(std::span<const double> series, const Judgement& judgement, std::size_t stride) {
    const SeriesMean none{kNaN, kNaN, kNaN, kNaN, kNaN};
    if (judgement.regime == Regime::not_steady || judgement.used == 0) return none;
    // Values at the steps from warm_up on, before warm_up + used.
    const std::size_t first = (judgement.warm_up + stride - 1) / stride;
    const std::size_t last =
        std::min(series.size(), (judgement.warm_up + judgement.used + stride - 1) / stride);
    if (first >= last) return none;
    const std::span<const double> values = series.subspan(first, last - first);
    if (std::ranges::any_of(values, [](double value) { return std::isnan(value); })) return none;
    SeriesMean result{mean_of(values), 0, std::sqrt(variance_of(values)), 1, double(values.size())};
    // Batches are whole periods, for within one the values follow the pulse.
    if (judgement.regime == Regime::pulsing && judgement.period >= 2 * stride &&
        judgement.used >= 2 * judgement.period) {
        const Periods periods =
            periods_of(values, first * stride, judgement.warm_up, judgement.period, stride);
        result.error = error_of(periods.means, bound_of(periods));
        if (result.error > 0) {
            result.effective = result.deviation * result.deviation / (result.error * result.error);
            result.tau = double(values.size()) / result.effective * double(stride);
        }
        return result;
    }
    const Memory memory = memory_of(values);
    result.tau = memory.time * double(stride);
    result.effective = double(values.size()) / memory.time;
    result.error = error_of(values, memory.bound);
    return result;
}

}  // namespace nephos
