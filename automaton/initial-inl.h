// SPDX-License-Identifier: Apache-2.0

// The first state (docs/adr/0002): births on the empty lattice, from a domain of randomness of their own. Cell c of a
// block has the counter c; its words 0 and 1 are compared with the thresholds of hum and act.

#if defined(NEPHOS_INITIAL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_INITIAL_INL_H_
#undef NEPHOS_INITIAL_INL_H_
#else
#define NEPHOS_INITIAL_INL_H_
#endif

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <span>

#include <hwy/highway.h>

#include "automaton/dense-inl.h"
#include "automaton/segment-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Thresholds of the 64 cells of a layer as 64-bit numbers; certain cells have one above all words.
using WideThresholds = std::uint64_t[64];

inline void widen(const LayerThresholds& t, WideThresholds out) {
    for (std::size_t c = 0; c < 64; ++c) out[c] = t.full[c] == kCertain ? std::uint64_t{1} << 32 : t.full[c];
}

// Returns a bit for each of 64 cells: the lower half of its word below its threshold.
inline std::uint64_t initial_bits(const std::uint64_t* words, const WideThresholds thresholds) {
    std::uint64_t bits = 0;
#if HWY_TARGET == HWY_SCALAR
    for (int c = 0; c < 64; ++c) bits |= std::uint64_t{(words[c] & 0xFFFFFFFFu) < thresholds[c]} << c;
#else
    const hn::CappedTag<std::int64_t, 8> d;
    const auto low = hn::Set(d, 0xFFFFFFFF);
    for (std::size_t c = 0; c < 64; c += hn::Lanes(d)) {
        const auto at = [&](const std::uint64_t* values) HWY_ATTR {
            return hn::LoadU(d, reinterpret_cast<const std::int64_t*>(values + c));
        };
        const auto happens = hn::Lt(hn::And(at(words), low), at(thresholds));
#if HWY_TARGET <= HWY_AVX3
        bits |= std::uint64_t{happens.raw} << c;
#else
        std::uint8_t some[8] = {};
        hn::StoreMaskBits(d, happens, some);
        bits |= (std::uint64_t{some[0]} & ((std::uint64_t{1} << hn::Lanes(d)) - 1)) << c;
#endif
    }
#endif
    return bits;
}

// Draws hum and act of one block of the segment into its dense events.
inline void draw_initial_block(const Segment& g, int block, const BlockPlan& plan, BirthScratch& s) {
    const auto kind = [&](int draw) { return plan.draws[std::size_t(draw)].kind; };
    if (kind(kHum) == DrawPlan::Kind::none && kind(kAct) == DrawPlan::Kind::none) return;
    const bool varying = kind(kHum) == DrawPlan::Kind::varying || kind(kAct) == DrawPlan::Kind::varying;
    if (varying) locate_columns(plan, s.columns);
    const PhiloxBatch batch{g.keys, 0, std::uint32_t(g.bz) | std::uint32_t(Domain::initial_state) << 16};
    if (!s.initial_table) s.initial_table.emplace(batch, std::uint32_t(Draw::counts));
    const PhiloxBlock shared(batch, std::uint32_t(g.counter(Draw::counts, block, 0) >> 32));
    HWY_ALIGN std::uint64_t words[2][64];
    LayerThresholds t;
    HWY_ALIGN WideThresholds wide[2];
    for (const int draw : {kHum, kAct}) {
        if (kind(draw) == DrawPlan::Kind::none) continue;
        s.dense_words[draw] |= 1u << (block / 8);
        t.full.fill(probability_threshold(plan.draws[std::size_t(draw)].p_max));
        widen(t, wide[draw]);
    }
    const int layers = std::min(kBlockEdge, g.planes.extent.z - g.bz * kBlockEdge);
    for (int layer = 0; layer < layers; ++layer) {
        bool possible = false;
        for (const int draw : {kHum, kAct}) {
            if (kind(draw) == DrawPlan::Kind::varying) {
                find_in_layer(plan, draw, layer, s);
                make_thresholds(plan, draw, layer, ~std::uint64_t{0}, s.layer, t);
                widen(t, wide[draw]);
            }
            possible = possible || (kind(draw) != DrawPlan::Kind::none &&
                                    std::ranges::any_of(wide[draw], [](std::uint64_t w) { return w != 0; }));
        }
        if (!possible) continue;
        philox_words_01(batch, *s.initial_table, shared, 64 * layer, 64, words[0], words[1]);
        for (const int draw : {kHum, kAct}) {
            if (kind(draw) != DrawPlan::Kind::none)
                s.dense_events[draw][block][layer] = initial_bits(words[draw], wide[draw]);
        }
    }
}

inline void draw_initial_segment(const Segment& g, BirthScratch& s) {
    g.random.field->plan_blocks(g.bx0, g.by, g.bz, s.row, std::span(s.plans).first(std::size_t(g.blocks)));
    for (int b = 0; b < g.blocks; ++b) draw_initial_block(g, b, s.plans[std::size_t(b)], s);
    apply_dense_events(g, s);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
