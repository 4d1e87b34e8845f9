// SPDX-License-Identifier: Apache-2.0
#include "statistics/cloud_sizes.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <vector>

namespace nephos {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr std::uint64_t kLeastInBin = 24;
constexpr std::uint64_t kLeastInRange = 24;
constexpr double kFar = 1e-7;  // of two exponents

// Sums over a = first .. last of a^-t, of a^-t log a and of a^-t log^2 a: exact up to 1,024, beyond that by the
// Euler-Maclaurin formula to its first correction, which is exact to 1e-9 there.
struct Sums {
    double zeroth = 0, first = 0, second = 0;
    double mean() const { return first / zeroth; }
};

// The terms of these sums for one range; their logarithms do not depend on t.
class PowerSums {
  public:
    explicit PowerSums(const SizeRange& range) {
        constexpr std::uint64_t kExact = 1024;
        const std::uint64_t end = std::min(range.last, std::max(range.first, kExact));
        for (std::uint64_t a = range.first; a <= end; ++a) add_term(double(a), 1);
        // Simpson's rule in log a over what is left, from end + 1/2 to last + 1/2 (the midpoint rule turned round).
        if (range.last <= end) return;
        const double from = std::log(double(end) + 0.5), to = std::log(double(range.last) + 0.5);
        constexpr int kPieces = 256;
        for (int n = 0; n <= kPieces; ++n) {
            const double a = std::exp(from + (to - from) * n / kPieces);
            const double weight = n == 0 || n == kPieces ? 1 : n % 2 == 1 ? 4 : 2;
            add_term(a, weight * a * (to - from) / kPieces / 3);
        }
    }

    Sums at(double t) const {
        Sums sums;
        for (const Term& term : terms_) {
            const double value = term.weight * std::exp(-t * term.log_a);
            sums.zeroth += value;
            sums.first += value * term.log_a;
            sums.second += value * term.log_a * term.log_a;
        }
        return sums;
    }

  private:
    struct Term {
        double log_a, weight;
    };
    void add_term(double a, double weight) { terms_.push_back({std::log(a), weight}); }
    std::vector<Term> terms_;
};

// Returns about the t whose mean logarithm is the observed one, by Newton's method: the derivative of the mean is minus the
// variance. NaN where it is not within the bisection's range.
double near_root(const PowerSums& power, double observed) {
    double t = 2;
    for (int n = 0; n < 30 && t > -20 && t < 40; ++n) {
        const Sums sums = power.at(t);
        const double mean = sums.mean(), variance = sums.second / sums.zeroth - mean * mean;
        const double step = std::clamp((mean - observed) / variance, -3.0, 3.0);
        t += step;
        if (std::abs(step) < kFar / 100) return t;
    }
    return kNaN;
}

}  // namespace

int size_bin(std::uint64_t area) {
    if (area == 0) return 0;
    const int octave = std::bit_width(area) - 1;
    if (2 * octave + 1 >= kSizeBins) return kSizeBins - 1;
    return 2 * octave + int(area >= size_bin_begin(2 * octave + 1));
}

std::uint64_t size_bin_begin(int bin) {
    const std::uint64_t power = std::uint64_t(1) << (bin / 2);
    return bin % 2 == 0 ? power : std::uint64_t(std::ceil(double(power) * 1.4142135623730951));
}

SizeRange default_size_range(const Extent& extent) {
    const double side = 0.2 * std::min(extent.x, extent.y);
    return {36, std::uint64_t(side * side)};
}

void CloudSizes::add(std::span<const ConnectedCloud> clouds) {
    for (const ConnectedCloud& cloud : clouds) {
        ++clouds_;
        area_ += cloud.cells;
        const std::size_t bin = std::size_t(size_bin(cloud.cells));
        ++counts_[bin];
        if (cloud.cut) ++cut_[bin];
        if (cloud.cut || cloud.cells < range_.first || cloud.cells > range_.last) continue;
        const double a = std::log(double(cloud.cells)), p = std::log(double(cloud.edges));
        ++in_range_;
        log_area_ += a;
        log_edges_ += p;
        log_area_2_ += a * a;
        log_product_ += a * p;
        log_edges_2_ += p * p;
    }
}

void CloudSizes::add(const CloudSizes& other) {
    clouds_ += other.clouds_;
    area_ += other.area_;
    for (std::size_t n = 0; n < counts_.size(); ++n) {
        counts_[n] += other.counts_[n];
        cut_[n] += other.cut_[n];
    }
    in_range_ += other.in_range_;
    log_area_ += other.log_area_;
    log_edges_ += other.log_edges_;
    log_area_2_ += other.log_area_2_;
    log_product_ += other.log_product_;
    log_edges_2_ += other.log_edges_2_;
}

Estimate CloudSizes::line_exponent() const {
    double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
    for (int bin = 0; bin + 1 < kSizeBins; ++bin) {
        const std::uint64_t begin = size_bin_begin(bin), end = size_bin_begin(bin + 1),
                            all = this->count(bin), cut = count_cut(bin), count = all - cut;
        if (begin < range_.first || end > range_.last + 1 || begin == end || count < kLeastInBin) continue;
        if (2 * cut > all) continue;
        const double u = (std::log(double(begin)) + std::log(double(end))) / 2;
        const double v = std::log(double(count) / double(end - begin));
        n += 1;
        x += u;
        y += v;
        xx += u * u;
        xy += u * v;
        yy += v * v;
    }
    if (n < 3) return {kNaN, kNaN};
    const double sxx = xx - x * x / n, sxy = xy - x * y / n, syy = yy - y * y / n, slope = sxy / sxx;
    return {-slope, std::sqrt(std::max(0.0, syy - slope * sxy) / (n - 2) / sxx)};
}

Estimate CloudSizes::likelihood_exponent() const {
    if (in_range_ < kLeastInRange || range_.last <= range_.first) return {kNaN, kNaN};
    // The mean logarithm falls as t rises: bisection of mean(t) = the observed one.
    const double observed = log_area_ / double(in_range_);
    const PowerSums sums(range_);
    const double near = near_root(sums, observed);
    double low = -20, high = 40;
    for (int n = 0; n < 80; ++n) {
        const double t = (low + high) / 2;
        // Far from the root rounding cannot turn the comparison.
        const bool is_below = std::abs(t - near) > kFar ? t < near : sums.at(t).mean() > observed;
        const bool is_last = t == low || t == high;  // no number lies between them
        (is_below ? low : high) = t;
        if (is_last) break;
    }
    const double t = (low + high) / 2;
    if (t < -19 || t > 39) return {kNaN, kNaN};  // all clouds at one end of the range
    const Sums at_t = sums.at(t);
    const double mean = at_t.mean(), variance = at_t.second / at_t.zeroth - mean * mean;
    return {t, 1 / std::sqrt(double(in_range_) * variance)};
}

Estimate CloudSizes::fractal_dimension() const {
    if (in_range_ < kLeastInRange) return {kNaN, kNaN};
    const double n = double(in_range_);
    const double sxx = log_area_2_ - log_area_ * log_area_ / n,
                 sxy = log_product_ - log_area_ * log_edges_ / n,
                 syy = log_edges_2_ - log_edges_ * log_edges_ / n;
    if (!(sxx > 0)) return {kNaN, kNaN};
    const double slope = sxy / sxx;
    return {2 * slope, 2 * std::sqrt(std::max(0.0, syy - slope * sxy) / (n - 2) / sxx)};
}

}  // namespace nephos
