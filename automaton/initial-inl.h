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

// A bit for each of 64 cells: word `draw` of its counter below its threshold, or the event certain.
inline std::uint64_t initial_bits(const std::uint32_t* words, int draw, const std::uint32_t* thresholds) {
    const hn::CappedTag<std::uint32_t, 16> d;
    const auto certain = hn::Set(d, kCertain);
    std::uint64_t bits = 0;
    for (std::size_t c = 0; c < 64; c += hn::Lanes(d)) {
        hn::Vec<decltype(d)> w0, w1, w2, w3;
        hn::LoadInterleaved4(d, words + 4 * c, w0, w1, w2, w3);
        const auto threshold = hn::LoadU(d, thresholds + c);
        const auto happens = hn::Or(hn::Lt(draw == kHum ? w0 : w1, threshold), hn::Eq(threshold, certain));
        std::uint8_t bytes[8] = {};
        hn::StoreMaskBits(d, happens, bytes);
        std::uint64_t some = 0;
        std::memcpy(&some, bytes, sizeof some);
        bits |= (some & ((std::uint64_t{1} << hn::Lanes(d)) - 1)) << c;
    }
    return bits;
}

// Draws hum and act of one block of the segment into its dense events.
inline void draw_initial_block(const Segment& g, int block, const BlockPlan& plan, BirthScratch& s) {
    const auto kind = [&](int draw) { return plan.draws[std::size_t(draw)].kind; };
    if (kind(kHum) == DrawPlan::Kind::none && kind(kAct) == DrawPlan::Kind::none) return;
    const bool varying = kind(kHum) == DrawPlan::Kind::varying || kind(kAct) == DrawPlan::Kind::varying;
    if (varying) locate_columns(plan, s.columns);
    const PhiloxBatch batch{g.keys, 0, std::uint32_t(g.bz) | std::uint32_t(Domain::initial_state) << 16};
    HWY_ALIGN std::uint64_t counters[64 + kMaxLanes64] = {};
    HWY_ALIGN std::uint32_t words[4 * (64 + kMaxLanes64)];
    LayerThresholds t[2];
    for (const int draw : {kHum, kAct}) {
        if (kind(draw) == DrawPlan::Kind::none) continue;
        s.dirty[draw] = true;
        s.dense_words[draw] |= 1u << (block / 8);
        t[draw].full.fill(probability_threshold(plan.draws[std::size_t(draw)].p_max));
    }
    const int layers = std::min(kBlockEdge, g.planes.extent.z - g.bz * kBlockEdge);
    for (int layer = 0; layer < layers; ++layer) {
        const std::uint64_t first = g.counter(Draw::counts, block, std::uint32_t(64 * layer));
        for (std::uint64_t c = 0; c < 64; ++c) counters[c] = first + c;
        philox_counters(batch, counters, 64, words);
        for (const int draw : {kHum, kAct}) {
            if (kind(draw) == DrawPlan::Kind::none) continue;
            if (kind(draw) == DrawPlan::Kind::varying) {
                find_in_layer(plan, draw, layer, s);
                make_thresholds(plan, draw, layer, ~std::uint64_t{0}, s.layer, t[draw]);
            }
            s.dense_events[draw][block][layer] = initial_bits(words, draw, t[draw].full.data());
        }
    }
}

inline void draw_initial_segment(const Segment& g, BirthScratch& s) {
    g.random.field->plan_blocks(g.bx0, g.by, g.bz, s.row, std::span(s.plans).first(std::size_t(g.blocks)));
    for (int b = 0; b < g.blocks; ++b) draw_initial_block(g, b, s.plans[std::size_t(b)], s);
    merge_events(g, s);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
