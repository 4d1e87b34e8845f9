// SPDX-License-Identifier: Apache-2.0
#include "statistics/cell_runs.h"

#include <string>

#include "core/error.h"
#include "statistics/row_shift.h"

#ifndef NEPHOS_CELL_RUNS_ONCE
#define NEPHOS_CELL_RUNS_ONCE
namespace nephos {
// Entries behind the last one of a list that list_bits() may write to.
inline constexpr std::size_t kSpareRuns = 4;
}  // namespace nephos
#endif

#if defined(__OPTIMIZE__) && !defined(HWY_DISABLED_TARGETS)  // with -O0 as all files (docs/determinism.md)
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4)
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "statistics/cell_runs.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/highway.h>

// Not for vectors, but for the instructions that count and find bits: without a target the compiler may not assume them.
HWY_BEFORE_NAMESPACE();
namespace nephos {
namespace HWY_NAMESPACE {

constexpr std::uint64_t kLastBit = std::uint64_t(1) << 63;  // for where no bit is left

// Sets `member` of the entries from `to` on to the places of the bits, and returns what follows them. Four at a time, wanted
// or not: how many bits there are cannot be foretold.
template <int CellRun::*member>
HWY_INLINE CellRun* list_bits(std::uint64_t bits, int at, CellRun* to) {
    CellRun* const end = to + hwy::PopCount(bits);
    do {
        for (std::size_t n = 0; n < kSpareRuns; ++n, bits &= bits - 1)
            to[n].*member = at + int(hwy::Num0BitsBelowLS1Bit_Nonzero64(bits | kLastBit));
        to += kSpareRuns;
    } while (HWY_UNLIKELY(to < end));
    return end;
}

// Returns how many runs there are; the numbers are right as far as they fit.
std::uint64_t number_runs_of(const BitPlaneView& plane, RunNumbers& numbers) {
    const std::uint64_t* words = plane.words;
    std::uint64_t* starts = numbers.starts.data();
    std::uint32_t* before = numbers.before.data();
    std::uint64_t count = 0;
    for (std::size_t row = 0; row + 1 < numbers.rows.size(); ++row) {
        numbers.rows[row] = std::uint32_t(count);
        std::uint64_t carry = 0;  // the last cell of the word before
        for (std::size_t w = 0; w < plane.words_per_row; ++w) {
            const std::uint64_t bits = *words++, begins = bits & ~(bits << 1 | carry);
            carry = bits >> 63;
            *starts++ = begins;
            *before++ = std::uint32_t(count);
            count += hwy::PopCount(begins);
        }
    }
    numbers.rows.back() = std::uint32_t(count);
    return count;
}

// Lists the runs of a row of bits, and returns what follows them. kSpareRuns more entries are written to.
template <class BitsOf>
HWY_INLINE CellRun* list_runs(std::size_t words, int nx, const BitsOf& bits_of, CellRun* to) {
    CellRun *begins = to, *ends = to;
    std::uint64_t carry = 0;
    for (std::size_t w = 0; w < words; ++w) {
        const std::uint64_t bits = bits_of(w), turns = bits ^ (bits << 1 | carry);
        carry = bits >> 63;
        if (turns == 0) continue;
        begins = list_bits<&CellRun::begin>(turns & bits, int(64 * w), begins);
        ends = list_bits<&CellRun::end>(turns & ~bits, int(64 * w), ends);
    }
    if (carry != 0) ends->end = nx;
    return begins;
}

void list_runs_of(const BitPlaneView& plane, CellRun* to) {
    const std::size_t words = plane.words_per_row, rows = std::size_t(plane.extent.y) * std::size_t(plane.extent.z);
    for (std::size_t row = 0; row < rows; ++row) {
        const std::uint64_t* bits = plane.words + row * words;
        to = list_runs(words, plane.extent.x, [&](std::size_t w) { return bits[w]; }, to);
    }
}

// The number of the run that holds cell i of a row whose first word is `word` of the plane.
HWY_INLINE std::uint32_t run_at(const RunNumbers& numbers, std::size_t word, int i) {
    const std::size_t at = word + std::size_t(i) / 64;
    const std::uint64_t up_to = ~std::uint64_t(0) >> (63 - i % 64);
    return numbers.before[at] + std::uint32_t(hwy::PopCount(numbers.starts[at] & up_to)) - 1;
}

// The row of `other` that meets one of `one`, moved: `moved` has room for it, and for what wraps around.
const std::uint64_t* moved_row(const std::uint64_t* row, std::size_t words, int nx, int shift, bool periodic,
                               std::uint64_t* moved) {
    move_row(row, words, shift, moved);
    if (periodic) {
        std::uint64_t* wrapped = moved + words;
        move_row(row, words, shift > 0 ? shift - nx : shift + nx, wrapped);
        for (std::size_t w = 0; w < words; ++w) moved[w] |= wrapped[w];
    }
    return moved;
}

std::size_t find_overlaps_of(const NumberedRows& one, const NumberedRows& other, std::size_t count, int shift,
                             bool periodic, std::uint64_t* moved, CellRun* common, std::vector<RunOverlap>& overlaps) {
    const std::size_t words = one.plane.words_per_row;
    const int nx = one.plane.extent.x;
    std::size_t found = 0;
    for (std::size_t row = 0; row < count; ++row) {
        const std::size_t word_one = (one.first + row) * words, word_other = (other.first + row) * words;
        const std::uint64_t *a = one.plane.words + word_one, *b = other.plane.words + word_other;
        if (shift != 0) b = moved_row(b, words, nx, shift, periodic, moved);
        const CellRun* const end =
            list_runs(words, nx, [&](std::size_t w) { return a[w] & b[w]; }, common);
        const std::size_t before = found;
        found += std::size_t(end - common);
        if (overlaps.size() < found) overlaps.resize(2 * found);
        RunOverlap* to = overlaps.data() + before;
        for (const CellRun* run = common; run != end; ++run) {
            int there = run->begin - shift;
            there += there < 0 ? nx : there >= nx ? -nx : 0;
            *to++ = {run_at(one.numbers, word_one, run->begin), run_at(other.numbers, word_other, there),
                     run->end - run->begin};
        }
    }
    return found;
}

}  // namespace HWY_NAMESPACE
}  // namespace nephos
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

namespace {

HWY_EXPORT(number_runs_of);
HWY_EXPORT(list_runs_of);
HWY_EXPORT(find_overlaps_of);

}  // namespace

RunNumbers number_runs(const BitPlaneView& plane) {
    RunNumbers numbers;
    numbers.rows.resize(std::size_t(plane.extent.y) * std::size_t(plane.extent.z) + 1);
    numbers.starts.resize(plane.word_count());
    numbers.before.resize(plane.word_count());
    const std::uint64_t count = HWY_DYNAMIC_DISPATCH(number_runs_of)(plane, numbers);
    if (count > kMostRuns) {
        throw Error(ErrorCode::usage, "a state with " + std::to_string(count) + " runs of cells; expected at most " +
                                          std::to_string(kMostRuns) + " for statistics of clouds");
    }
    return numbers;
}

std::vector<CellRun> runs_of(const BitPlaneView& plane, const RunNumbers& numbers) {
    std::vector<CellRun> runs(numbers.count() + kSpareRuns);
    HWY_DYNAMIC_DISPATCH(list_runs_of)(plane, runs.data());
    runs.resize(numbers.count());
    return runs;
}

std::span<const RunOverlap> OverlapFinder::find(const NumberedRows& one, const NumberedRows& other,
                                                std::size_t count, int shift, Boundary x) {
    moved_.resize(2 * one.plane.words_per_row);
    common_.resize(std::size_t(one.plane.extent.x) / 2 + 1 + kSpareRuns);
    const std::size_t found =
        HWY_DYNAMIC_DISPATCH(find_overlaps_of)(one, other, count, shift, x == Boundary::periodic,
                                               moved_.data(), common_.data(), overlaps_);
    return {overlaps_.data(), found};
}

}  // namespace nephos
#endif
