// SPDX-License-Identifier: Apache-2.0

// The dense draw cell by cell, in blocks where p varies but bounds on it decide most cells (docs/adr/0002): extinction in thin
// cloud with an ellipsoid.

#if defined(NEPHOS_UNDECIDED_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_UNDECIDED_INL_H_
#undef NEPHOS_UNDECIDED_INL_H_
#else
#define NEPHOS_UNDECIDED_INL_H_
#endif

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include <hwy/highway.h>

#include "automaton/block_bits-inl.h"
#include "automaton/segment-inl.h"
#include "automaton/ties-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Returns probability_threshold() of kernels.h of a vector.
template <class DF, class V = hn::Vec<DF>>
HWY_INLINE hn::Vec<hn::RebindToUnsigned<DF>> threshold_of(DF d, V p) {
    const hn::RebindToUnsigned<DF> du;
    const hn::RebindToSigned<DF> di;
    const auto scaled = hn::ConvertTo(di, hn::Mul(p, hn::Set(d, 0x1p31f)));
    const auto certain = hn::RebindMask(du, hn::Ge(p, hn::Set(d, 1.0f)));
    return hn::IfThenElse(certain, hn::Set(du, kCertain), hn::ShiftLeft<1>(hn::BitCast(du, scaled)));
}

// Returns what Philox's first rounds make of the sub-indices of a draw in this slab.
inline const PhiloxTable<32>& dense_table(const Segment& g, int draw, BirthScratch& s) {
    std::optional<PhiloxTable<32>>& table = s.dense_tables[draw];
    if (!table) table.emplace(g.batch(), draw_of(draw));
    return *table;
}

// A bit for each byte of a vector: less than that of the threshold, or equal to it.
struct ByteBits {
    std::uint64_t less, tie;
};

template <class D, class V = hn::Vec<D>>
HWY_INLINE ByteBits compare_bytes([[maybe_unused]] D d, V random, V threshold) {
#if HWY_TARGET == HWY_SCALAR  // one lane is not bytes
    ByteBits bits{0, 0};
    const std::uint64_t r = hn::GetLane(random), t = hn::GetLane(threshold);
    for (int byte = 0; byte < 8; ++byte) {
        const std::uint64_t a = r >> (8 * byte) & 0xFF, b = t >> (8 * byte) & 0xFF;
        bits.less |= std::uint64_t{a < b} << byte;
        bits.tie |= std::uint64_t{a == b} << byte;
    }
    return bits;
#else
    const hn::Repartition<std::uint8_t, D> d8;
    const auto a = hn::BitCast(d8, random), b = hn::BitCast(d8, threshold);
    return {bits_of(d8, hn::Lt(a, b)), bits_of(d8, hn::Eq(a, b))};
#endif
}

// Repeats the last of `count` jobs up to the next multiple of 4: philox_jobs() makes 4 at a time.
inline void fill_up(PhiloxJob* jobs, int count) {
    for (int n = count; n % 4 != 0; ++n) jobs[n] = jobs[count - 1];
}

// Bounds on the thresholds' top bytes in a block where p varies.
struct TopBounds {
    std::uint32_t low, high;
};

// Returns a lower bound of p of a draw in the cells of a block.
inline float lowest_probability(const BlockPlan& plan, int draw) {
    const auto which = std::size_t(draw);
    float lowest = plan.background.low[which];
    if (draw != kExt) return lowest;  // ellipsoids can only raise it
    for (const BlockEllipsoid& e : plan.ellipsoids) {
        const float a = e.base_a + 3.5f * (e.xx + e.xy), b = e.base_b + 3.5f * (e.yx + e.yy), c = e.base_c + 3.5f * e.zz;
        const float nearest = std::max(0.0f, std::sqrt(a * a + b * b + c * c) - e.source->block_reach);
        const float s = std::max(0.0f, 1 - nearest * nearest), rim = e.source->rim[which], span = e.source->span[which];
        // Rounding in the cells, and of the distance, is far below the last term.
        const float slack = 1e-4f * (std::abs(rim) + std::abs(span));
        lowest = std::min(lowest, std::min(rim, rim + span * (s * s)) - slack);
    }
    return std::max(lowest, 0.0f);
}

inline TopBounds top_bounds(const BlockPlan& plan, int draw) {
    return {probability_threshold(lowest_probability(plan, draw)) >> 24,
            probability_threshold(plan.draws[std::size_t(draw)].p_max) >> 24};
}

// Returns whether so few of `cells` cells are left undecided that they are better taken one by one.
inline bool few_undecided(int cells, const TopBounds& bounds) {
    return cells * int(bounds.high - bounds.low + 1) < 96 * 256;
}

// Cells of one block, block << 9 | word << 6 | bit, with their random bytes.
struct UndecidedCells {
    static constexpr int kSize = 4 * 128;  // of 4 jobs
    alignas(64) std::uint32_t cells[kSize + 16];
    alignas(64) std::uint32_t bytes[kSize + 16];
    int count = 0;
};

// Returns p of a draw at a vector of cells.
template <class DF, class VU, class V = hn::Vec<DF>>
HWY_INLINE V probability_of(DF d, const BlockPlan& plan, int draw, VU cells) {
    const hn::RebindToUnsigned<DF> du;
    const hn::RebindToSigned<DF> di;
    const auto bits = [&](VU v, std::uint32_t mask) HWY_ATTR { return hn::And(v, hn::Set(du, mask)); };
    const auto to_float = [&](VU v) HWY_ATTR { return hn::ConvertTo(d, hn::BitCast(di, v)); };
    // row_of(BitOrder::words) of the word, 3 bits, and the byte, 3 bits
    const VU row = hn::Or(hn::Or(hn::ShiftRight<3>(bits(cells, 0x180)), hn::ShiftRight<2>(bits(cells, 0x38))),
                          hn::ShiftRight<6>(bits(cells, 0x40)));
    const auto dx = to_float(bits(cells, 7)), dy = to_float(bits(row, 7)), dz = to_float(hn::ShiftRight<3>(row));
    const float* const values = plan.background.values[std::size_t(draw)];
    V p = hn::Set(d, plan.background.low[std::size_t(draw)]);
    if (values != nullptr) p = hn::GatherIndex(d, values, hn::BitCast(di, hn::Or(hn::ShiftLeft<3>(row), bits(cells, 7))));
    for (const BlockEllipsoid& e : plan.ellipsoids) p = combine(d, e, std::size_t(draw), locate(d, e, dx, dy, dz), p);
    return p;
}

// Decides them; adds those whose byte equals their threshold's to `ties`.
inline void decide_cells(const Segment& g, int draw, UndecidedCells& undecided, TieBatch& ties, BirthScratch& s) {
    if (undecided.count == 0) return;
    const hn::CappedTag<float, 16> d;
    const hn::RebindToUnsigned<decltype(d)> du;
    const BlockPlan& plan = s.plans[undecided.cells[0] >> 9];
    std::uint32_t events[UndecidedCells::kSize + 16];
    int count = 0;
    const int lanes = int(hn::Lanes(d));
    for (int n = 0; n < undecided.count; n += lanes) {
        if (ties.count + lanes > TieBatch::kSize) decide_ties(g, draw, ties, s);
        const auto cells = hn::Load(du, undecided.cells + n), bytes = hn::Load(du, undecided.bytes + n);
        const auto threshold = threshold_of(d, probability_of(d, plan, draw, cells));
        const auto top = hn::ShiftRight<24>(threshold);
        const auto used = hn::FirstN(du, std::size_t(undecided.count - n));
        const auto event = hn::And(used, hn::Lt(bytes, top)), tie = hn::And(used, hn::Eq(bytes, top));
        hn::StoreU(compress(du, cells, event), du, events + count);
        count += int(hn::CountTrue(du, event));
        const auto certain = hn::Eq(threshold, hn::Set(du, kCertain));
        const auto below = hn::IfThenElse(certain, hn::Set(du, 0x1000000u), hn::And(threshold, hn::Set(du, 0xFFFFFFu)));
        hn::StoreU(compress(du, cells, tie), du, ties.cells + ties.count);
        hn::StoreU(compress(du, below, tie), du, ties.below + ties.count);
        ties.count += int(hn::CountTrue(du, tie));
    }
    for (int n = 0; n < count; ++n) s.events[events[n] >> 9][events[n] >> 6 & 7] |= std::uint64_t{1} << (events[n] & 63);
    undecided.count = 0;
}

// Draws in the blocks where p varies and few cells are undecided by its bounds: a random byte below all thresholds of the block
// is an event, one above all is none, and p is evaluated in the other cells alone.
inline void run_undecided(const Segment& g, int draw, int count, BirthScratch& s) {
    constexpr int kAtATime = 4;
    const hn::CappedTag<std::uint64_t, 8> d;
    alignas(64) std::uint8_t random[kAtATime][2][64];
    alignas(64) CellBits wanted;
    fill_bits(&wanted, 1, ~std::uint64_t{0});
    UndecidedCells undecided;
    TieBatch ties;
    int block = -1;
    fill_up(s.undecided_jobs, count);
    for (int first = 0; first < count; first += kAtATime) {
        const PhiloxJob* const jobs = s.undecided_jobs + first;
        const int some = std::min(kAtATime, count - first);
        const auto store = [&](int n, int word, int i, auto bytes, std::uint64_t low, std::uint64_t high) HWY_ATTR {
            hn::StoreU(bytes, d, reinterpret_cast<std::uint64_t*>(random[n][word]) + i);
            const ByteBits events = compare_bytes(d, bytes, hn::Set(d, low)), above = compare_bytes(d, bytes, hn::Set(d, high));
            std::uint64_t& event = s.events[jobs[n].block][2 * jobs[n].quarter + word];
            std::uint64_t& left = s.ties[jobs[n].block][2 * jobs[n].quarter + word];
            const std::uint64_t between = ~events.less & (above.less | above.tie);
            const std::uint64_t lanes = hn::Lanes(d) == 8 ? ~std::uint64_t{0} : (std::uint64_t{1} << 8 * hn::Lanes(d)) - 1;
            event = (i == 0 ? 0 : event) | events.less << (8 * i);
            left = (i == 0 ? 0 : left) | (between & lanes) << (8 * i);
        };
        philox_jobs(g.batch(), dense_table(g, draw, s), s.philox_blocks, jobs, some,
                    [&](int n, int i, auto words01, auto words23) HWY_ATTR {
                        const std::uint64_t low = s.tops[jobs[n].block], high = s.high_tops[jobs[n].block];
                        store(n, 0, i, words01, low, high);
                        store(n, 1, i, words23, low, high);
                    });
        for (int n = 0; n < some; ++n) {
            if (jobs[n].block != block) {
                decide_cells(g, draw, undecided, ties, s);
                block = jobs[n].block;
                if (draw == kExt) in_order_of_words(cloud_of_block(g, block, s), wanted);
            }
            for (int half = 0; half < 2; ++half) {
                const int word = 2 * jobs[n].quarter + half;
                std::uint64_t& left = s.ties[block][word];
                for (std::uint64_t bits = left & wanted[word]; bits != 0; bits &= bits - 1) {
                    const auto bit = std::uint32_t(std::countr_zero(bits));
                    undecided.cells[undecided.count] = std::uint32_t(block) << 9 | std::uint32_t(word) << 6 | bit;
                    undecided.bytes[undecided.count++] = random[n][half][bit];
                }
                left = 0;
            }
        }
    }
    decide_cells(g, draw, undecided, ties, s);
    decide_ties(g, draw, ties, s);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
