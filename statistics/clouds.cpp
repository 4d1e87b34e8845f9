// SPDX-License-Identifier: Apache-2.0
#include "statistics/clouds.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <numeric>

#include "statistics/cloud_statistics.h"

namespace nephos {
namespace {

// Union-find over runs: `roots` of a root is itself and the smallest of its set.
class Sets {
  public:
    explicit Sets(std::size_t count) : roots_(count) { std::iota(roots_.begin(), roots_.end(), 0u); }
    std::uint32_t root(std::uint32_t n) {
        while (roots_[n] != n) n = roots_[n] = roots_[roots_[n]];
        return n;
    }
    void unite(std::uint32_t a, std::uint32_t b) {
        const std::uint32_t one = root(a), other = root(b);
        roots_[std::max(one, other)] = std::min(one, other);
    }

  private:
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
        : plane_(plane), runs_(runs_of(plane)), sets_(runs_.runs.size()), reach_(reach) {
        periodic_x_ = boundaries.x == Boundary::periodic;
        periodic_y_ = boundaries.y == Boundary::periodic;
        periodic_z_ = boundaries.z == Boundary::periodic;
    }

    std::vector<ConnectedCloud> clouds(bool with_centroids) {
        open_edges_.assign(runs_.runs.size(), 0);
        join<true>();
        return with_centroids ? collected<true>() : collected<false>();
    }
    LabelledClouds labelled() {
        join<false>();
        return numbered();
    }

  private:
    std::size_t first(int row) const { return runs_.rows[std::size_t(row)]; }
    std::size_t last(int row) const { return runs_.rows[std::size_t(row) + 1]; }

    // kEdges: counts the sides towards clear air, too.
    template <bool kEdges>
    void join() {
        const Extent& e = plane_.extent;
        for (int k = 0; k < e.z; ++k) {
            for (int j = 0; j < e.y; ++j) {
                join_in_row<kEdges>(k * e.y + j);
                if (j + 1 < e.y || periodic_y_)
                    join_rows<kEdges>(k * e.y + j, k * e.y + (j + 1) % e.y, reach_);
                if (e.z > 1 && (k + 1 < e.z || periodic_z_))
                    join_rows<kEdges>(k * e.y + j, (k + 1) % e.z * e.y + j, 0);
            }
        }
    }

    // The two ends of the runs of a row, and the run that goes on around a periodic axis.
    template <bool kEdges>
    void join_in_row(int row) {
        const int nx = plane_.extent.x;
        if constexpr (kEdges) {
            for (std::size_t n = first(row); n < last(row); ++n)
                open_edges_[n] += unsigned(runs_.runs[n].begin > 0) + unsigned(runs_.runs[n].end < nx);
        }
        if (!periodic_x_ || first(row) == last(row)) return;
        const std::size_t west = first(row), east = last(row) - 1;
        const bool at_west = runs_.runs[west].begin == 0, at_east = runs_.runs[east].end == nx;
        if (at_west && at_east) {
            sets_.unite(std::uint32_t(west), std::uint32_t(east));
        } else if constexpr (kEdges) {
            open_edges_[west] += unsigned(at_west);
            open_edges_[east] += unsigned(at_east);
        }
    }

    // Rows that lie side by side; `reach` = 1 joins corners too.
    template <bool kEdges>
    void join_rows(int one, int other, int reach) {
        overlaps_.resize(std::size_t(plane_.extent.x) + 2);
        const auto first_one = std::uint32_t(first(one)), first_other = std::uint32_t(first(other));
        const auto overlaps = [&](int shift, int longer) {
            const std::size_t count =
                find_overlaps(runs_.of_row(one), runs_.of_row(other), shift, longer, overlaps_.data());
            for (std::size_t n = 0; n < count; ++n)
                sets_.unite(first_one + overlaps_[n].one, first_other + overlaps_[n].other);
            return count;
        };
        const std::size_t count = overlaps(0, 0);
        if constexpr (kEdges) {
            for (std::size_t n = first(one); n < last(one); ++n) open_edges_[n] += length(n);
            for (std::size_t n = first(other); n < last(other); ++n) open_edges_[n] += length(n);
            for (std::size_t n = 0; n < count; ++n) {
                open_edges_[first_one + overlaps_[n].one] -= std::uint64_t(overlaps_[n].cells);
                open_edges_[first_other + overlaps_[n].other] -= std::uint64_t(overlaps_[n].cells);
            }
        }
        if (reach == 0) return;
        overlaps(0, reach);
        if (!periodic_x_) return;
        overlaps(plane_.extent.x, reach);
        overlaps(-plane_.extent.x, reach);
    }

    // Numbers the clouds by their first run. The root of a run comes before it.
    LabelledClouds numbered() {
        LabelledClouds result;
        const Extent& e = plane_.extent;
        result.cloud.resize(runs_.runs.size());
        std::uint32_t count = 0;
        for (std::uint32_t n = 0; n < result.cloud.size(); ++n) {
            const std::uint32_t root = sets_.root(n);
            result.cloud[n] = root == n ? count : result.cloud[root];
            count += root == n;
        }
        result.cut.assign(count, 0);
        const auto cut = [&](std::size_t run) { result.cut[result.cloud[run]] = 1; };
        for (int row = 0; row < e.y; ++row) {
            if (first(row) == last(row)) continue;
            if (!periodic_x_ && runs_.runs[first(row)].begin == 0) cut(first(row));
            if (!periodic_x_ && runs_.runs[last(row) - 1].end == e.x) cut(last(row) - 1);
            if (!periodic_y_ && (row == 0 || row + 1 == e.y))
                for (std::size_t n = first(row); n < last(row); ++n) cut(n);
        }
        result.shadow = std::move(runs_);
        return result;
    }

    std::uint64_t length(std::size_t run) const {
        return std::uint64_t(runs_.runs[run].end - runs_.runs[run].begin);
    }

    void mark_sides(ConnectedCloud& cloud, const Sums& sum) const {
        const Extent& e = plane_.extent;
        cloud.cut = (!periodic_x_ && (sum.low_x || sum.high_x)) ||
                    (!periodic_y_ && (sum.low_y || sum.high_y)) ||
                    (e.z > 1 && !periodic_z_ && (sum.low_z || sum.high_z));
        cloud.spans = (!periodic_x_ && sum.low_x && sum.high_x) || (!periodic_y_ && sum.low_y && sum.high_y);
    }

    template <bool kCentroids>
    std::vector<ConnectedCloud> collected() {
        const Extent& e = plane_.extent;
        const Centre x(e.x, kCentroids && periodic_x_), y(e.y, kCentroids && periodic_y_),
            z(e.z, kCentroids && periodic_z_);
        std::vector<std::uint32_t> number(runs_.runs.size());
        std::vector<ConnectedCloud> clouds;
        std::vector<Sums> sums;
        for (int row = 0; row < e.y * e.z; ++row) {
            const int j = row % e.y, k = row / e.y;
            for (std::size_t n = first(row); n < last(row); ++n) {
                const std::uint32_t root = sets_.root(std::uint32_t(n));
                if (root == n) {  // the first run of its cloud
                    number[root] = std::uint32_t(clouds.size());
                    clouds.push_back({});
                    clouds.back().lowest = k;
                    sums.emplace_back();
                }
                ConnectedCloud& cloud = clouds[number[root]];
                Sums& sum = sums[number[root]];
                const CellRun run = runs_.runs[n];
                const double cells = run.end - run.begin;
                cloud.cells += std::uint64_t(run.end - run.begin);
                cloud.edges += open_edges_[n];
                cloud.lowest = std::min(cloud.lowest, k);
                cloud.highest = std::max(cloud.highest, k);
                if constexpr (kCentroids) {
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
            if constexpr (!kCentroids) continue;
            cloud.x = x.mean(sum.x, double(cloud.cells));
            cloud.y = y.mean(sum.y, double(cloud.cells));
            if (e.z > 1) cloud.z = z.mean(sum.z, double(cloud.cells));
        }
        return clouds;
    }

    BitPlaneView plane_;
    CellRuns runs_;
    Sets sets_;
    int reach_;
    bool periodic_x_, periodic_y_, periodic_z_;
    std::vector<std::uint64_t> open_edges_;  // of each run
    std::vector<RunOverlap> overlaps_;       // of two rows
};

std::vector<ConnectedCloud> clouds_of_shadow(const BitPlaneView& cld, const Boundaries& boundaries, int reach,
                                             bool with_centroids) {
    const BitPlane shadow = shadow_of(cld);
    return Labelling(shadow.view(), {boundaries.x, boundaries.y, Boundary::open}, reach)
        .clouds(with_centroids);
}

}  // namespace

CellRuns runs_of(const BitPlaneView& plane) {
    const std::size_t rows = std::size_t(plane.extent.y) * std::size_t(plane.extent.z);
    CellRuns result;
    result.rows.reserve(rows + 1);
    std::vector<int> ends(std::size_t(plane.extent.x) + 2);  // begin, end, begin, end ... of a row
    for (std::size_t row = 0; row < rows; ++row) {
        result.rows.push_back(result.runs.size());
        const std::uint64_t* words = plane.words + row * plane.words_per_row;
        std::size_t count = 0;
        std::uint64_t before = 0;  // the last cell of the word before
        for (std::size_t w = 0; w < plane.words_per_row; ++w) {
            // Where a cell differs from the one before it.
            for (std::uint64_t turns = words[w] ^ (words[w] << 1 | before); turns != 0; turns &= turns - 1)
                ends[count++] = int(64 * w) + std::countr_zero(turns);
            before = words[w] >> 63;
        }
        if (count % 2 != 0) ends[count++] = plane.extent.x;
        for (std::size_t n = 0; n < count; n += 2) result.runs.push_back({ends[n], ends[n + 1]});
    }
    result.rows.push_back(result.runs.size());
    return result;
}

std::size_t find_overlaps(std::span<const CellRun> one, std::span<const CellRun> other, int shift, int reach,
                          RunOverlap* overlaps) {
    std::size_t a = 0, b = 0, count = 0;
    // Each turn leaves one run behind. Without branches, as nobody can foretell which of the two.
    while (a < one.size() && b < other.size()) {
        const int begin = other[b].begin + shift - reach, end = other[b].end + shift + reach;
        const int cells = std::min(one[a].end, end) - std::max(one[a].begin, begin);
        overlaps[count] = {std::uint32_t(a), std::uint32_t(b), cells};
        count += std::size_t(cells > 0);
        const bool ends_first = one[a].end < end;
        a += std::size_t(ends_first);
        b += std::size_t(!ends_first);
    }
    return count;
}

std::vector<ConnectedCloud> clouds_2d(const BitPlaneView& cld, const Boundaries& boundaries,
                                      Neighbours neighbours) {
    return clouds_of_shadow(cld, boundaries, neighbours == Neighbours::eight ? 1 : 0, true);
}

std::vector<ConnectedCloud> cloud_sizes_2d(const BitPlaneView& cld, const Boundaries& boundaries) {
    return clouds_of_shadow(cld, boundaries, 0, false);
}

std::vector<ConnectedCloud> clouds_3d(const BitPlaneView& cld, const Boundaries& boundaries) {
    return Labelling(cld, boundaries, 0).clouds(true);
}

LabelledClouds labelled_clouds_2d(const BitPlaneView& cld, const Boundaries& boundaries) {
    const BitPlane shadow = shadow_of(cld);
    return Labelling(shadow.view(), {boundaries.x, boundaries.y, Boundary::open}, 0).labelled();
}

}  // namespace nephos
