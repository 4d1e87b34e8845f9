// SPDX-License-Identifier: Apache-2.0

// Ties of the dense draw (docs/adr/0002): cells whose random byte equals the top byte of their threshold, 1 in 256, take 24 bits
// more.

#if defined(NEPHOS_TIES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_TIES_INL_H_
#undef NEPHOS_TIES_INL_H_
#else
#define NEPHOS_TIES_INL_H_
#endif

#include <bit>
#include <cstdint>
#include <span>

#include <hwy/highway.h>

#include "automaton/block_bits-inl.h"
#include "automaton/segment-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Returns the threshold of the 24 further bits of a tied cell with the threshold t.
inline std::uint32_t tie_threshold(std::uint32_t t) { return t == kCertain ? 0x1000000u : t & 0xFFFFFFu; }

// Ties whose cells are block << 9 | word << 6 | bit, as in s.ties, with the thresholds of their further bits.
struct TieBatch {
    static constexpr int kSize = 64;
    alignas(64) std::uint32_t cells[kSize + 16] = {};
    std::uint32_t below[kSize + 16];
    int count = 0;
};

// Decides them by 24 more random bits. Cell c of a block takes word c % 4 of counter 32 + c / 4.
inline void decide_ties(const Segment& g, int draw, TieBatch& ties, BirthScratch& s) {
    const hn::CappedTag<std::uint64_t, 8> d;
    const hn::Rebind<std::uint32_t, decltype(d)> d32;
    alignas(64) std::uint64_t counters[TieBatch::kSize + kMaxLanes64];
    alignas(64) std::uint32_t words[4 * (TieBatch::kSize + kMaxLanes64)];
    const auto bits = [&](auto v, std::uint64_t mask) HWY_ATTR { return hn::And(v, hn::Set(d, mask)); };
    const std::uint64_t first = g.counter(draw_of(draw), 0, 32);
    for (std::size_t n = 0; n < std::size_t(ties.count); n += hn::Lanes(d)) {
        const auto at = hn::PromoteTo(d, hn::LoadU(d32, ties.cells + n));
        // row_of(BitOrder::words) of the word, 3 bits, and the byte, 3 bits
        const auto row = hn::Or(hn::Or(hn::ShiftRight<3>(bits(at, 0x180)), hn::ShiftRight<2>(bits(at, 0x38))),
                                hn::ShiftRight<6>(bits(at, 0x40)));
        const auto sub = hn::Or(hn::ShiftLeft<1>(row), hn::ShiftRight<2>(bits(at, 7)));
        const auto block = hn::ShiftLeft<32>(hn::ShiftRight<9>(at));
        hn::StoreU(hn::Add(hn::Add(sub, block), hn::Set(d, first)), d, counters + n);
    }
    philox_counters(g.batch(), counters, ties.count, words);
    for (int n = 0; n < ties.count; ++n) {
        const std::uint32_t at = ties.cells[n];
        const std::uint64_t event = words[4 * std::uint32_t(n) + (at & 3)] >> 8 < ties.below[n];
        s.events[at >> 9][at >> 6 & 7] |= event << (at & 63);
    }
    ties.count = 0;
}

// Lists the words of the ties of a block that are not 0, from `list` on; returns the list's end. Which of them are cannot be
// foretold. `list` may be written up to 8 places beyond. Ties of extinction where there is no cloud are left out, and of births
// where the cell is set, if that pays: nothing would happen.
HWY_INLINE std::uint32_t* list_ties(const Segment& g, int draw, std::uint32_t block, BirthScratch& s,
                                    std::uint32_t* list) {
    CellBits& ties = s.ties[block];
    alignas(64) CellBits cells;
#if HWY_TARGET <= HWY_AVX3
    const WordLanes d;
    const hn::CappedTag<std::uint32_t, 8> d32;
    in_order_of_words(draw == kExt ? cloud_of_block(g, int(block), s) : s.born[block], cells);
    const auto set = hn::Load(d, cells), all = hn::Load(d, ties);
    const auto matter = draw == kExt ? hn::And(set, all) : hn::AndNot(set, all);
    hn::Store(matter, d, ties);
    const hn::Mask<decltype(d32)> some{hn::Ne(matter, hn::Zero(d)).raw};
    hn::StoreU(hn::Compress(rising_from(d32, 8 * block), some), d32, list);
    return list + hn::CountTrue(d32, some);
#else
    if (draw == kExt) {
        in_order_of_words(cloud_of_block(g, int(block), s), cells);
        for (int word = 0; word < 8; ++word) ties[word] &= cells[word];
    }
    for (std::uint32_t word = 0; word < 8; ++word) {
        *list = 8 * block + word;
        list += int{ties[word] != 0};
    }
    return list;
#endif
}

// Returns the threshold of the further bits of a tied cell of a block where p varies.
inline std::uint32_t varying_tie_threshold(const BlockPlan& plan, int draw, std::uint32_t at) {
    const int row = row_of(BitOrder::words, int(at >> 6 & 7), int(at >> 3 & 7));
    return tie_threshold(probability_threshold(probability_at(plan, draw, int(at & 7), row % 8, row / 8)));
}

// Decides the ties of the blocks in `blocks` that matter: of births those of cells that are not set, of extinction those of
// cloud.
inline void run_ties(const Segment& g, int draw, std::span<const std::uint8_t> blocks, BirthScratch& s) {
    std::uint32_t places[8 * kSegmentBlocks + 8];
    std::uint32_t* end = places;
#if HWY_TARGET <= HWY_AVX3
    if (draw != kExt) collect_cells(g, draw == kHum ? g.planes.hum : g.planes.act_next, s.born);
#endif
    for (const std::uint8_t block : blocks) end = list_ties(g, draw, block, s, end);
    TieBatch batch;
    for (const std::uint32_t* place = places; place != end; ++place) {
        const std::uint32_t block = *place >> 3;
        const BlockPlan& plan = s.plans[block];
        const bool varies = plan.draws[std::size_t(draw)].kind == DrawPlan::Kind::varying;
        for (std::uint64_t bits = s.ties[block][*place & 7]; bits != 0; bits &= bits - 1) {
            const std::uint32_t at = *place << 6 | std::uint32_t(std::countr_zero(bits));
            batch.cells[batch.count] = at;
            batch.below[batch.count++] = varies ? varying_tie_threshold(plan, draw, at) : s.tie_thresholds[block];
            if (batch.count == TieBatch::kSize) decide_ties(g, draw, batch, s);
        }
    }
    decide_ties(g, draw, batch, s);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
