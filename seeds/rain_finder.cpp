// SPDX-License-Identifier: Apache-2.0
#include "seeds/rain_finder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/bytes.h"
#include "seeds/checks.h"

namespace nephos {
namespace {

constexpr std::uint32_t kStateMark = 0x31524e46;  // "FNR1"

// Sums over 2 radius + 1 neighbours along one line of columns; beyond open ends there is no water.
void sum_line(const std::uint32_t* in, std::uint32_t* out, int n, std::size_t stride, int radius,
              bool periodic) {
    const auto at = [&](int i) -> std::uint32_t {
        if (i < 0 || i >= n) {
            if (!periodic) return 0;
            i = (i % n + n) % n;
        }
        return in[std::size_t(i) * stride];
    };
    std::uint32_t sum = 0;
    for (int i = -radius; i <= radius; ++i) sum += at(i);
    for (int i = 0; i < n; ++i) {
        out[std::size_t(i) * stride] = sum;
        sum += at(i + radius + 1) - at(i - radius);  // unsigned: wraps and comes back
    }
}

void smooth(std::vector<std::uint32_t>& water, Extent e, const Boundaries& b, int radius) {
    if (radius == 0) return;
    std::vector<std::uint32_t> other(water.size());
    for (int j = 0; j < e.y; ++j) {
        const std::size_t row = linear_index(e, 0, j, 0);
        sum_line(&water[row], &other[row], e.x, 1, radius, b.x == Boundary::periodic);
    }
    for (int i = 0; i < e.x; ++i) {
        sum_line(&other[std::size_t(i)], &water[std::size_t(i)], e.y, std::size_t(e.x), radius,
                 b.y == Boundary::periodic);
    }
}

// Sums over the columns of a patch, in cells from its first column.
struct Sums {
    double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0, water = 0;
    bool starts = false;  // one of them has water enough to start rain
};

// A column, unwrapped: it keeps counting through a periodic side.
struct Column {
    int i, j;
};

// Smoothed water of the columns that are in no patch yet; 0 = taken.
struct WaterMap {
    Extent extent;
    Boundaries boundaries;
    std::vector<std::uint32_t> water;  // sums over the smoothing square
    double keep, start;                // thresholds in the same unit, above 0
    std::vector<Column> queue;         // of the patch at hand

    bool is_wet(std::uint32_t sum) const { return sum >= keep; }
};

// Wraps an index into 0..n-1; -1 for outside of an open axis.
int inside(int i, int n, Boundary boundary) {
    if (i >= 0 && i < n) return i;
    return boundary == Boundary::periodic ? (i % n + n) % n : -1;
}

// Takes all wet columns that hang together with the wet column (i0, j0).
Sums take_patch(WaterMap& map, int i0, int j0) {
    Sums sums;
    const auto visit = [&](int i, int j) {
        const int wi = inside(i, map.extent.x, map.boundaries.x),
                  wj = inside(j, map.extent.y, map.boundaries.y);
        if (wi < 0 || wj < 0) return;
        std::uint32_t& here = map.water[linear_index(map.extent, wi, wj, 0)];
        if (!map.is_wet(here)) return;
        const double x = i - i0, y = j - j0;
        sums.n += 1;
        sums.x += x;
        sums.y += y;
        sums.xx += x * x;
        sums.xy += x * y;
        sums.yy += y * y;
        sums.water += here;
        sums.starts = sums.starts || here >= map.start;
        here = 0;
        map.queue.push_back({i, j});
    };
    map.queue.clear();
    visit(i0, j0);
    for (std::size_t q = 0; q < map.queue.size(); ++q) {
        const Column c = map.queue[q];
        for (int dj = -1; dj <= 1; ++dj) {
            for (int di = -1; di <= 1; ++di) visit(c.i + di, c.j + dj);
        }
    }
    return sums;
}

RainPatch patch_of(const Sums& s, int first_i, int first_j, const Placement& placement, double water_scale) {
    const double h = placement.cell_size_m;
    const double mx = s.x / s.n, my = s.y / s.n;
    // A column is a square, not a point: 1/12 of its area more variance.
    return {placement.origin_m.x + (first_i + mx + 0.5) * h,
            placement.origin_m.y + (first_j + my + 0.5) * h,
            (s.xx / s.n - mx * mx + 1.0 / 12) * h * h,
            (s.xy / s.n - mx * my) * h * h,
            (s.yy / s.n - my * my + 1.0 / 12) * h * h,
            s.n * h * h,
            s.water / s.n * water_scale,
            s.starts};
}

// Radius of the circle with the patch's mean variance: how near is near.
double mean_radius(const RainPatch& p) { return 2 * std::sqrt(std::max(0.0, (p.xx_m2 + p.yy_m2) / 2)); }

RainArea ellipse_of(const RainPatch& p) {
    const double mean = (p.xx_m2 + p.yy_m2) / 2, half = (p.xx_m2 - p.yy_m2) / 2;
    const double root = std::sqrt(half * half + p.xy_m2 * p.xy_m2);
    const double large = mean + root, small = std::max(mean - root, 1e-3 * large);
    RainArea area;
    area.x_m = p.x_m;
    area.y_m = p.y_m;
    area.semi_a_m = 2 * std::sqrt(large);
    area.semi_b_m = 2 * std::sqrt(small);
    // Eigenvector of the larger variance, from the row of the matrix that does not cancel.
    const double ax = half >= 0 ? half + root : p.xy_m2, ay = half >= 0 ? p.xy_m2 : root - half;
    const double length = std::sqrt(ax * ax + ay * ay);
    if (length > 1e-9 * large) {
        const double sign = ax < 0 || (ax == 0 && ay < 0) ? -1 : 1;
        area.axis_x = sign * ax / length;
        area.axis_y = sign * ay / length;
    }
    return area;
}

}  // namespace

void check(const RainFinderOptions& o) {
    const std::string where = "rain found in the automaton";
    require_positive(where + ": water that starts it (m)", o.start_water_m);
    require_positive(where + ": water that keeps it (m)", o.keep_water_m);
    require_in(where + ": water that keeps it (m)", o.keep_water_m, 0, o.start_water_m);
    require_in(where + ": smoothing (columns)", o.smooth_columns, 0, 64);
    require_in(where + ": smallest area (m2)", o.min_area_m2, 0, 1e15);
    require_in(where + ": number of areas", o.max_areas, 1, 4096);
    require_positive(where + ": rain per metre (mm/h)", o.mm_per_h_per_m);
    require_positive(where + ": strongest rain (mm/h)", o.max_mm_per_h);
    require_in(where + ": response (s)", o.respond_s, 0, 1e9);
    require_in(where + ": fade (s)", o.fade_s, 0, 1e9);
    require_positive(where + ": listed until (mm/h)", o.report_until_mm_per_h);
    require_in(where + ": listed until (mm/h)", o.report_until_mm_per_h, 0, o.report_from_mm_per_h);
    require_in(where + ": listed from (mm/h)", o.report_from_mm_per_h, 0, 1e3);
}

std::vector<std::uint32_t> column_counts(const BitPlaneView& cld) {
    const Extent e = cld.extent;
    std::vector<std::uint32_t> counts(std::size_t(e.x) * std::size_t(e.y));
    for (int j = 0; j < e.y; ++j) {
        for (std::size_t w = 0; w < cld.words_per_row; ++w) {
            // 64 columns at once: plane b of `digit` is bit b of each column's count.
            std::array<std::uint64_t, 17> digit{};
            for (int k = 0; k < e.z; ++k) {
                std::uint64_t carry = cld.row(j, k)[w];
                for (std::size_t b = 0; carry != 0; ++b) {
                    const std::uint64_t both = digit[b] & carry;
                    digit[b] ^= carry;
                    carry = both;
                }
            }
            const int first = int(w) * 64, n = std::min(64, e.x - first);
            std::uint32_t* out = &counts[linear_index(e, first, j, 0)];
            for (std::size_t b = 0; b < digit.size(); ++b) {
                if (digit[b] == 0) continue;
                for (int i = 0; i < n; ++i) out[i] += std::uint32_t(digit[b] >> i & 1u) << b;
            }
        }
    }
    return counts;
}

std::vector<RainPatch> find_patches(const BitPlaneView& cld, const Placement& placement,
                                    const Boundaries& boundaries, const RainFinderOptions& options) {
    std::vector<std::uint32_t> water = column_counts(cld);
    smooth(water, cld.extent, boundaries, options.smooth_columns);
    constexpr double kLeast = std::numeric_limits<double>::denorm_min();
    const double edge = 2.0 * options.smooth_columns + 1;
    const double scale = placement.cell_size_m / (edge * edge);
    WaterMap map{// Above 0 whatever the unit: a column without water is in no patch.
                 cld.extent,
                 boundaries,
                 std::move(water),
                 std::max(options.keep_water_m / scale, kLeast),
                 std::max(options.start_water_m / scale, kLeast),
                 {}};
    std::vector<RainPatch> patches;
    for (int j = 0; j < cld.extent.y; ++j) {
        for (int i = 0; i < cld.extent.x; ++i) {
            if (!map.is_wet(map.water[linear_index(cld.extent, i, j, 0)])) continue;
            const Sums sums = take_patch(map, i, j);
            const RainPatch patch = patch_of(sums, i, j, placement, scale);
            if (patch.area_m2 >= options.min_area_m2) patches.push_back(patch);
        }
    }
    std::ranges::stable_sort(patches, std::ranges::greater{}, &RainPatch::area_m2);
    if (patches.size() > std::size_t(options.max_areas)) patches.resize(std::size_t(options.max_areas));
    return patches;
}

RainFinder::RainFinder(const RainFinderOptions& options, Extent extent, const Placement& placement,
                       const Boundaries& boundaries, std::uint32_t layer)
    : options_(options), extent_(extent), placement_(placement), boundaries_(boundaries), layer_(layer) {
    check(options_);
    require_positive("rain found in the automaton: cell size (m)", placement_.cell_size_m);
}

// Returns a difference of positions, across a periodic side if that is nearer.
double RainFinder::wrapped(double difference_m, bool along_x) const {
    if ((along_x ? boundaries_.x : boundaries_.y) != Boundary::periodic) return difference_m;
    const double period = (along_x ? extent_.x : extent_.y) * placement_.cell_size_m;
    return difference_m - period * std::floor(difference_m / period + 0.5);
}

double RainFinder::target_mm_per_h(const RainPatch& patch) const {
    return std::min(patch.water_m * options_.mm_per_h_per_m, options_.max_mm_per_h);
}

// Returns for each patch the index of the track that it continues, -1 for none.
std::vector<int> RainFinder::match(const std::vector<RainPatch>& patches) const {
    struct Pair {
        double distance2;  // relative to the two radii
        int track, patch;
    };
    std::vector<Pair> pairs;
    for (int t = 0; t < int(tracks_.size()); ++t) {
        const RainPatch& a = tracks_[std::size_t(t)].shape;
        for (int p = 0; p < int(patches.size()); ++p) {
            const RainPatch& b = patches[std::size_t(p)];
            const double dx = wrapped(b.x_m - a.x_m, true), dy = wrapped(b.y_m - a.y_m, false);
            const double reach = mean_radius(a) + mean_radius(b);
            const double distance2 = (dx * dx + dy * dy) / (reach * reach);
            if (distance2 < 1) pairs.push_back({distance2, t, p});
        }
    }
    std::ranges::stable_sort(pairs, {}, &Pair::distance2);
    std::vector<int> track_of(patches.size(), -1);
    std::vector<bool> taken(tracks_.size(), false);
    for (const Pair& pair : pairs) {
        if (taken[std::size_t(pair.track)] || track_of[std::size_t(pair.patch)] >= 0) continue;
        taken[std::size_t(pair.track)] = true;
        track_of[std::size_t(pair.patch)] = pair.track;
    }
    return track_of;
}

void RainFinder::follow(const std::vector<RainPatch>& patches, const std::vector<int>& track_of,
                        double elapsed_s) {
    const auto fraction = [&](double constant_s) {
        return constant_s > 0 ? elapsed_s / (constant_s + elapsed_s) : 1.0;
    };
    const double follow = fraction(options_.respond_s), fade = fraction(options_.fade_s);
    std::vector<bool> found(tracks_.size(), false);
    for (std::size_t p = 0; p < patches.size(); ++p) {
        const RainPatch& patch = patches[p];
        if (track_of[p] < 0) {
            if (!patch.starts) continue;
            tracks_.push_back({next_number_++, patch, target_mm_per_h(patch) * follow, false});
            found.push_back(true);
            continue;
        }
        Track& t = tracks_[std::size_t(track_of[p])];
        found[std::size_t(track_of[p])] = true;
        t.shape.x_m += follow * wrapped(patch.x_m - t.shape.x_m, true);
        t.shape.y_m += follow * wrapped(patch.y_m - t.shape.y_m, false);
        t.shape.xx_m2 += follow * (patch.xx_m2 - t.shape.xx_m2);
        t.shape.xy_m2 += follow * (patch.xy_m2 - t.shape.xy_m2);
        t.shape.yy_m2 += follow * (patch.yy_m2 - t.shape.yy_m2);
        t.intensity_mm_per_h += follow * (target_mm_per_h(patch) - t.intensity_mm_per_h);
    }
    std::size_t kept = 0;
    for (std::size_t t = 0; t < tracks_.size(); ++t) {
        Track& track = tracks_[t];
        if (!found[t]) track.intensity_mm_per_h -= fade * track.intensity_mm_per_h;
        track.listed = track.intensity_mm_per_h >=
                       (track.listed ? options_.report_until_mm_per_h : options_.report_from_mm_per_h);
        if (found[t] || track.listed) tracks_[kept++] = track;
    }
    tracks_.resize(kept);
}

void RainFinder::update(const BitPlaneView& cld, double elapsed_s, double moved_x_m, double moved_y_m) {
    if (cld.extent != extent_) {
        usage_error("rain found in the automaton: the lattice has " + std::to_string(cld.extent.x) + " x " +
                    std::to_string(cld.extent.y) + " x " + std::to_string(cld.extent.z) +
                    " cells, expected " + std::to_string(extent_.x) + " x " + std::to_string(extent_.y) +
                    " x " + std::to_string(extent_.z));
    }
    require_in("rain found in the automaton: elapsed time (s)", elapsed_s, 0, 1e9);
    require_in("rain found in the automaton: way of the wind (m)", moved_x_m, -1e12, 1e12);
    require_in("rain found in the automaton: way of the wind (m)", moved_y_m, -1e12, 1e12);
    const double middle_x = placement_.origin_m.x + extent_.x * placement_.cell_size_m / 2;
    const double middle_y = placement_.origin_m.y + extent_.y * placement_.cell_size_m / 2;
    for (Track& t : tracks_) {
        t.shape.x_m = middle_x + wrapped(t.shape.x_m + moved_x_m - middle_x, true);
        t.shape.y_m = middle_y + wrapped(t.shape.y_m + moved_y_m - middle_y, false);
    }
    std::vector<RainPatch> patches = find_patches(cld, placement_, boundaries_, options_);
    for (RainPatch& p : patches) {
        p.x_m = middle_x + wrapped(p.x_m - middle_x, true);
        p.y_m = middle_y + wrapped(p.y_m - middle_y, false);
    }
    follow(patches, match(patches), elapsed_s);
}

std::vector<RainArea> RainFinder::areas() const {
    std::vector<RainArea> result;
    for (const Track& t : tracks_) {
        if (!t.listed) continue;
        result.push_back(ellipse_of(t.shape));
        result.back().id = rain_id(RainSource::found, layer_, 0, t.number);
        result.back().intensity_mm_per_h = t.intensity_mm_per_h;
    }
    return result;
}

std::vector<std::byte> RainFinder::save() const {
    ByteWriter out;
    out.put(kStateMark);
    out.put(next_number_);
    out.put(std::uint64_t(tracks_.size()));
    for (const Track& t : tracks_) {
        out.put(t.number);
        out.put(std::uint8_t(t.listed));
        for (double v :
             {t.shape.x_m, t.shape.y_m, t.shape.xx_m2, t.shape.xy_m2, t.shape.yy_m2, t.intensity_mm_per_h}) {
            out.put(v);
        }
    }
    return out.take();
}

void RainFinder::restore(std::span<const std::byte> bytes) {
    const auto bad = [](const char* what) {
        throw Error(ErrorCode::io, std::string("saved rain areas: ") + what);
    };
    ByteReader in(bytes);
    if (in.get<std::uint32_t>() != kStateMark) bad("not the state of rain areas");
    const auto next = in.get<std::uint32_t>();
    std::vector<Track> tracks;
    for (auto left = in.get<std::uint64_t>(); left > 0; --left) {
        Track t;
        t.number = in.get<std::uint32_t>();
        t.listed = in.get<std::uint8_t>() != 0;
        for (double* v : {&t.shape.x_m, &t.shape.y_m, &t.shape.xx_m2, &t.shape.xy_m2, &t.shape.yy_m2,
                          &t.intensity_mm_per_h}) {
            *v = in.get<double>();
            if (!std::isfinite(*v)) bad("a number of it is not finite");
        }
        if (t.number >= next) bad("an area of it is impossible");
        tracks.push_back(t);
    }
    if (!in.rest().empty()) bad("more bytes than expected");
    tracks_ = std::move(tracks);
    next_number_ = next;
}

}  // namespace nephos
