// SPDX-License-Identifier: Apache-2.0
#include "statistics/clouds.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>

#include "statistics/cloud_statistics.h"

namespace nephos {
namespace {

constexpr std::uint32_t kNone = ~std::uint32_t(0);

// Union-find over runs: `roots` of a root is itself and the smallest of its set.
class Sets {
  public:
    explicit Sets(std::size_t count) : roots_(count) { std::iota(roots_.begin(), roots_.end(), 0u); }
    std::uint32_t root(std::uint32_t n) {
        while (roots_[n] != n) n = roots_[n] = roots_[roots_[n]];
        return n;
    }
    void unite(std::uint32_t a, std::uint32_t b) {
        // Nearly always two steps are enough, and how many it takes cannot be foretold.
        std::uint32_t one = roots_[roots_[a]], other = roots_[roots_[b]];
        if ((int(roots_[one] != one) | int(roots_[other] != other)) != 0) {
            one = root(one);
            other = root(other);
        }
        const std::uint32_t first = std::min(one, other);
        roots_[a] = roots_[b] = roots_[one] = roots_[other] = first;
    }
    // Numbers the sets in the order of their first members, and returns how many there are.
    std::uint32_t number(std::vector<std::uint32_t>& numbers) const {
        numbers.resize(roots_.size());
        std::uint32_t count = 0;
        // What a member points to is of its set and comes before it: it has its number.
        for (std::uint32_t n = 0; n < roots_.size(); ++n)
            numbers[n] = roots_[n] == n ? count++ : numbers[roots_[n]];
        return count;
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
        // A cloud that is even around the whole axis has no direction; then any place is as good. The length is not less
        // than the longer side.
        if (std::max(std::abs(sum[0]), std::abs(sum[1])) < 2e-9 * weight &&
            std::hypot(sum[0], sum[1]) < 1e-9 * weight)
            return 0;
        const double turn = std::atan2(sum[0], sum[1]) / (2 * std::numbers::pi);
        const double at = (turn < 0 ? turn + 1 : turn) * cells_;
        return at < cells_ ? at : 0;  // a turn just below 0 rounds to a whole one
    }
    // Returns the mean of one cell: most clouds are no more than that.
    double mean_of_cell(int at) {
        if (!periodic_) return at + 0.5;
        if (of_cells_.empty()) {
            of_cells_.resize(std::size_t(cells_));
            for (int n = 0; n < cells_; ++n) {
                std::array<double, 2> sum{};
                add(sum, n, n + 1, 1);
                of_cells_[std::size_t(n)] = mean(sum, 1);
            }
        }
        return of_cells_[std::size_t(at)];
    }

  private:
    int cells_;
    bool periodic_;
    std::vector<double> sines_, cosines_, of_cells_;
};

// Sides of the box that a cloud touches, as bits.
constexpr unsigned kLowX = 1, kHighX = 2, kLowY = 4, kHighY = 8, kLowZ = 16, kHighZ = 32;

// Nearly always 0: no instruction that counts is worth a call.
int count_sides(unsigned sides) {
    int count = 0;
    for (; sides != 0; sides &= sides - 1) ++count;
    return count;
}

bool is_periodic(Boundary boundary) { return boundary == Boundary::periodic; }

// One labelling of a plane of one or several levels.
class Labelling {
  public:
    // Without faces the clouds have no edges.
    Labelling(const BitPlaneView& plane, const Boundaries& boundaries, Neighbours neighbours,
              bool with_faces = true)
        : plane_(plane), boundaries_(boundaries), numbers_(number_runs(plane)), sets_(numbers_.count()) {
        has_levels_ = plane.extent.z > 1;
        open_sides_ = (is_periodic(boundaries.x) ? 0 : kLowX | kHighX) |
                      (is_periodic(boundaries.y) ? 0 : kLowY | kHighY) |
                      (is_periodic(boundaries.z) || !has_levels_ ? 0 : kLowZ | kHighZ);
        if (with_faces) shared_.resize(numbers_.count());
        join_around_x();
        const Extent& e = plane.extent;
        for (int k = 0; k < e.z; ++k) {
            join_rows_of_level(k, neighbours);
            if (has_levels_ && (k + 1 < e.z || is_periodic(boundaries.z)))
                join(k * e.y, (k + 1) % e.z * e.y, std::size_t(e.y), 0);
        }
        clouds_ = sets_.number(cloud_);
    }

    // Centroids stay 0 where they are not asked for.
    std::vector<ConnectedCloud> clouds(bool with_centroids) const;

    LabelledClouds labelled(BitPlane shadow) && {
        std::vector<std::uint8_t> cut(clouds_, 0);
        if (open_sides_ != 0) mark_cut(cut);
        return {std::move(shadow), std::move(numbers_), std::move(cloud_), std::move(cut)};
    }

  private:
    std::uint32_t first(std::size_t row) const { return numbers_.rows[row]; }
    std::uint32_t last(std::size_t row) const { return numbers_.rows[row + 1]; }
    bool covers(std::size_t row, int i) const {
        return (plane_.words[row * plane_.words_per_row + std::size_t(i) / 64] >> (i % 64) & 1) != 0;
    }

    // The westernmost and the easternmost run of a row, where x is periodic.
    void join_around_x() {
        if (!is_periodic(boundaries_.x)) return;
        for (std::size_t row = 0; row + 1 < numbers_.rows.size(); ++row) {
            if (!covers(row, 0) || !covers(row, plane_.extent.x - 1)) continue;
            sets_.unite(first(row), last(row) - 1);
            if (!shared_.empty()) shared_[first(row)] += 2;
        }
    }

    void join_rows_of_level(int k, Neighbours neighbours) {
        const int ny = plane_.extent.y, low = k * ny;
        const auto join_north = [&](int row, int north, int count) {
            join(row, north, std::size_t(count), 0);
            if (neighbours == Neighbours::four) return;
            join(row, north, std::size_t(count), 1);
            join(row, north, std::size_t(count), -1);
        };
        join_north(low, low + 1, ny - 1);
        if (is_periodic(boundaries_.y)) join_north(low + ny - 1, low, 1);
    }

    // Rows that lie side by side; a shift joins corners.
    void join(int one, int other, std::size_t count, int shift) {
        const std::span<const RunOverlap> overlaps =
            finder_.find({plane_, numbers_, std::size_t(one)}, {plane_, numbers_, std::size_t(other)}, count,
                         shift, boundaries_.x);
        for (const RunOverlap& overlap : overlaps) sets_.unite(overlap.one, overlap.other);
        if (shift != 0 || shared_.empty()) return;
        for (const RunOverlap& overlap : overlaps) shared_[overlap.one] += 2 * overlap.cells;
    }

    // Sides of the box that the cells of a row lie at, but for those of x.
    unsigned sides_of_row(int j, int k) const {
        const Extent& e = plane_.extent;
        return (j == 0 ? kLowY : 0) | (j + 1 == e.y ? kHighY : 0) | (k == 0 ? kLowZ : 0) |
               (k + 1 == e.z ? kHighZ : 0);
    }

    void mark_cut(std::vector<std::uint8_t>& cut) const {
        for (int j = 0; j < plane_.extent.y; ++j) {
            const auto row = std::size_t(j);
            if ((open_sides_ & kLowX) != 0) {
                if (covers(row, 0)) cut[cloud_[first(row)]] = 1;
                if (covers(row, plane_.extent.x - 1)) cut[cloud_[last(row) - 1]] = 1;
            }
            if ((sides_of_row(j, 0) & open_sides_) == 0) continue;
            for (std::uint32_t run = first(row); run < last(row); ++run) cut[cloud_[run]] = 1;
        }
    }

    BitPlaneView plane_;
    Boundaries boundaries_;
    RunNumbers numbers_;
    Sets sets_;
    OverlapFinder finder_;
    bool has_levels_;
    unsigned open_sides_;
    std::vector<int> shared_;           // of each run, or empty: faces towards other cells, those of both sides counted
    std::vector<std::uint32_t> cloud_;  // of each run
    std::uint32_t clouds_ = 0;
};

// Holds sums of positions, of a cloud of several cells.
struct Sums {
    std::uint32_t cloud;
    std::array<double, 2> x{}, y{}, z{};
};

// The centroids of clouds whose runs are given one after the other.
class Centroids {
  public:
    Centroids(const Extent& extent, const Boundaries& boundaries, std::size_t clouds)
        : has_levels_(extent.z > 1),
          x_(extent.x, is_periodic(boundaries.x)),
          y_(extent.y, is_periodic(boundaries.y)),
          z_(extent.z, is_periodic(boundaries.z)),
          place_(clouds, kNone) {
        sums_.reserve(clouds);  // at once: growing takes three times as much, and clouds_2d_bytes() counts it
    }

    // All of a cloud of one cell.
    void put_cell(ConnectedCloud& cloud, int i, int j, int k) {
        cloud.x = x_.mean_of_cell(i);
        cloud.y = y_.mean_of_cell(j);
        if (has_levels_) cloud.z = z_.mean_of_cell(k);
    }
    void add(std::uint32_t cloud, const CellRun& run, int j, int k) {
        if (place_[cloud] == kNone) {
            place_[cloud] = std::uint32_t(sums_.size());
            sums_.push_back({cloud});
        }
        Sums& sum = sums_[place_[cloud]];
        const double weight = run.end - run.begin;
        x_.add(sum.x, run.begin, run.end, 1);
        y_.add(sum.y, j, j + 1, weight);
        z_.add(sum.z, k, k + 1, weight);
    }
    void put_sums(std::vector<ConnectedCloud>& clouds) const {
        for (const Sums& sum : sums_) {
            ConnectedCloud& cloud = clouds[sum.cloud];
            const double cells = double(cloud.cells);
            cloud.x = x_.mean(sum.x, cells);
            cloud.y = y_.mean(sum.y, cells);
            if (has_levels_) cloud.z = z_.mean(sum.z, cells);
        }
    }

  private:
    bool has_levels_;
    Centre x_, y_, z_;
    std::vector<std::uint32_t> place_;  // of the sums of each cloud
    std::vector<Sums> sums_;
};

std::vector<ConnectedCloud> Labelling::clouds(bool with_centroids) const {
    const Extent& e = plane_.extent;
    const std::vector<CellRun> runs = runs_of(plane_, numbers_);
    std::vector<ConnectedCloud> clouds(clouds_);
    std::vector<std::uint8_t> sides(clouds_, 0);
    std::optional<Centroids> centroids;
    std::vector<std::uint32_t> runs_of_cloud;
    if (with_centroids) {
        centroids.emplace(e, boundaries_, clouds_);
        runs_of_cloud.resize(clouds_);
        for (const std::uint32_t number : cloud_) ++runs_of_cloud[number];
    }
    const int open_x = (open_sides_ & kLowX) != 0;
    std::size_t row = 0;
    for (int k = 0; k < e.z; ++k) {
        for (int j = 0; j < e.y; ++j, ++row) {
            const unsigned row_sides = sides_of_row(j, k);
            const int faces = (has_levels_ ? 4 : 2) - count_sides(row_sides & open_sides_);
            for (std::uint32_t n = first(row); n < last(row); ++n) {
                const CellRun run = runs[n];
                const std::uint32_t number = cloud_[n];
                ConnectedCloud& cloud = clouds[number];
                // The first run of a cloud or not: nobody can foretell it, so no branch.
                cloud.lowest = cloud.cells == 0 ? k : cloud.lowest;
                const int at_west = run.begin == 0, at_east = run.end == e.x, cells = run.end - run.begin;
                // Those between two runs are taken off one of the two: of the cloud all are.
                cloud.cells += std::uint64_t(cells);
                cloud.edges += std::uint64_t(
                    std::int64_t(faces) * cells + 2 - open_x * (at_west + at_east) - shared_[n]);
                cloud.highest = k;
                sides[number] = std::uint8_t(sides[number] | row_sides | (at_west ? kLowX : 0) |
                                             (at_east ? kHighX : 0));
                if (!centroids) continue;
                if (cells == 1 && runs_of_cloud[number] == 1) {
                    centroids->put_cell(cloud, run.begin, j, k);
                } else {
                    centroids->add(number, run, j, k);
                }
            }
        }
    }
    for (std::size_t n = 0; n < clouds.size(); ++n) {
        const unsigned open = sides[n] & open_sides_;
        const auto spans = [&](unsigned both) { return (open & both) == both; };
        clouds[n].cut = open != 0;
        clouds[n].spans = spans(kLowX | kHighX) || spans(kLowY | kHighY);
    }
    if (centroids) centroids->put_sums(clouds);
    return clouds;
}

std::vector<ConnectedCloud> clouds_of_shadow(const BitPlaneView& cld, const Boundaries& boundaries,
                                             Neighbours neighbours, bool with_centroids) {
    const BitPlane shadow = shadow_of(cld);
    return Labelling(shadow.view(), {boundaries.x, boundaries.y, Boundary::open}, neighbours)
        .clouds(with_centroids);
}

}  // namespace

std::vector<ConnectedCloud> clouds_2d(const BitPlaneView& cld, const Boundaries& boundaries,
                                      Neighbours neighbours) {
    return clouds_of_shadow(cld, boundaries, neighbours, true);
}

std::uint64_t count_shadow_runs(const BitPlaneView& cld) {
    const BitPlane shadow = shadow_of(cld);
    const BitPlaneView plane = shadow.view();
    std::uint64_t runs = 0;
    for (int j = 0; j < plane.extent.y; ++j) {
        const std::uint64_t* row = plane.row(j, 0);
        std::uint64_t carry = 0;  // the last column of the word before
        for (std::size_t w = 0; w < plane.words_per_row; ++w) {
            runs += std::uint64_t(std::popcount(row[w] & ~(row[w] << 1 | carry)));
            carry = row[w] >> 63;
        }
    }
    return runs;
}

std::size_t clouds_2d_bytes(const Extent& extent, std::uint64_t runs) {
    // Root, faces and cloud of a run, the run, and what it shares with the row beside it, with room for twice as many; then
    // those of clouds, of which those of several cells have sums. Less is alive in organisation().
    constexpr std::size_t kOfRun = 3 * sizeof(std::uint32_t) + sizeof(CellRun) + 2 * sizeof(RunOverlap),
                          kOfCloud = sizeof(ConnectedCloud) + sizeof(std::uint8_t) +
                                     2 * sizeof(std::uint32_t) + sizeof(Sums);
    // The shadow, its first cells of runs, and the runs before each word.
    const std::size_t plane = BitPlane::bytes({extent.x, extent.y, 1});
    return plane * 2 + plane / 2 + std::size_t(extent.y) * sizeof(std::uint32_t) +
           std::size_t(runs) * (kOfRun + kOfCloud);
}

std::vector<ConnectedCloud> cloud_sizes_2d(const BitPlaneView& cld, const Boundaries& boundaries) {
    return clouds_of_shadow(cld, boundaries, Neighbours::four, false);
}

std::vector<ConnectedCloud> clouds_3d(const BitPlaneView& cld, const Boundaries& boundaries) {
    return Labelling(cld, boundaries, Neighbours::four).clouds(true);
}

LabelledClouds labelled_clouds_2d(const BitPlaneView& cld, const Boundaries& boundaries) {
    BitPlane shadow = shadow_of(cld);
    Labelling labelling(shadow.view(), {boundaries.x, boundaries.y, Boundary::open}, Neighbours::four, false);
    return std::move(labelling).labelled(std::move(shadow));
}

}  // namespace nephos
