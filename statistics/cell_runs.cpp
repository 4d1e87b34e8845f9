// SPDX-License-Identifier: Apache-2.0
#include "statistics/cell_runs.h"

#include "statistics/row_shift.h"

#ifndef HWY_DISABLED_TARGETS
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

// Entries behind the last one of a list that list_bits() may write to.
constexpr std::size_t kSpare = 4;
constexpr std::uint64_t kLastBit = std::uint64_t(1) << 63;  // for where no bit is left

// Sets `member` of the entries from `to` on to the places of the bits, and returns what follows them. Four at a time, wanted
// or not: how many bits there are cannot be foretold.
template <int CellRun::*member>
HWY_INLINE CellRun* list_bits(std::uint64_t bits, int at, CellRun* to) {
    CellRun* const end = to + hwy::PopCount(bits);
    do {
        for (std::size_t n = 0; n < kSpare; ++n, bits &= bits - 1)
            to[n].*member = at + int(hwy::Num0BitsBelowLS1Bit_Nonzero64(bits | kLastBit));
        to += kSpare;
    } while (HWY_UNLIKELY(to < end));
    return end;
}

void number_runs_of(const BitPlaneView& plane, RunNumbers& numbers) {
    const std::uint64_t* words = plane.words;
    std::uint64_t* starts = numbers.starts.data();
    std::uint32_t* before = numbers.before.data();
    std::uint32_t count = 0;
    for (std::size_t row = 0; row + 1 < numbers.rows.size(); ++row) {
        numbers.rows[row] = count;
        std::uint64_t carry = 0;  // the last cell of the word before
        for (std::size_t w = 0; w < plane.words_per_row; ++w) {
            const std::uint64_t bits = *words++, begins = bits & ~(bits << 1 | carry);
            carry = bits >> 63;
            *starts++ = begins;
            *before++ = count;
            count += std::uint32_t(hwy::PopCount(begins));
        }
    }
    numbers.rows.back() = count;
}

// Lists the runs of a row of bits, and returns what follows them. kSpare more entries are written to.
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
                             bool periodic, std::uint64_t* moved, CellRun* common, RunOverlap* to) {
    const std::size_t words = one.plane.words_per_row;
    const int nx = one.plane.extent.x;
    const RunOverlap* const begin = to;
    for (std::size_t row = 0; row < count; ++row) {
        const std::size_t word_one = (one.first + row) * words, word_other = (other.first + row) * words;
        const std::uint64_t *a = one.plane.words + word_one, *b = other.plane.words + word_other;
        if (shift != 0) b = moved_row(b, words, nx, shift, periodic, moved);
        const CellRun* const end =
            list_runs(words, nx, [&](std::size_t w) { return a[w] & b[w]; }, common);
        for (const CellRun* run = common; run != end; ++run) {
            int there = run->begin - shift;
            there += there < 0 ? nx : there >= nx ? -nx : 0;
            *to++ = {run_at(one.numbers, word_one, run->begin), run_at(other.numbers, word_other, there),
                     run->end - run->begin};
        }
    }
    return std::size_t(to - begin);
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

constexpr std::size_t kSpareRuns = 4;  // behind those of a list

std::size_t runs_in(const NumberedRows& rows, std::size_t count) {
    return rows.numbers.rows[rows.first + count] - rows.numbers.rows[rows.first];
}

}  // namespace

RunNumbers number_runs(const BitPlaneView& plane) {
    RunNumbers numbers;
    numbers.rows.resize(std::size_t(plane.extent.y) * std::size_t(plane.extent.z) + 1);
    numbers.starts.resize(plane.word_count());
    numbers.before.resize(plane.word_count());
    HWY_DYNAMIC_DISPATCH(number_runs_of)(plane, numbers);
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
    // What two rows share begins where a run of either does; what wraps around may cut one more.
    const std::size_t most = runs_in(one, count) + runs_in(other, count) + count;
    if (room_ < most) {
        room_ = 2 * most;
        overlaps_.reset(new RunOverlap[room_]);
    }
    moved_.resize(2 * one.plane.words_per_row);
    common_.resize(std::size_t(one.plane.extent.x) / 2 + 1 + kSpareRuns);
    const std::size_t found =
        HWY_DYNAMIC_DISPATCH(find_overlaps_of)(one, other, count, shift, x == Boundary::periodic,
                                               moved_.data(), common_.data(), overlaps_.get());
    return {overlaps_.get(), found};
}

}  // namespace nephos
#endif
