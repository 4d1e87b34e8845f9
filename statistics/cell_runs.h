// SPDX-License-Identifier: Apache-2.0
#pragma once

// Runs of 1 bits in the rows of a plane, and which runs of two rows share cells.
//
// Both are found in words of 64 cells: where a run begins or ends is a bit of the row XOR the row moved by a cell, and cells
// that two rows share are the runs of row AND row. The number of the run that holds a cell is that of the runs that
// begin up to there: the count of the words before, and a population count.
//
//     row       . 1 1 . 1 1 1 .     . . . 1
//     starts    . 1 . . 1 . . .     . . . 1       runs before the second word: 2

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "automaton/lattice.h"

namespace nephos {

// Cells [begin, end) of a row.
struct CellRun {
    int begin, end;
};

// The runs of 1 bits of a plane are numbered row after row: row j + ny k has the runs rows[j + ny k] .. rows[j + ny k + 1] - 1.
struct RunNumbers {
    std::vector<std::uint32_t> rows;  // one more than there are rows
    // Of each word of the plane: the first cells of runs, and how many runs begin in the words before it.
    std::vector<std::uint64_t> starts;
    std::vector<std::uint32_t> before;
    std::uint32_t count() const { return rows.back(); }
};
// Throws Error(usage) for more than kMostRuns.
RunNumbers number_runs(const BitPlaneView& plane);
inline constexpr std::uint64_t kMostRuns = 0xfffffffe;

// Returns the runs of a plane in the order of their numbers.
std::vector<CellRun> runs_of(const BitPlaneView& plane, const RunNumbers& numbers);

// A run of one row that shares cells with a run of another.
struct RunOverlap {
    std::uint32_t one, other;  // numbers of runs in their planes
    int cells;                 // that they share in one piece
};

// Rows of a plane, and the numbers of the runs of a plane that has all of its cells.
struct NumberedRows {
    BitPlaneView plane;
    const RunNumbers& numbers;
    std::size_t first = 0;  // row j + ny k
};

// Finds what rows share; keeps its memory from one call to the next. Not thread-safe.
class OverlapFinder {
  public:
    // Returns the cells that `count` rows of `one` share with as many of `other`, row by row, when the latter are moved by
    // `shift` cells, -nx <= shift <= nx, and wrap around where x is periodic. A pair of runs may come twice then, and two runs
    // of `other` that meet at the side count as one, named after the eastern. What is returned lives until the next call. Preconditions: both planes are of one extent and have these rows.
    std::span<const RunOverlap> find(const NumberedRows& one, const NumberedRows& other, std::size_t count, int shift,
                                     Boundary x);

  private:
    std::vector<RunOverlap> overlaps_;
    std::vector<std::uint64_t> moved_;
    std::vector<CellRun> common_;
};

}  // namespace nephos
