// SPDX-License-Identifier: Apache-2.0
#include "statistics/organisation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
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

// The box of the clouds, with distances to the nearest image along periodic axes.
struct Box {
    Extent extent;
    bool wrap_x, wrap_y;
    double distance(const ConnectedCloud& a, const ConnectedCloud& b) const {
        const double dx = axis_distance(a.x, b.x, extent.x, wrap_x),
                     dy = axis_distance(a.y, b.y, extent.y, wrap_y);
        // Centroids of a ring and of what is inside it may coincide; a tenth of a column keeps the logarithm finite.
        return std::max(0.1, std::sqrt(dx * dx + dy * dy));
    }
};

// Clouds by the squares of a grid in which their centroids lie, one cloud a square in the mean.
class Squares {
  public:
    Squares(std::span<const ConnectedCloud> clouds, const Box& box)
        : clouds_(clouds),
          box_(box),
          side_(std::max(1.0, std::sqrt(double(box.extent.x) * box.extent.y / double(clouds.size())))),
          nx_(std::max(1, int(box.extent.x / side_))),
          ny_(std::max(1, int(box.extent.y / side_))),
          first_(std::size_t(nx_) * std::size_t(ny_) + 1, 0),
          members_(clouds.size()) {
        for (const ConnectedCloud& cloud : clouds) ++first_[square_of(cloud) + 1];
        std::partial_sum(first_.begin(), first_.end(), first_.begin());
        std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
        for (std::size_t n = 0; n < clouds.size(); ++n)
            members_[next[square_of(clouds[n])]++] = std::uint32_t(n);
    }

    // Returns the distance of a cloud to the nearest other one: looks at rings of squares around its own until none farther
    // out can be nearer.
    double nearest(std::size_t cloud) const {
        const std::size_t square = square_of(clouds_[cloud]);
        const int i = int(square % std::size_t(nx_)), j = int(square / std::size_t(nx_));
        const double width = std::min(double(box_.extent.x) / nx_, double(box_.extent.y) / ny_);
        double best = std::numeric_limits<double>::infinity();
        for (int ring = 0; ring <= std::max(nx_, ny_) && best > (ring - 1) * width; ++ring) {
            for (int dj = -ring; dj <= ring; ++dj) {
                const int step = dj == -ring || dj == ring ? 1 : std::max(1, 2 * ring);
                for (int di = -ring; di <= ring; di += step) look(i + di, j + dj, cloud, best);
            }
        }
        return best;
    }

  private:
    std::size_t square_of(const ConnectedCloud& cloud) const {
        const int i = std::clamp(int(cloud.x / box_.extent.x * nx_), 0, nx_ - 1),
                  j = std::clamp(int(cloud.y / box_.extent.y * ny_), 0, ny_ - 1);
        return std::size_t(j) * std::size_t(nx_) + std::size_t(i);
    }
    void look(int i, int j, std::size_t cloud, double& best) const {
        if (box_.wrap_x) i = (i % nx_ + nx_) % nx_;
        if (box_.wrap_y) j = (j % ny_ + ny_) % ny_;
        if (i < 0 || i >= nx_ || j < 0 || j >= ny_) return;
        const std::size_t square = std::size_t(j) * std::size_t(nx_) + std::size_t(i);
        for (std::size_t n = first_[square]; n < first_[square + 1]; ++n) {
            if (members_[n] != cloud)
                best = std::min(best, box_.distance(clouds_[cloud], clouds_[members_[n]]));
        }
    }

    std::span<const ConnectedCloud> clouds_;
    const Box& box_;
    double side_;
    int nx_, ny_;
    std::vector<std::size_t> first_;  // of each square, in members_
    std::vector<std::uint32_t> members_;
};

// Sums over pairs of clouds.
struct PairSums {
    double log_distance = 0, potential = 0, pairs = 0;
};

PairSums sums_over_pairs(std::span<const ConnectedCloud> clouds, const Box& box) {
    const std::size_t n = clouds.size();
    std::vector<double> roots(n);
    for (std::size_t a = 0; a < n; ++a) roots[a] = std::sqrt(double(clouds[a].cells));
    PairSums sums;
    const auto add = [&](std::size_t a, std::size_t b) {
        const double d = box.distance(clouds[a], clouds[b]);
        sums.log_distance += std::log(d);
        sums.potential += (roots[a] + roots[b]) / d;
    };
    if (n <= kMaxCloudsOfAllPairs) {
        for (std::size_t a = 0; a < n; ++a)
            for (std::size_t b = a + 1; b < n; ++b) add(a, b);
        sums.pairs = double(n) * double(n - 1) / 2;
    } else {
        // Two pairs from each draw; of a pair that is one cloud twice nothing is taken.
        for (std::uint32_t draw = 0; draw < kSampledPairs / 2; ++draw) {
            const PhiloxWords words = philox(0, item_counter(Domain::null_model, 1, draw, 0, 0));
            for (std::size_t pair = 0; pair < 2; ++pair) {
                const std::size_t a = std::size_t(words[2 * pair] * std::uint64_t{n} >> 32),
                                  b = std::size_t(words[2 * pair + 1] * std::uint64_t{n} >> 32);
                if (a == b) continue;
                add(a, b);
                ++sums.pairs;
            }
        }
    }
    return sums;
}

}  // namespace

Organisation organisation(std::span<const ConnectedCloud> clouds, const Extent& extent,
                          const Boundaries& boundaries) {
    const std::size_t n = clouds.size();
    if (n < 2) return {kNaN, kNaN, kNaN};
    const Box box{extent, boundaries.x == Boundary::periodic, boundaries.y == Boundary::periodic};
    const Squares squares(clouds, box);
    std::vector<double> nearest(n);
    for (std::size_t a = 0; a < n; ++a) nearest[a] = squares.nearest(a);
    std::ranges::sort(nearest);
    const double columns = double(extent.x) * extent.y, density = double(n) / columns;
    // F is k / n between the distances k - 1 and k in order, and 1 beyond the last.
    double iorg = 0, before = 0;
    for (std::size_t k = 0; k < n; ++k) {
        const double g = 1 - std::exp(-density * std::numbers::pi * nearest[k] * nearest[k]);
        iorg += double(k) / double(n) * (g - before);
        before = g;
    }
    iorg += 1 - before;
    const PairSums sums = sums_over_pairs(clouds, box);
    const double side = std::hypot(double(extent.x), double(extent.y));
    return {iorg, 1000 * double(n) / (columns / 2) * std::exp(sums.log_distance / sums.pairs) / side,
            sums.potential / std::sqrt(std::numbers::pi) / sums.pairs};
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
