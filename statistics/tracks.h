// SPDX-License-Identifier: Apache-2.0
#pragma once

// Clouds followed from step to step, and how long they live.
//
// The clouds of a state are those of clouds_2d() with four neighbours. Each cloud of a step is moved by the wind, and then
// shares columns with some clouds of the next step. A track goes on from a cloud to that of the next step which shares most
// columns with it, if it is in turn the one that shares most with that (Heus and Seifert, Geosci. Model Dev. 6, 2013, in
// the form of mutual choice). All else begins or ends a track:
//
//     birth    a cloud that shares nothing with the step before      death  a cloud that shares nothing with the next step
//     split    a cloud that shares something, but continues none     merger a cloud that shares something, but is not continued
//
// Of equal shares the older track, and the cloud that comes first in memory, is taken. Where levels move differently, the
// columns are counted once for each displacement in which cells of the cloud lie above them.
//
// Tracks are joined across periodic sides. At an open side nobody sees how long a cloud lives: a track that begins there is
// `entered` and left out of the lifetimes, and one that comes to touch an open side is censored at that step.
//
// Lifetimes are those of tracks that begin with a birth or a split within the steps that are looked at, and end with a death.
// Tracks that merge, touch an open side, or are there at the last step have lived at least as long as was seen: they are
// censored, and Kaplan and Meier's estimate (J. Am. Stat. Assoc. 53, 1958) takes them into account:
//
//     S(t) = product over t_i <= t of (1 - d_i / n_i), d_i deaths at the age t_i among n_i tracks that were seen to reach it

#include <cstdint>
#include <span>
#include <vector>

#include "statistics/clouds.h"

#include "automaton/lattice.h"

namespace nephos {

// Whole cells that the bits of a level were moved by the wind in a step.
struct CellShift {
    std::int64_t x = 0, y = 0;
    bool operator==(const CellShift&) const = default;
};

enum class TrackBegin : std::uint8_t { first_state, birth, split, entered };
enum class TrackEnd : std::uint8_t { last_state, death, merger };

struct Track {
    static constexpr std::uint32_t kNever = ~std::uint32_t(0);
    std::uint32_t first = 0, last = 0;  // states, counted from 0, that it is in
    std::uint32_t cut = kNever;         // the first state in which its cloud touches an open side
    TrackBegin begin = TrackBegin::first_state;
    TrackEnd end = TrackEnd::last_state;
    auto operator<=>(const Track&) const = default;
};

// Columns that a cloud of one step shares with one of the next; numbers of clouds.
struct SharedColumns {
    std::uint32_t before, now;
    std::uint64_t columns;
};

// Follows clouds through states that are given one after the other.
class Tracker {
  public:
    explicit Tracker(const Boundaries& boundaries = {}) : boundaries_(boundaries) {}

    // Takes the next state. `shifts` are those of each level in the step to it; of the first state they are not looked at.
    // Preconditions: all states have one extent, and there is a shift for each level.
    void add(const BitPlaneView& cld, std::span<const CellShift> shifts);

    // Returns all tracks, those that go on at the last state included, in no particular order.
    std::vector<Track> tracks() const;

  private:
    // Of each cloud before the one that shares most columns with it now, and the other way round; none where all bits are 1.
    struct Choices {
        std::vector<std::uint32_t> heir, parent;
    };
    std::vector<SharedColumns> shared_columns(const LabelledClouds& now, std::span<const CellShift> shifts);
    Choices choose(std::span<const SharedColumns> shared, std::size_t clouds_now) const;

    Boundaries boundaries_;
    std::uint32_t states_ = 0;
    BitPlane cld_;  // of the last state
    LabelledClouds clouds_;
    std::vector<Track> current_;           // of each of its clouds
    std::vector<std::uint64_t> identity_;  // of each of them: lower is older
    std::uint64_t next_identity_ = 0;
    std::vector<Track> ended_;
    OverlapFinder finder_;
};

struct TrackStatistics {
    std::uint64_t births = 0, splits = 0, deaths = 0, mergers = 0,
                  entered = 0;  // in the steps that were looked at
    // Of the lifetimes: tracks, and how many of them are censored.
    std::uint64_t tracks = 0, censored = 0;
    // Kaplan and Meier's mean with Greenwood's standard error, and median; steps. Where the oldest track is censored the mean is
    // `restricted` to its age, and too small. The mean is NaN where no track was seen to die, its error where fewer than two
    // were: one says nothing of a scatter. The median is NaN also where fewer than half were seen to die.
    double mean, mean_error, median;
    bool restricted = false;
    std::uint64_t longest = 0;  // age in steps that a track was seen to reach
};

// Looks at the states first .. last. Pure.
TrackStatistics track_statistics(std::span<const Track> tracks, std::uint64_t first, std::uint64_t last);

}  // namespace nephos
