// SPDX-License-Identifier: Apache-2.0
#include "statistics/organisation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "core/random.h"

namespace nephos {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

double axis_distance(double a, double b, int cells, bool periodic) {
    const double d = std::abs(a - b);
    return periodic ? std::min(d, cells - d) : d;
}

// Of the draws that have a value: shadows of hardly any cover may have fewer than two clouds.
struct Moments {
    double sum = 0, squares = 0;
    int n = 0;
    void add(double value) {
        if (std::isnan(value)) return;
        ++n;
        sum += value;
        squares += value * value;
    }
    double mean() const { return n > 0 ? sum / n : kNaN; }
    double deviation() const {
        return n > 1 ? std::sqrt(std::max(0.0, (squares - sum * sum / n) / (n - 1))) : kNaN;
    }
};

}  // namespace

Organisation organisation(std::span<const ConnectedCloud> clouds, const Extent& extent,
                          const Boundaries& boundaries) {
    const std::size_t n = clouds.size();
    if (n < 2) return {kNaN, kNaN, kNaN};
    const bool wrap_x = boundaries.x == Boundary::periodic, wrap_y = boundaries.y == Boundary::periodic;
    std::vector<double> nearest(n, std::numeric_limits<double>::infinity());
    double logarithms = 0, potential = 0;
    for (std::size_t a = 0; a < n; ++a) {
        const double root = std::sqrt(double(clouds[a].cells));
        for (std::size_t b = a + 1; b < n; ++b) {
            const double dx = axis_distance(clouds[a].x, clouds[b].x, extent.x, wrap_x);
            const double dy = axis_distance(clouds[a].y, clouds[b].y, extent.y, wrap_y);
            // Centroids of a ring and of what is inside it may coincide; a tenth of a column keeps the logarithm finite.
            const double d = std::max(0.1, std::sqrt(dx * dx + dy * dy));
            nearest[a] = std::min(nearest[a], d);
            nearest[b] = std::min(nearest[b], d);
            logarithms += std::log(d);
            potential += (root + std::sqrt(double(clouds[b].cells))) / d;
        }
    }
    std::ranges::sort(nearest);
    const double columns = double(extent.x) * extent.y, density = double(n) / columns,
                 pairs = double(n) * double(n - 1) / 2;
    // F is k / n between the distances k - 1 and k in order, and 1 beyond the last.
    double iorg = 0, before = 0;
    for (std::size_t k = 0; k < n; ++k) {
        const double g = 1 - std::exp(-density * std::numbers::pi * nearest[k] * nearest[k]);
        iorg += double(k) / double(n) * (g - before);
        before = g;
    }
    iorg += 1 - before;
    const double side = std::hypot(double(extent.x), double(extent.y));
    return {iorg, 1000 * double(n) / (columns / 2) * std::exp(logarithms / pairs) / side,
            potential / std::sqrt(std::numbers::pi) / pairs};
}

BitPlane random_shadow(const Extent& extent, double cover, std::uint64_t seed, std::uint32_t number) {
    BitPlane shadow({extent.x, extent.y, 1});
    const double threshold = cover * 0x1p32;
    std::uint64_t at = 0;
    PhiloxWords words{};
    for (int j = 0; j < extent.y; ++j) {
        for (int i = 0; i < extent.x; ++i, ++at) {
            if (at % 4 == 0)
                words = philox(seed, item_counter(Domain::null_model, 0, std::uint32_t(at / 4), number, 0));
            if (double(words[std::size_t(at % 4)]) < threshold) shadow.set(i, j, 0, true);
        }
    }
    return shadow;
}

NullOrganisation null_organisation(const Extent& extent, const Boundaries& boundaries, double cover,
                                   int draws, std::uint64_t seed) {
    Moments iorg, scai, cop;
    for (int n = 0; n < draws; ++n) {
        const BitPlane shadow = random_shadow(extent, cover, seed, std::uint32_t(n));
        const Organisation one = organisation(clouds_2d(shadow.view(), boundaries), extent, boundaries);
        iorg.add(one.iorg);
        scai.add(one.scai);
        cop.add(one.cop);
    }
    return {{iorg.mean(), scai.mean(), cop.mean()}, {iorg.deviation(), scai.deviation(), cop.deviation()}};
}

}  // namespace nephos
