// SPDX-License-Identifier: Apache-2.0

// The first state (docs/adr/0002): births on the empty lattice, from a domain of randomness of their own. Cells 2 n
// and 2 n + 1 of a block share the sub-index n: words 0 and 1, or 2 and 3, are compared with the thresholds of hum and act.

#if defined(NEPHOS_INITIAL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_INITIAL_INL_H_
#undef NEPHOS_INITIAL_INL_H_
#else
#define NEPHOS_INITIAL_INL_H_
#endif

#include <algorithm>
#include <cstdint>
#include <span>

#include <hwy/highway.h>

#include "automaton/dense-inl.h"
#include "automaton/segment-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Draws hum and act of one block of the segment into s.events, in the order of layers.
inline void draw_initial_block(const Segment& g, int block, const BlockPlan& plan, BirthScratch& s) {
    const auto kind = [&](int draw) { return plan.draws[std::size_t(draw)].kind; };
    if (kind(kHum) == DrawPlan::Kind::none && kind(kAct) == DrawPlan::Kind::none) return;
    const bool varying = kind(kHum) == DrawPlan::Kind::varying || kind(kAct) == DrawPlan::Kind::varying;
    if (varying) locate_columns(plan, s.columns);
    const PhiloxBatch batch{g.keys, 0, std::uint32_t(g.bz) | std::uint32_t(Domain::initial_state) << 16};
    if (!s.initial_table) s.initial_table.emplace(batch, Draw::counts);
    const PhiloxBlock shared(batch, g.block_word(block));
    const hn::CappedTag<std::uint32_t, 16> d;
    alignas(64) std::uint32_t thresholds[2][64];
    bool possible[2] = {};
    for (const int draw : {kHum, kAct}) {
        const DrawPlan& draw_plan = plan.draws[std::size_t(draw)];
        const bool none = draw_plan.kind == DrawPlan::Kind::none;
        const std::uint32_t same = none ? 0 : probability_threshold(draw_plan.p_max);
        std::fill_n(thresholds[draw], 64, same);
        possible[draw] = same != 0;
    }
    const int layers = std::min(kBlockEdge, g.planes.extent.z - g.bz * kBlockEdge);
    for (int layer = 0; layer < layers; ++layer) {
        for (const int draw : {kHum, kAct}) {
            if (kind(draw) != DrawPlan::Kind::varying) continue;
            find_in_layer(plan, draw, layer, s);
            auto all = hn::Zero(d);
            make_thresholds(plan, draw, layer, ~std::uint64_t{0}, s.layer, [&](std::size_t c, auto values) HWY_ATTR {
                hn::StoreU(values, d, thresholds[draw] + c);
                all = hn::Or(all, values);
            });
            possible[draw] = !hn::AllTrue(d, hn::Eq(all, hn::Zero(d)));
        }
        if (!possible[kHum] && !possible[kAct]) continue;
        std::uint64_t bits[2] = {};
        philox_pairs(batch, *s.initial_table, shared, 32 * layer, [&](int c, auto of_hum, auto of_act) HWY_ATTR {
            const auto happens = [&](int draw, auto word) HWY_ATTR {
                // The largest word is taken for the one before, as certain cells have the largest threshold, others an even one.
                const auto below_certain = hn::Min(word, hn::Set(d, kCertain - 1));
                return bits_of(d, hn::Lt(below_certain, hn::LoadU(d, thresholds[draw] + c))) << c;
            };
            bits[kHum] |= happens(kHum, of_hum);
            bits[kAct] |= happens(kAct, of_act);
        });
        s.events[kHum][block][layer] = bits[kHum];
        s.events[kAct][block][layer] = bits[kAct];
    }
}

inline void draw_initial_segment(const Segment& g, BirthScratch& s) {
    g.random.field->plan_blocks(g.bx0, g.by, g.bz, s.row, std::span(s.plans).first(std::size_t(g.blocks)));
    for (const int draw : {kHum, kAct}) fill_bits(s.events[draw], kSegmentBlocks, 0);
    for (int b = 0; b < g.blocks; ++b) draw_initial_block(g, b, s.plans[std::size_t(b)], s);
    apply_bits(g, kHum, s.events[kHum], BitOrder::layers);
    apply_bits(g, kAct, s.events[kAct], BitOrder::layers);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
