// SPDX-License-Identifier: Apache-2.0
#include "statistics/tracks.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "statistics/cloud_statistics.h"

namespace nephos {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr std::uint32_t kNone = ~std::uint32_t(0);

// The columns with cloud in the levels of one shift.
BitPlane shadow_of_shift(const BitPlaneView& cld, std::span<const CellShift> shifts, const CellShift& shift) {
    BitPlane part({cld.extent.x, cld.extent.y, 1});
    const std::span<std::uint64_t> to = part.words();
    for (int k = 0; k < cld.extent.z; ++k) {
        if (!(shifts[std::size_t(k)] == shift)) continue;
        const std::uint64_t* level = cld.row(0, k);
        for (std::size_t n = 0; n < to.size(); ++n) to[n] |= level[n];
    }
    return part;
}

// Rows of the step before, and where they lie now.
struct MovedRows {
    int before, now, count;
};

// Cuts the rows of a level, moved by `shift`, where they wrap around or leave the box.
std::vector<MovedRows> moved_rows(int rows, std::int64_t shift, Boundary boundary) {
    if (boundary == Boundary::periodic) {
        const int to = int((shift % rows + rows) % rows);
        return {{0, to, rows - to}, {rows - to, 0, to}};
    }
    if (shift <= -rows || shift >= rows) return {};
    const int way = int(shift);
    return {{std::max(0, -way), std::max(0, way), rows - std::abs(way)}};
}

// Cells along x; beyond an open side, and far beyond, nothing is shared.
int moved_columns(int columns, std::int64_t shift, Boundary boundary) {
    if (boundary == Boundary::periodic) return int((shift % columns + columns) % columns);
    return int(std::clamp<std::int64_t>(shift, -columns, columns));
}

// Spreads pairs of clouds over 64 bits (the finaliser of MurmurHash3).
std::uint64_t mixed(std::uint64_t pair) {
    pair = (pair ^ pair >> 33) * 0xff51afd7ed558ccd;
    return pair ^ pair >> 33;
}

// Sums up the columns of equal pairs of clouds; their order is any.
std::vector<SharedColumns> summed(std::span<const SharedColumns> shared) {
    std::vector<std::uint32_t> places(std::bit_ceil(2 * shared.size() + 1), kNone);
    const std::size_t last = places.size() - 1;
    std::vector<SharedColumns> sums;
    sums.reserve(shared.size());
    for (const SharedColumns& one : shared) {
        std::size_t at = mixed(std::uint64_t(one.before) << 32 | one.now) & last;
        while (places[at] != kNone && (sums[places[at]].before != one.before || sums[places[at]].now != one.now))
            at = (at + 1) & last;
        if (places[at] == kNone) {
            places[at] = std::uint32_t(sums.size());
            sums.push_back(one);
        } else {
            sums[places[at]].columns += one.columns;
        }
    }
    return sums;
}

// For clouds of one step those of the other that they share columns with: the only one, or that there are several.
class Partners {
  public:
    explicit Partners(std::size_t clouds) : only(clouds, kNone), several(clouds, 0) {}
    void meet(std::uint32_t cloud, std::uint32_t partner) {
        const std::uint32_t known = only[cloud];
        only[cloud] = std::min(known, partner);
        several[cloud] |= std::uint8_t((known != kNone) & (known != partner));
    }
    std::vector<std::uint32_t> only;  // the first in memory of several
    std::vector<std::uint8_t> several;
};

}  // namespace

// Moves the clouds of the step before, and returns what they share with those of now, in pieces.
std::vector<SharedColumns> Tracker::shared_columns(const LabelledClouds& now, std::span<const CellShift> shifts) {
    const Extent extent = cld_.extent();
    std::vector<CellShift> different;
    for (const CellShift& shift : shifts)
        if (std::ranges::count(different, shift) == 0) different.push_back(shift);
    std::vector<SharedColumns> shared;
    for (const CellShift& shift : different) {
        const bool whole = different.size() == 1;
        const BitPlane part = whole ? BitPlane() : shadow_of_shift(cld_.view(), shifts, shift);
        const BitPlaneView before = whole ? clouds_.shadow.view() : part.view();
        const int dx = moved_columns(extent.x, shift.x, boundaries_.x);
        for (const MovedRows& rows : moved_rows(extent.y, shift.y, boundaries_.y)) {
            const std::span<const RunOverlap> overlaps =
                finder_.find({now.shadow.view(), now.runs, std::size_t(rows.now)},
                             {before, clouds_.runs, std::size_t(rows.before)}, std::size_t(rows.count), dx,
                             boundaries_.x);
            shared.reserve(shared.size() + overlaps.size());
            for (const RunOverlap& overlap : overlaps)
                shared.push_back({clouds_.cloud[overlap.other], now.cloud[overlap.one],
                                  std::uint64_t(overlap.cells)});
        }
    }
    return shared;
}

// Most clouds meet one other at most: only where there are several does it matter how many columns they share.
Tracker::Choices Tracker::choose(std::span<const SharedColumns> shared, std::size_t clouds_now) const {
    Partners before(clouds_.cut.size()), now(clouds_now);
    for (const SharedColumns& s : shared) {
        before.meet(s.before, s.now);
        now.meet(s.now, s.before);
    }
    std::vector<SharedColumns> contested(shared.size());
    std::size_t count = 0;
    for (const SharedColumns& s : shared) {
        contested[count] = s;
        count += std::size_t(before.several[s.before] | now.several[s.now]);
    }
    contested.resize(count);
    std::vector<std::uint64_t> most_before(before.only.size(), 0), most_now(clouds_now, 0);
    Choices choices{std::move(before.only), std::move(now.only)};
    for (const SharedColumns& s : summed(contested)) {
        std::uint32_t &heir = choices.heir[s.before], &parent = choices.parent[s.now];
        if (s.columns > most_before[s.before] || (s.columns == most_before[s.before] && s.now < heir)) {
            most_before[s.before] = s.columns;
            heir = s.now;
        }
        if (s.columns > most_now[s.now] ||
            (s.columns == most_now[s.now] && identity_[s.before] < identity_[parent])) {
            most_now[s.now] = s.columns;
            parent = s.before;
        }
    }
    return choices;
}

void Tracker::add(const BitPlaneView& cld, std::span<const CellShift> shifts) {
    LabelledClouds now = labelled_clouds_2d(cld, boundaries_);
    const std::size_t count = now.cut.size();
    std::vector<Track> current(count);
    std::vector<std::uint64_t> identity(count);
    Choices choices{{}, std::vector<std::uint32_t>(count, kNone)};
    if (states_ > 0) choices = choose(shared_columns(now, shifts), count);
    const auto& [heir, parent] = choices;
    for (std::size_t n = 0; n < heir.size(); ++n) {
        if (heir[n] != kNone && parent[heir[n]] == n) continue;
        current_[n].end = heir[n] == kNone ? TrackEnd::death : TrackEnd::merger;
        ended_.push_back(current_[n]);
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
    // Products that are one half are rounded, by an epsilon a factor at most.
    const double half = 0.5 * (1 + 2 * double(ages) * std::numeric_limits<double>::epsilon());
    double s = 1;
    for (std::size_t t = 0; t < ages; ++t) {
        if (deaths[t] > 0) {
            const double n = double(at_risk), d = double(deaths[t]);
            s *= 1 - d / n;
            greenwood[t] = n > d ? d / (n * (n - d)) : 0;
        }
        survival[t] = s;
        if (s <= half && std::isnan(result.median)) result.median = double(t);
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
