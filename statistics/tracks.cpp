// SPDX-License-Identifier: Apache-2.0
#include "statistics/tracks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "statistics/cloud_statistics.h"

namespace nephos {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr std::uint32_t kNone = ~std::uint32_t(0);

// The runs of the columns with cloud in the levels of one shift, and the cloud of the whole shadow that each belongs to.
struct Pieces {
    CellRuns runs;
    std::vector<std::uint32_t> cloud;
};

Pieces pieces_of_shift(const BitPlaneView& cld, const LabelledClouds& clouds,
                       std::span<const CellShift> shifts, const CellShift& shift) {
    BitPlane part({cld.extent.x, cld.extent.y, 1});
    for (int k = 0; k < cld.extent.z; ++k) {
        if (!(shifts[std::size_t(k)] == shift)) continue;
        for (int j = 0; j < cld.extent.y; ++j)
            for (std::size_t w = 0; w < cld.words_per_row; ++w) part.row(j, 0)[w] |= cld.row(j, k)[w];
    }
    Pieces pieces{runs_of(part.view()), {}};
    for (std::size_t row = 0; row + 1 < pieces.runs.rows.size(); ++row) {
        std::size_t whole = clouds.shadow.rows[row];
        for (std::size_t n = pieces.runs.rows[row]; n < pieces.runs.rows[row + 1]; ++n) {
            while (clouds.shadow.runs[whole].end <= pieces.runs.runs[n].begin) ++whole;
            pieces.cloud.push_back(clouds.cloud[whole]);
        }
    }
    return pieces;
}

// The place of a row or column after a shift; -1 beyond an open side.
int moved(std::int64_t at, std::int64_t by, int cells, Boundary boundary) {
    std::int64_t to = at + by;
    if (boundary == Boundary::periodic) return int((to % cells + cells) % cells);
    return to >= 0 && to < cells ? int(to) : -1;
}

// Sorts what a cloud shares by the cloud that it shares it with. Most share with one or two.
template <class Iterator>
void sort_by_cloud_now(Iterator first, Iterator last) {
    constexpr std::ptrdiff_t kFew = 12;
    if (last - first > kFew) {
        std::sort(first, last, [](const auto& a, const auto& b) { return a.now < b.now; });
        return;
    }
    for (auto one = first; one != last; ++one) {
        const auto moving = *one;
        auto to = one;
        for (; to != first && (to - 1)->now > moving.now; --to) *to = *(to - 1);
        *to = moving;
    }
}

}  // namespace

std::vector<Tracker::Shared> Tracker::shared_columns(const LabelledClouds& now,
                                                     std::span<const CellShift> shifts) const {
    const Extent extent = cld_.extent();
    std::vector<CellShift> different;
    for (const CellShift& shift : shifts)
        if (std::ranges::count(different, shift) == 0) different.push_back(shift);
    std::vector<Shared> shared;
    shared.reserve(clouds_.cloud.size() + now.cloud.size());
    std::vector<RunOverlap> overlaps(std::size_t(extent.x) + 2);
    const bool periodic = boundaries_.x == Boundary::periodic;
    for (const CellShift& shift : different) {
        const bool whole = different.size() == 1;
        const Pieces part = whole ? Pieces{} : pieces_of_shift(cld_.view(), clouds_, shifts, shift);
        const CellRuns& before = whole ? clouds_.shadow : part.runs;
        const std::vector<std::uint32_t>& cloud = whole ? clouds_.cloud : part.cloud;
        // Beyond an open side, and far beyond, nothing is shared.
        const int dx = int(std::clamp<std::int64_t>(
            periodic ? moved(0, shift.x, extent.x, Boundary::periodic) : shift.x, -extent.x, extent.x));
        for (int row = 0; row < extent.y; ++row) {
            const int to = moved(row, shift.y, extent.y, boundaries_.y);
            if (to < 0) continue;
            const std::uint32_t* cloud_now = now.cloud.data() + now.shadow.rows[std::size_t(to)];
            const std::uint32_t* cloud_before = cloud.data() + before.rows[std::size_t(row)];
            const auto meet = [&](int by) {
                const std::size_t count =
                    find_overlaps(now.shadow.of_row(to), before.of_row(row), by, 0, overlaps.data());
                for (std::size_t n = 0; n < count; ++n)
                    shared.push_back({cloud_before[overlaps[n].other], cloud_now[overlaps[n].one],
                                      std::uint64_t(overlaps[n].cells)});
            };
            meet(dx);
            if (periodic && dx != 0) meet(dx - extent.x);
        }
    }
    // By cloud before, and of each of those, which are few, by cloud now.
    std::vector<std::size_t> begins(clouds_.cut.size() + 1, 0);
    for (const Shared& one : shared) ++begins[one.before + 1];
    std::partial_sum(begins.begin(), begins.end(), begins.begin());
    std::vector<Shared> sorted(shared.size());
    std::vector<std::size_t> places(begins.begin(), begins.end() - 1);
    for (const Shared& one : shared) sorted[places[one.before]++] = one;
    std::vector<Shared> sums;
    sums.reserve(sorted.size());
    for (std::size_t n = 0; n + 1 < begins.size(); ++n) {
        const auto first = sorted.begin() + std::ptrdiff_t(begins[n]),
                   last = sorted.begin() + std::ptrdiff_t(begins[n + 1]);
        sort_by_cloud_now(first, last);
        for (auto one = first; one != last; ++one) {
            if (one != first && sums.back().now == one->now)
                sums.back().columns += one->columns;
            else
                sums.push_back(*one);
        }
    }
    return sums;
}

void Tracker::add(const BitPlaneView& cld, std::span<const CellShift> shifts) {
    LabelledClouds now = labelled_clouds_2d(cld, boundaries_);
    const std::size_t count = now.cut.size();
    std::vector<Track> current(count);
    std::vector<std::uint64_t> identity(count);
    std::vector<std::uint32_t> heir(clouds_.cut.size(), kNone), parent(count, kNone);
    if (states_ > 0) {
        std::vector<std::uint64_t> most_before(heir.size(), 0), most_now(count, 0);
        for (const Shared& s : shared_columns(now, shifts)) {
            if (s.columns > most_before[s.before]) {
                most_before[s.before] = s.columns;
                heir[s.before] = s.now;
            }
            if (s.columns > most_now[s.now] ||
                (s.columns == most_now[s.now] && identity_[s.before] < identity_[parent[s.now]])) {
                most_now[s.now] = s.columns;
                parent[s.now] = s.before;
            }
        }
        for (std::size_t n = 0; n < heir.size(); ++n) {
            if (heir[n] != kNone && parent[heir[n]] == n) continue;
            current_[n].end = heir[n] == kNone ? TrackEnd::death : TrackEnd::merger;
            ended_.push_back(current_[n]);
        }
    }
    for (std::size_t n = 0; n < count; ++n) {
        if (parent[n] != kNone && heir[parent[n]] == n) {
            current[n] = current_[parent[n]];
            identity[n] = identity_[parent[n]];
        } else {
            current[n].first = states_;
            if (states_ > 0)
                current[n].begin = parent[n] != kNone ? TrackBegin::split
                                   : now.cut[n] != 0  ? TrackBegin::entered
                                                      : TrackBegin::birth;
            identity[n] = next_identity_++;
        }
        current[n].last = states_;
        if (now.cut[n] != 0 && current[n].cut == Track::kNever) current[n].cut = states_;
    }
    if (cld_.extent() != cld.extent) cld_ = BitPlane(cld.extent);
    std::copy_n(cld.words, cld.word_count(), cld_.words().begin());
    clouds_ = std::move(now);
    current_ = std::move(current);
    identity_ = std::move(identity);
    ++states_;
}

std::vector<Track> Tracker::tracks() const {
    std::vector<Track> all = ended_;
    all.insert(all.end(), current_.begin(), current_.end());
    return all;
}

TrackStatistics track_statistics(std::span<const Track> tracks, std::uint64_t first, std::uint64_t last) {
    TrackStatistics result{.mean = kNaN, .mean_error = kNaN, .median = kNaN};
    std::vector<std::uint64_t> deaths, censored;  // numbers of tracks by age in steps
    const auto count = [&](std::vector<std::uint64_t>& ages, std::uint64_t age) {
        if (ages.size() <= age) ages.resize(age + 1);
        ++ages[age];
    };
    for (const Track& track : tracks) {
        if (track.last >= first && track.last < last) {
            result.deaths += track.end == TrackEnd::death;
            result.mergers += track.end == TrackEnd::merger;
        }
        if (track.first <= first || track.first > last) continue;
        result.births += track.begin == TrackBegin::birth;
        result.splits += track.begin == TrackBegin::split;
        result.entered += track.begin == TrackBegin::entered;
        if (track.begin == TrackBegin::first_state || track.begin == TrackBegin::entered ||
            track.cut == track.first)
            continue;
        ++result.tracks;
        // It is there in the states first .. last, so it lived at least last - first + 1 steps, or exactly so many if it died;
        // of a censored one it is not known whether it reached the end of that step.
        const bool died = track.end == TrackEnd::death && track.last < last && track.cut == Track::kNever;
        if (died) {
            count(deaths, track.last - track.first + 1);
        } else {
            ++result.censored;
            const std::uint64_t seen = std::min<std::uint64_t>({track.last, last, track.cut});
            count(censored, seen - track.first);
        }
    }
    if (result.tracks == 0) return result;
    const std::size_t ages = std::max(deaths.size(), censored.size());
    deaths.resize(ages);
    censored.resize(ages);
    result.longest = ages - 1;
    // survival[t] = S(t); between t and t + 1 it is constant.
    std::vector<double> survival(ages), greenwood(ages);
    std::uint64_t at_risk = result.tracks;
    double s = 1;
    for (std::size_t t = 0; t < ages; ++t) {
        if (deaths[t] > 0) {
            const double n = double(at_risk), d = double(deaths[t]);
            s *= 1 - d / n;
            greenwood[t] = n > d ? d / (n * (n - d)) : 0;
        }
        survival[t] = s;
        if (s <= 0.5 && std::isnan(result.median)) result.median = double(t);
        at_risk -= deaths[t] + censored[t];
    }
    // The area under S from 0 to the greatest age, and the part of it beyond each age.
    double area = 0, variance = 0;
    for (std::size_t t = ages; t-- > 0;) {
        if (t + 1 < ages) area += survival[t];
        variance += area * area * greenwood[t];
    }
    const std::uint64_t died = result.tracks - result.censored;
    result.restricted = s > 0;
    if (died > 0) result.mean = area;
    if (died > 1) result.mean_error = std::sqrt(variance);
    return result;
}

}  // namespace nephos
