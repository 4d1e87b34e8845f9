// SPDX-License-Identifier: Apache-2.0
#include "statistics/clouds.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>

#include "statistics/cloud_statistics.h"

namespace nephos {
namespace {

// Cells [begin, end) of a row.
struct Run {
    int begin, end;
};

// All runs of a plane, row by row, and the union-find over them. `roots` of a root is itself and the smallest of its set.
class Runs {
  public:
    explicit Runs(const BitPlaneView& plane) : plane_(plane) {
        const int rows = plane.extent.y * plane.extent.z;
        starts_.reserve(std::size_t(rows) + 1);
        for (int row = 0; row < rows; ++row) {
            starts_.push_back(runs_.size());
            add_row(plane.words + std::size_t(row) * plane.words_per_row);
        }
        starts_.push_back(runs_.size());
        roots_.resize(runs_.size());
        for (std::size_t n = 0; n < roots_.size(); ++n) roots_[n] = std::uint32_t(n);
    }

    std::size_t count() const { return runs_.size(); }
    const Run& run(std::size_t n) const { return runs_[n]; }
    std::size_t first(int row) const { return starts_[std::size_t(row)]; }
    std::size_t last(int row) const { return starts_[std::size_t(row) + 1]; }

    std::uint32_t root(std::uint32_t n) {
        while (roots_[n] != n) n = roots_[n] = roots_[roots_[n]];
        return n;
    }
    void unite(std::size_t a, std::size_t b) {
        const std::uint32_t one = root(std::uint32_t(a)), other = root(std::uint32_t(b));
        roots_[std::max(one, other)] = std::min(one, other);
    }

    // Calls use(a, b, cells) for all runs a of row `one` and b of row `other` that share columns when those of `other`
    // are moved by `shift` and made longer by `reach` at both ends.
    template <typename Use>
    void for_overlaps(int one, int other, int shift, int reach, Use&& use) const {
        std::size_t a = first(one), b = first(other);
        while (a < last(one) && b < last(other)) {
            const int begin = runs_[b].begin + shift - reach, end = runs_[b].end + shift + reach;
            const int cells = std::min(runs_[a].end, end) - std::max(runs_[a].begin, begin);
            if (cells > 0) use(a, b, cells);
            if (runs_[a].end < end) {
                ++a;
            } else {
                ++b;
            }
        }
    }

  private:
    void add_row(const std::uint64_t* words) {
        const int nx = plane_.extent.x;
        int at = 0;
        while (at < nx) {
            at = next(words, at, false);
            if (at >= nx) break;
            const int end = std::min(next(words, at, true), nx);
            runs_.push_back({at, end});
            at = end;
        }
    }
    // The first cell from `at` on that is 1, or 0 if `clear`; nx or more if there is none.
    int next(const std::uint64_t* words, int at, bool clear) const {
        const std::uint64_t flip = clear ? ~std::uint64_t(0) : 0;
        std::size_t n = std::size_t(at) / 64;
        std::uint64_t word = (words[n] ^ flip) >> (at % 64) << (at % 64);
        while (word == 0) {
            if (++n == plane_.words_per_row) return plane_.extent.x;
            word = words[n] ^ flip;
        }
        return int(n * 64) + std::countr_zero(word);
    }

    BitPlaneView plane_;
    std::vector<Run> runs_;
    std::vector<std::size_t> starts_;  // of rows, in runs_
    std::vector<std::uint32_t> roots_;
};

// The sum of positions along an axis; on a periodic one of their directions around the circle.
class Centre {
  public:
    Centre(int cells, bool periodic) : cells_(cells), periodic_(periodic) {
        if (!periodic) return;
        sines_.resize(std::size_t(cells) + 1);
        cosines_.resize(std::size_t(cells) + 1);
        // Sums up to a cell, so that a run costs two differences.
        for (int n = 0; n < cells; ++n) {
            const double angle = 2 * std::numbers::pi * (n + 0.5) / cells;
            sines_[std::size_t(n) + 1] = sines_[std::size_t(n)] + std::sin(angle);
            cosines_[std::size_t(n) + 1] = cosines_[std::size_t(n)] + std::cos(angle);
        }
    }
    void add(std::array<double, 2>& sum, int begin, int end, double weight) const {
        if (!periodic_) {
            sum[0] += weight * (double(end) * end - double(begin) * begin) / 2;
            return;
        }
        sum[0] += weight * (sines_[std::size_t(end)] - sines_[std::size_t(begin)]);
        sum[1] += weight * (cosines_[std::size_t(end)] - cosines_[std::size_t(begin)]);
    }
    double mean(const std::array<double, 2>& sum, double weight) const {
        if (!periodic_) return sum[0] / weight;
        // A cloud that is even around the whole axis has no direction; then any place is as good.
        if (std::hypot(sum[0], sum[1]) < 1e-9 * weight) return 0;
        const double turn = std::atan2(sum[0], sum[1]) / (2 * std::numbers::pi);
        return (turn < 0 ? turn + 1 : turn) * cells_;
    }

  private:
    int cells_;
    bool periodic_;
    std::vector<double> sines_, cosines_;
};

struct Sums {
    std::array<double, 2> x{}, y{}, z{};
    bool low_x = false, high_x = false, low_y = false, high_y = false, low_z = false, high_z = false;
};

// One labelling of a plane of one or several levels.
class Labelling {
  public:
    Labelling(const BitPlaneView& plane, const Boundaries& boundaries, int reach)
        : plane_(plane), runs_(plane), reach_(reach) {
        periodic_x_ = boundaries.x == Boundary::periodic;
        periodic_y_ = boundaries.y == Boundary::periodic;
        periodic_z_ = boundaries.z == Boundary::periodic;
        open_edges_.assign(runs_.count(), 0);
    }

    std::vector<ConnectedCloud> clouds() {
        join();
        return collected(nullptr);
    }
    LabelledClouds labelled() {
        join();
        LabelledClouds labelled;
        labelled.clouds = collected(&labelled.runs);
        for (int row = 0; row < plane_.extent.y; ++row) labelled.rows.push_back(runs_.first(row));
        labelled.rows.push_back(runs_.count());
        return labelled;
    }

  private:
    void join() {
        const Extent& e = plane_.extent;
        for (int k = 0; k < e.z; ++k) {
            for (int j = 0; j < e.y; ++j) {
                join_in_row(k * e.y + j);
                if (j + 1 < e.y || periodic_y_) join_rows(k * e.y + j, k * e.y + (j + 1) % e.y, reach_);
                if (e.z > 1 && (k + 1 < e.z || periodic_z_))
                    join_rows(k * e.y + j, (k + 1) % e.z * e.y + j, 0);
            }
        }
    }

    // The two ends of the runs of a row, and the run that goes on around a periodic axis.
    void join_in_row(int row) {
        const int nx = plane_.extent.x;
        for (std::size_t n = runs_.first(row); n < runs_.last(row); ++n) {
            open_edges_[n] += unsigned(runs_.run(n).begin > 0) + unsigned(runs_.run(n).end < nx);
        }
        if (!periodic_x_ || runs_.first(row) == runs_.last(row)) return;
        const std::size_t west = runs_.first(row), east = runs_.last(row) - 1;
        const bool at_west = runs_.run(west).begin == 0, at_east = runs_.run(east).end == nx;
        if (at_west && at_east) {
            runs_.unite(west, east);
        } else if (at_west) {
            ++open_edges_[west];
        } else if (at_east) {
            ++open_edges_[east];
        }
    }

    // Rows that lie side by side; `reach` = 1 joins corners too.
    void join_rows(int one, int other, int reach) {
        for (std::size_t n = runs_.first(one); n < runs_.last(one); ++n) open_edges_[n] += length(n);
        for (std::size_t n = runs_.first(other); n < runs_.last(other); ++n) open_edges_[n] += length(n);
        runs_.for_overlaps(one, other, 0, 0, [&](std::size_t a, std::size_t b, int cells) {
            open_edges_[a] -= std::uint64_t(cells);
            open_edges_[b] -= std::uint64_t(cells);
            runs_.unite(a, b);
        });
        if (reach == 0) return;
        const auto unite = [&](std::size_t a, std::size_t b, int) { runs_.unite(a, b); };
        runs_.for_overlaps(one, other, 0, reach, unite);
        if (!periodic_x_) return;
        runs_.for_overlaps(one, other, plane_.extent.x, reach, unite);
        runs_.for_overlaps(one, other, -plane_.extent.x, reach, unite);
    }

    std::uint64_t length(std::size_t run) const {
        return std::uint64_t(runs_.run(run).end - runs_.run(run).begin);
    }

    void mark_sides(ConnectedCloud& cloud, const Sums& sum) const {
        const Extent& e = plane_.extent;
        cloud.cut = (!periodic_x_ && (sum.low_x || sum.high_x)) ||
                    (!periodic_y_ && (sum.low_y || sum.high_y)) ||
                    (e.z > 1 && !periodic_z_ && (sum.low_z || sum.high_z));
        cloud.spans = (!periodic_x_ && sum.low_x && sum.high_x) || (!periodic_y_ && sum.low_y && sum.high_y);
    }

    // With the runs in their order, and without centroids, where `labels` is given.
    std::vector<ConnectedCloud> collected(std::vector<LabelledRun>* labels) {
        const Extent& e = plane_.extent;
        const Centre x(e.x, periodic_x_), y(e.y, periodic_y_), z(e.z, periodic_z_);
        constexpr std::uint32_t kNone = ~std::uint32_t(0);
        std::vector<std::uint32_t> number(runs_.count(), kNone);
        std::vector<ConnectedCloud> clouds;
        std::vector<Sums> sums;
        for (int row = 0; row < e.y * e.z; ++row) {
            const int j = row % e.y, k = row / e.y;
            for (std::size_t n = runs_.first(row); n < runs_.last(row); ++n) {
                const std::uint32_t root = runs_.root(std::uint32_t(n));
                if (number[root] == kNone) {
                    number[root] = std::uint32_t(clouds.size());
                    clouds.push_back({});
                    clouds.back().lowest = k;
                    sums.emplace_back();
                }
                if (labels) labels->push_back({runs_.run(n).begin, runs_.run(n).end, number[root]});
                ConnectedCloud& cloud = clouds[number[root]];
                Sums& sum = sums[number[root]];
                const Run run = runs_.run(n);
                const double cells = run.end - run.begin;
                cloud.cells += std::uint64_t(run.end - run.begin);
                cloud.edges += open_edges_[n];
                cloud.lowest = std::min(cloud.lowest, k);
                cloud.highest = std::max(cloud.highest, k);
                if (!labels) {
                    x.add(sum.x, run.begin, run.end, 1);
                    y.add(sum.y, j, j + 1, cells);
                    z.add(sum.z, k, k + 1, cells);
                }
                sum.low_x |= run.begin == 0;
                sum.high_x |= run.end == e.x;
                sum.low_y |= j == 0;
                sum.high_y |= j + 1 == e.y;
                sum.low_z |= k == 0;
                sum.high_z |= k + 1 == e.z;
            }
        }
        for (std::size_t n = 0; n < clouds.size(); ++n) {
            ConnectedCloud& cloud = clouds[n];
            const Sums& sum = sums[n];
            mark_sides(cloud, sum);
            if (labels) continue;
            cloud.x = x.mean(sum.x, double(cloud.cells));
            cloud.y = y.mean(sum.y, double(cloud.cells));
            if (e.z > 1) cloud.z = z.mean(sum.z, double(cloud.cells));
        }
        return clouds;
    }

    BitPlaneView plane_;
    Runs runs_;
    int reach_;
    bool periodic_x_, periodic_y_, periodic_z_;
    std::vector<std::uint64_t> open_edges_;  // of each run
};

}  // namespace

std::vector<ConnectedCloud> clouds_2d(const BitPlaneView& cld, const Boundaries& boundaries,
                                      Neighbours neighbours) {
    const BitPlane shadow = shadow_of(cld);
    Labelling labelling(shadow.view(), {boundaries.x, boundaries.y, Boundary::open},
                        neighbours == Neighbours::eight ? 1 : 0);
    return labelling.clouds();
}

std::vector<ConnectedCloud> clouds_3d(const BitPlaneView& cld, const Boundaries& boundaries) {
    return Labelling(cld, boundaries, 0).clouds();
}

LabelledClouds labelled_clouds_2d(const BitPlaneView& cld, const Boundaries& boundaries) {
    const BitPlane shadow = shadow_of(cld);
    Labelling labelling(shadow.view(), {boundaries.x, boundaries.y, Boundary::open}, 0);
    return labelling.labelled();
}

}  // namespace nephos
