// SPDX-License-Identifier: Apache-2.0
#include "statistics/structure.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "statistics/row_shift.h"

namespace nephos {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

double columns_of(const Extent& extent) { return double(extent.x) * extent.y; }

// Pairs of covered columns `r` apart, and all pairs.
struct Pairs {
    double covered = 0, all = 0;
};

Pairs pairs_along_x(const BitPlaneView& shadow, int r, bool periodic) {
    const std::size_t words = shadow.words_per_row;
    const int nx = shadow.extent.x, ny = shadow.extent.y;
    BitPlane both(shadow.extent);
    std::vector<std::uint64_t> moved(words), wrapped(words);
    for (int j = 0; j < ny; ++j) {
        const std::uint64_t* row = shadow.row(j, 0);
        move_row(row, words, -r, moved.data());
        if (periodic) move_row(row, words, nx - r, wrapped.data());
        for (std::size_t n = 0; n < words; ++n) both.row(j, 0)[n] = row[n] & (moved[n] | wrapped[n]);
    }
    return {double(count_cells(both.view())), double(ny) * (periodic ? nx : nx - r)};
}

Pairs pairs_along_y(const BitPlaneView& shadow, int r, bool periodic) {
    const int ny = shadow.extent.y, rows = periodic ? ny : ny - r;
    BitPlane both(shadow.extent);
    for (int j = 0; j < rows; ++j) {
        const std::uint64_t *row = shadow.row(j, 0), *other = shadow.row((j + r) % ny, 0);
        for (std::size_t n = 0; n < shadow.words_per_row; ++n) both.row(j, 0)[n] = row[n] & other[n];
    }
    return {double(count_cells(both.view())), double(rows) * shadow.extent.x};
}

// rho of a shadow.
class CorrelationOf {
  public:
    CorrelationOf(const BitPlaneView& shadow, const Boundaries& boundaries)
        : shadow_(shadow),
          periodic_x_(boundaries.x == Boundary::periodic),
          periodic_y_(boundaries.y == Boundary::periodic),
          cover_(double(count_cells(shadow)) / columns_of(shadow.extent)) {}

    // The greatest distance.
    int most() const { return std::min(shadow_.extent.x, shadow_.extent.y) / 2; }
    double at(int r) const {
        const Pairs x = pairs_along_x(shadow_, r, periodic_x_), y = pairs_along_y(shadow_, r, periodic_y_);
        const double variance = cover_ - cover_ * cover_;
        const double mean = (x.covered + y.covered) / (x.all + y.all);
        return variance > 0 ? (mean - cover_ * cover_) / variance : kNaN;
    }

  private:
    BitPlaneView shadow_;
    bool periodic_x_, periodic_y_;
    double cover_;
};

// 1, 2, 3, 4, 6, 8, 12, 16 ...
int next_distance(int r) {
    if (r < 4) return r + 1;
    return r + int(std::bit_floor(unsigned(r))) / 2;
}

constexpr double kLength = 1 / std::numbers::e;  // of the correlation at the correlation length

std::vector<LevelOverlap> overlaps_up_to(const BitPlaneView& cld, int most) {
    const int nz = cld.extent.z;
    const std::size_t level_words = cld.words_per_row * std::size_t(cld.extent.y);
    const double columns = columns_of(cld.extent);
    std::vector<double> cover(std::size_t(nz), 0.0);
    const auto level = [&](int k) { return cld.words + std::size_t(k) * level_words; };
    const Extent flat{cld.extent.x, cld.extent.y, 1};
    for (int k = 0; k < nz; ++k)
        cover[std::size_t(k)] = double(count_cells({flat, cld.words_per_row, level(k)})) / columns;
    BitPlane both(flat);
    const std::span<std::uint64_t> words = both.words();
    std::vector<LevelOverlap> overlaps;
    for (int distance = 1; distance <= most; ++distance) {
        LevelOverlap overlap{distance, 0, 0};
        for (int k = 0; k + distance < nz; ++k) {
            const double f = cover[std::size_t(k)], g = cover[std::size_t(k + distance)];
            if (f <= 0 || g <= 0 || f >= 1 || g >= 1) continue;
            const std::uint64_t *low = level(k), *high = level(k + distance);
            for (std::size_t n = 0; n < level_words; ++n) words[n] = low[n] | high[n];
            const double together = double(count_cells(both.view())) / columns;
            const double random = f + g - f * g;
            overlap.mean += (together - random) / (std::max(f, g) - random);
            ++overlap.pairs;
        }
        overlap.mean = overlap.pairs > 0 ? overlap.mean / overlap.pairs : kNaN;
        overlaps.push_back(overlap);
    }
    return overlaps;
}

}  // namespace

std::vector<LevelOverlap> level_overlaps(const BitPlaneView& cld) {
    return overlaps_up_to(cld, cld.extent.z - 1);
}

double mean_overlap_of_neighbours(const BitPlaneView& cld) {
    const std::vector<LevelOverlap> overlaps = overlaps_up_to(cld, std::min(1, cld.extent.z - 1));
    return overlaps.empty() ? kNaN : overlaps.front().mean;
}

double overlap_length_m(const std::vector<LevelOverlap>& overlaps, double cell_size_m) {
    // log a = -dz / z0 through the origin.
    double product = 0, square = 0;
    int used = 0;
    for (const LevelOverlap& overlap : overlaps) {
        if (overlap.pairs == 0 || !(overlap.mean > 0.05)) break;
        const double dz = overlap.distance * cell_size_m;
        product += overlap.pairs * dz * -std::log(std::min(overlap.mean, 1.0));
        square += overlap.pairs * dz * dz;
        ++used;
    }
    return used >= 2 && product > 0 ? square / product : kNaN;
}

std::vector<Correlation> shadow_correlation(const BitPlaneView& shadow, const Boundaries& boundaries) {
    const CorrelationOf correlation(shadow, boundaries);
    std::vector<Correlation> result;
    for (int r = 1; r <= correlation.most(); r = next_distance(r)) result.push_back({r, correlation.at(r)});
    return result;
}

double correlation_length_m(const std::vector<Correlation>& correlation, double cell_size_m) {
    Correlation before{0, 1};
    for (const Correlation& now : correlation) {
        if (std::isnan(now.value)) return kNaN;
        if (now.value < kLength) {
            const double part = (before.value - kLength) / (before.value - now.value);
            return (before.distance + part * (now.distance - before.distance)) * cell_size_m;
        }
        before = now;
    }
    return kNaN;
}

double correlation_length_m(const BitPlaneView& shadow, const Boundaries& boundaries, double cell_size_m) {
    const CorrelationOf correlation(shadow, boundaries);
    std::vector<Correlation> known;
    for (int r = 1; r <= correlation.most(); r = next_distance(r)) {
        known.push_back({r, correlation.at(r)});
        if (!(known.back().value >= kLength)) break;
    }
    return correlation_length_m(known, cell_size_m);
}

}  // namespace nephos
