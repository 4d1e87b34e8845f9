// SPDX-License-Identifier: Apache-2.0

// Tracks of clouds against a naive twin, lifetimes against a table by hand and against a scene whose answer is known.

#include "statistics/tracks.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <set>

#include <gtest/gtest.h>

#include "automaton/advection.h"
#include "automaton/automaton.h"
#include "tests/statistics/random_planes.h"

namespace nephos {
namespace {

// The number of the cloud over each column, counted in the order of first columns; -1 where it is clear.
struct Labels {
    std::vector<int> of_column;
    std::vector<bool> cut;
};

Labels labels_of(const BitPlane& cld, const Boundaries& b) {
    const Extent e = cld.extent();
    const auto covered = [&](int i, int j) {
        for (int k = 0; k < e.z; ++k)
            if (cld.get(i, j, k)) return true;
        return false;
    };
    Labels labels{std::vector<int>(std::size_t(e.x * e.y), -1), {}};
    for (int start = 0; start < e.x * e.y; ++start) {
        if (labels.of_column[std::size_t(start)] >= 0 || !covered(start % e.x, start / e.x)) continue;
        const int number = int(labels.cut.size());
        labels.cut.push_back(false);
        std::deque<int> open{start};
        labels.of_column[std::size_t(start)] = number;
        while (!open.empty()) {
            const int i = open.front() % e.x, j = open.front() / e.x;
            open.pop_front();
            for (const auto& [di, dj] : {std::pair(1, 0), {-1, 0}, {0, 1}, {0, -1}}) {
                const int x = test::neighbour(i, di, e.x, b.x), y = test::neighbour(j, dj, e.y, b.y);
                if (x < 0 || y < 0) {
                    labels.cut.back() = true;
                    continue;
                }
                int& there = labels.of_column[std::size_t(y * e.x + x)];
                if (there >= 0 || !covered(x, y)) continue;
                there = number;
                open.push_back(y * e.x + x);
            }
        }
    }
    return labels;
}

// The definition, column by column.
class NaiveTracker {
  public:
    explicit NaiveTracker(const Boundaries& b) : b_(b) {}

    void add(const BitPlane& cld, const std::vector<CellShift>& shifts) {
        const Labels now = labels_of(cld, b_);
        std::map<std::pair<int, int>, int> shared;
        if (state_ > 0) shared = shared_columns(now, shifts);
        std::vector<Open> open(now.cut.size());
        std::vector<bool> goes_on(open_.size(), false), shares(open_.size(), false);
        for (int n = 0; n < int(open.size()); ++n) {
            int best = -1;
            for (int m = 0; m < int(open_.size()); ++m) {
                const int columns = shared[{m, n}];
                if (columns == 0) continue;
                if (best < 0 || columns > shared[{best, n}] ||
                    (columns == shared[{best, n}] &&
                     open_[std::size_t(m)].age < open_[std::size_t(best)].age))
                    best = m;
                shares[std::size_t(m)] = true;
            }
            Open& one = open[std::size_t(n)];
            if (best >= 0 && heir(best, shared, int(open.size())) == n) {
                one = open_[std::size_t(best)];
                goes_on[std::size_t(best)] = true;
            } else {
                one.age = ages_++;
                one.track.first = state_;
                if (state_ > 0)
                    one.track.begin = best >= 0                 ? TrackBegin::split
                                      : now.cut[std::size_t(n)] ? TrackBegin::entered
                                                                : TrackBegin::birth;
            }
            one.track.last = state_;
            if (now.cut[std::size_t(n)]) one.track.cut = std::min(one.track.cut, state_);
        }
        for (std::size_t m = 0; m < open_.size(); ++m) {
            if (goes_on[m]) continue;
            Track track = open_[m].track;
            track.end = shares[m] ? TrackEnd::merger : TrackEnd::death;
            tracks.push_back(track);
        }
        open_ = open;
        before_ = cld;
        labels_ = now;
        ++state_;
    }
    std::vector<Track> all() const {
        std::vector<Track> result = tracks;
        for (const Open& one : open_) result.push_back(one.track);
        std::ranges::sort(result);
        return result;
    }

  private:
    struct Open {
        Track track;
        int age = 0;
    };
    static int heir(int m, std::map<std::pair<int, int>, int>& shared, int count) {
        int best = -1;
        for (int n = 0; n < count; ++n)
            if (shared[{m, n}] > (best < 0 ? 0 : shared[{m, best}])) best = n;
        return best;
    }
    std::map<std::pair<int, int>, int> shared_columns(const Labels& now,
                                                      const std::vector<CellShift>& shifts) {
        const Extent e = before_.extent();
        std::map<std::pair<int, int>, int> shared;
        std::set<std::pair<std::int64_t, std::int64_t>> different;
        for (const CellShift& shift : shifts) different.insert({shift.x, shift.y});
        for (const auto& [dx, dy] : different) {
            for (int j = 0; j < e.y; ++j) {
                for (int i = 0; i < e.x; ++i) {
                    bool any = false;
                    for (int k = 0; k < e.z; ++k)
                        any = any || (shifts[std::size_t(k)] == CellShift{dx, dy} && before_.get(i, j, k));
                    const int x = test::neighbour(i, int(dx), e.x, b_.x),
                              y = test::neighbour(j, int(dy), e.y, b_.y);
                    if (!any || x < 0 || y < 0) continue;
                    const int there = now.of_column[std::size_t(y * e.x + x)];
                    if (there >= 0) ++shared[{labels_.of_column[std::size_t(j * e.x + i)], there}];
                }
            }
        }
        return shared;
    }

    Boundaries b_;
    std::uint32_t state_ = 0;
    int ages_ = 0;
    BitPlane before_;
    Labels labels_;
    std::vector<Open> open_;
    std::vector<Track> tracks;
};

// States that the wind carries along, with some cells turned over: clouds go on, meet, fall apart, come and go.
TEST(Tracks, MatchTheNaiveTwin) {
    std::set<TrackBegin> begins;
    std::set<TrackEnd> ends;
    constexpr int kWidths[] = {1, 63, 64, 65, 128};
    constexpr double kDensities[] = {0.15, 0.02, 0.5, 0.9, 1};
    for (std::uint64_t seed = 1; seed <= 60; ++seed) {
        SCOPED_TRACE(seed);
        std::mt19937_64 random(seed);
        const int nx = seed % 4 == 0 ? kWidths[random() % 5] : int(random() % 90) + 5;
        const Extent extent{nx, int(random() % 16) + 1, int(random() % 8) + 1};
        const Boundaries b = test::random_boundaries(random);
        BitPlane cld = test::random_cells(extent, kDensities[seed % 5], random);
        Tracker tracker(b);
        NaiveTracker naive(b);
        std::vector<CellShift> shifts(std::size_t(extent.z));
        std::vector<std::uint64_t> scratch;
        for (int step = 0; step < 12; ++step) {
            tracker.add(cld.view(), shifts);
            naive.add(cld, shifts);
            const bool shear = seed % 2 == 0, far = seed % 7 == 0;
            const std::int64_t most = far ? 3 * extent.x : 2;
            const CellShift all{std::int64_t(random() % std::uint64_t(2 * most + 1)) - most, std::int64_t(random() % 3) - 1};
            for (int k = 0; k < extent.z; ++k) {
                CellShift& shift = shifts[std::size_t(k)] = all;
                if (shear) shift.x += k;
                shift_layer(cld, k, shift.x, shift.y, b, scratch);
            }
            const BitPlane born = test::random_cells(extent, 0.02, random),
                           dead = test::random_cells(extent, 0.25, random);
            for (std::size_t w = 0; w < cld.words().size(); ++w)
                cld.words()[w] = (cld.words()[w] & ~dead.words()[w]) | born.words()[w];
        }
        std::vector<Track> tracks = tracker.tracks();
        std::ranges::sort(tracks);
        EXPECT_EQ(tracks, naive.all());
        for (const Track& track : tracks) {
            begins.insert(track.begin);
            ends.insert(track.end);
        }
    }
    EXPECT_EQ(begins.size(), 4u);
    EXPECT_EQ(ends.size(), 3u);
}

// Levels of every second cell that the wind takes apart, under a shadow without a gap.
TEST(Tracks, PartsOfAShadowHaveMoreRunsThanIt) {
    for (const Boundary x : {Boundary::open, Boundary::periodic}) {
        const Extent extent{512, 8, 2};
        BitPlane cld(extent);
        for (int k = 0; k < 2; ++k)
            for (int j = 0; j < extent.y; ++j)
                for (int i = 0; i < extent.x; ++i) cld.set(i, j, k, i % 2 == k);
        const Boundaries b{x, Boundary::open, Boundary::open};
        Tracker tracker(b);
        NaiveTracker naive(b);
        const std::vector<CellShift> shifts{{0, 0}, {1, 0}};
        for (int step = 0; step < 3; ++step) {
            tracker.add(cld.view(), shifts);
            naive.add(cld, shifts);
        }
        std::vector<Track> tracks = tracker.tracks();
        std::ranges::sort(tracks);
        EXPECT_EQ(tracks, naive.all());
    }
}

// Deaths at the ages 1, 2 and 4, and one that merges and was seen to reach 2: by hand, after Kaplan and Meier.
TEST(Tracks, LifetimesAreThoseOfKaplanAndMeier) {
    const auto track = [](std::uint32_t first, std::uint32_t last, TrackEnd end) {
        return Track{first, last, Track::kNever, TrackBegin::birth, end};
    };
    std::vector<Track> tracks{track(5, 5, TrackEnd::death), track(6, 7, TrackEnd::death),
                              track(6, 8, TrackEnd::merger), track(3, 6, TrackEnd::death)};
    const TrackStatistics s = track_statistics(tracks, 0, 20);
    EXPECT_EQ(s.tracks, 4u);
    EXPECT_EQ(s.censored, 1u);
    EXPECT_EQ(s.births, 4u);
    EXPECT_EQ(s.deaths, 3u);
    EXPECT_EQ(s.mergers, 1u);
    EXPECT_EQ(s.longest, 4u);
    EXPECT_DOUBLE_EQ(s.mean, 1 + 0.75 + 0.5 + 0.5);
    EXPECT_DOUBLE_EQ(s.median, 2);
    EXPECT_NEAR(s.mean_error, std::sqrt(1.75 * 1.75 / 12 + 1.0 / 6), 1e-12);
    // Half of them have died at the age of n / 2, whatever rounding makes of the product.
    for (std::uint32_t n = 2; n <= 200; n += 2) {
        std::vector<Track> all;
        for (std::uint32_t age = 1; age <= n; ++age) all.push_back(track(5, 4 + age, TrackEnd::death));
        EXPECT_DOUBLE_EQ(track_statistics(all, 0, 1000).median, n / 2) << n;
    }
    // What begins or ends outside the steps, or at an open side, says less or nothing.
    tracks.push_back({.first = 0, .last = 9, .end = TrackEnd::death});  // there before
    tracks.push_back({.first = 4, .last = 6, .cut = 4, .begin = TrackBegin::entered, .end = TrackEnd::death});
    tracks.push_back({.first = 4, .last = 9, .cut = 6, .begin = TrackBegin::birth, .end = TrackEnd::death});
    tracks.push_back({.first = 18, .last = 25, .begin = TrackBegin::split, .end = TrackEnd::death});
    const TrackStatistics more = track_statistics(tracks, 0, 20);
    EXPECT_EQ(more.tracks, 6u);
    EXPECT_EQ(more.censored, 3u);
    EXPECT_EQ(more.entered, 1u);
    EXPECT_EQ(more.splits, 1u);
    EXPECT_EQ(more.deaths, 6u);
    // n = 6, 5 and 1 at the ages 1, 2 and 4.
    EXPECT_DOUBLE_EQ(more.mean, 1 + 5.0 / 6 + 2 * (5.0 / 6 * 4 / 5));
    EXPECT_TRUE(more.restricted == false && s.restricted == false);
    // One death has no scatter, and none no mean; the greatest age of a track that goes on restricts the mean.
    const TrackStatistics one = track_statistics(std::vector{track(5, 7, TrackEnd::death)}, 0, 20);
    EXPECT_DOUBLE_EQ(one.mean, 3);
    EXPECT_TRUE(std::isnan(one.mean_error));
    const std::vector<Track> going{track(5, 30, TrackEnd::last_state), track(6, 30, TrackEnd::last_state)};
    const TrackStatistics alive = track_statistics(going, 0, 20);
    EXPECT_EQ(alive.tracks, 2u);
    EXPECT_TRUE(std::isnan(alive.mean) && std::isnan(alive.mean_error) && alive.restricted);
    const std::vector<Track> some{track(5, 6, TrackEnd::death), track(5, 7, TrackEnd::death), going[0]};
    const TrackStatistics restricted = track_statistics(some, 0, 20);
    EXPECT_TRUE(restricted.restricted);
    EXPECT_DOUBLE_EQ(restricted.mean, 2 + 2.0 / 3 + 12.0 / 3);
    EXPECT_GT(restricted.mean_error, 0);
    const TrackStatistics none = track_statistics({}, 0, 20);
    EXPECT_TRUE(none.tracks == 0 && std::isnan(none.mean) && std::isnan(none.median));
}

// Without vapour cells are independent and live for 1 / ext steps; where they are far apart each is a cloud. The wind carries
// clouds, and changes nothing.
TEST(Tracks, CellsThatAreFarApartLiveAsLongAsTheirProbabilitySays) {
    for (const double wind : {0.0, 12.0}) {
        AutomatonOptions options;
        options.extent = {256, 256, 1};
        options.boundaries = {Boundary::periodic, Boundary::periodic, Boundary::open};
        options.field.background = {0, 2e-4, 0.1};
        options.initial = InitialState::empty;
        options.wind.keyframes = {{0, {{0, {wind, wind / 2}}}}};
        Automaton automaton(options);
        Tracker tracker(options.boundaries);
        std::vector<CellShift> shifts{{}};
        bool moved = false;
        for (int step = 0; step <= 600; ++step) {
            tracker.add(automaton.cld(), shifts);
            const Displacement rest = automaton.beyond_whole_cells()[0],
                               by = automaton.displacement_of_layer(0, automaton.steps());
            const Displacement way{rest.x + by.x, rest.y + by.y};
            shifts = {{way.whole_x(), way.whole_y()}};
            moved = moved || !(shifts[0] == CellShift{});
            automaton.step();
        }
        EXPECT_EQ(moved, wind > 0);
        const TrackStatistics s = track_statistics(tracker.tracks(), 50, 600);
        EXPECT_GT(s.tracks, 5000u);
        EXPECT_NEAR(s.mean, 10, 4 * s.mean_error + 0.2);
        EXPECT_LT(s.mean_error, 0.3);
        EXPECT_NEAR(s.median, 7, 1) << "ln 2 / -ln 0.9 = 6.6";
        EXPECT_EQ(s.entered, 0u);
    }
}

}  // namespace
}  // namespace nephos
