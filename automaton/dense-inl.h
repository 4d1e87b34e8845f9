// SPDX-License-Identifier: Apache-2.0

// The dense draw (docs/adr/0002): compares one random byte a cell with the top byte of its p; ties, 1 in 256,
// compare 24 bits more at the end of the segment. Layers of a block that the draw cannot change are skipped.

#if defined(NEPHOS_DENSE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_DENSE_INL_H_
#undef NEPHOS_DENSE_INL_H_
#else
#define NEPHOS_DENSE_INL_H_
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include <hwy/highway.h>

#include "automaton/block_bits-inl.h"
#include "automaton/segment-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Thresholds of the 64 cells of a layer of a block, x fastest, and their top bytes.
struct LayerThresholds {
    alignas(64) std::array<std::uint32_t, 64> full;
    alignas(64) std::array<std::uint8_t, 64> top;
};

// Computes a*a + b*b (block_field.h) of the 64 columns of a block, x fastest, for each of its ellipsoids.
inline void locate_columns(const BlockPlan& plan, std::vector<float>& columns) {
    const hn::CappedTag<float, 8> d;
    columns.resize(64 * plan.ellipsoids.size());
    float* out = columns.data();
    for (const BlockEllipsoid& e : plan.ellipsoids) {
        const auto base_a = hn::Set(d, e.base_a), base_b = hn::Set(d, e.base_b);
        for (std::size_t y = 0; y < 8; ++y) {
            const auto ya = hn::Set(d, float(y) * e.xy), yb = hn::Set(d, float(y) * e.yy);
            for (std::size_t x = 0; x < 8; x += hn::Lanes(d), out += hn::Lanes(d)) {
                const auto dx = hn::Iota(d, float(x));
                const auto a = hn::Add(base_a, hn::Add(hn::Mul(dx, hn::Set(d, e.xx)), ya));
                const auto b = hn::Add(base_b, hn::Add(hn::Mul(dx, hn::Set(d, e.yx)), yb));
                hn::StoreU(hn::Add(hn::Mul(a, a), hn::Mul(b, b)), d, out);
            }
        }
    }
}

// Collects the ellipsoids that reach into a layer. One whose p at the rim does not exceed the background may
// be evaluated outside its rim as well (bounded = false): the maximum with the background hides it there.
inline void find_in_layer(const BlockPlan& plan, int draw, int layer, BirthScratch& s) {
    const auto which = std::size_t(draw);
    const float low = plan.background.low[which], high = plan.background.high[which];
    s.layer.clear();
    for (std::size_t i = 0; i < plan.ellipsoids.size(); ++i) {
        const BlockEllipsoid& e = plan.ellipsoids[i];
        const float c = e.base_c + float(layer) * e.zz;
        if (c * c >= 1) continue;
        const float rim = e.source->rim[which];
        const bool bounded = draw == kExt ? rim < high : rim > low;
        s.layer.push_back({s.columns.data() + 64 * i, c * c, rim, e.source->span[which], bounded});
    }
}

// Computes the thresholds of a layer; skips vectors without a bit in `requested`.
inline void make_thresholds(const BlockPlan& plan, int draw, int layer, std::uint64_t requested,
                            const std::vector<LayerEllipsoid>& ellipsoids, LayerThresholds& out) {
    const hn::CappedTag<float, 16> d;
    const hn::RebindToSigned<decltype(d)> di;
    const hn::RebindToUnsigned<decltype(d)> du;
    const hn::Rebind<std::uint8_t, decltype(d)> d8;
    constexpr std::size_t kLanes = hn::MaxLanes(d);
    const auto one = hn::Set(d, 1.0f);
    const float* const values = plan.background.values[std::size_t(draw)];
    for (std::size_t c = 0; c < 64; c += kLanes) {
        if ((requested >> c & ((std::uint64_t{1} << kLanes) - 1)) == 0) continue;
        auto p = values != nullptr ? hn::LoadU(d, values + 64 * layer + c)
                                   : hn::Set(d, plan.background.low[std::size_t(draw)]);
        for (const LayerEllipsoid& e : ellipsoids) {
            const auto u2 = hn::Add(hn::LoadU(d, e.columns + c), hn::Set(d, e.c2));
            const auto s = hn::Max(hn::Sub(one, u2), hn::Zero(d));
            const auto value = hn::Add(hn::Set(d, e.rim), hn::Mul(hn::Set(d, e.span), hn::Mul(s, s)));
            const auto combined = draw == kExt ? hn::Min(p, value) : hn::Max(p, value);
            p = e.bounded ? hn::IfThenElse(hn::Lt(u2, one), combined, p) : combined;
        }
        // probability_threshold() of kernels.h
        const auto scaled = hn::ConvertTo(di, hn::Mul(p, hn::Set(d, 0x1p31f)));
        const auto certain = hn::RebindMask(du, hn::Ge(p, one));
        const auto threshold =
            hn::IfThenElse(certain, hn::Set(du, kCertain), hn::ShiftLeft<1>(hn::BitCast(du, scaled)));
        hn::Store(threshold, du, out.full.data() + c);
        hn::StoreU(hn::DemoteTo(d8, hn::BitCast(di, hn::ShiftRight<24>(threshold))), d8, out.top.data() + c);
    }
}

// One bit for each of 64 cells: random byte less than, or equal to, that of `top(cell)`.
struct LayerBits {
    std::uint64_t less = 0, tie = 0;
};

template <class Top>
HWY_INLINE LayerBits compare_bytes(const std::uint8_t* random, const Top& top) {
    LayerBits bits;
#if HWY_TARGET == HWY_SCALAR  // one lane does not fill a byte of mask bits
    const hn::ScalableTag<std::uint8_t> d;
    for (std::size_t c = 0; c < 64; ++c) {
        const std::uint8_t threshold = hn::GetLane(top(d, c));
        bits.less |= std::uint64_t{random[c] < threshold} << c;
        bits.tie |= std::uint64_t{random[c] == threshold} << c;
    }
#elif HWY_TARGET <= HWY_AVX3
    const hn::CappedTag<std::uint8_t, 64> d;
    const auto value = hn::LoadU(d, random), threshold = top(d, 0);
    bits.less = hn::Lt(value, threshold).raw;
    bits.tie = hn::Eq(value, threshold).raw;
#else
    const hn::CappedTag<std::uint8_t, 64> d;
    HWY_ALIGN std::uint8_t less[16], tie[16];  // StoreMaskBits may write 8 bytes from where it starts
    for (std::size_t c = 0; c < 64; c += hn::Lanes(d)) {
        const auto value = hn::LoadU(d, random + c), threshold = top(d, c);
        hn::StoreMaskBits(d, hn::Lt(value, threshold), less + c / 8);
        hn::StoreMaskBits(d, hn::Eq(value, threshold), tie + c / 8);
    }
    std::memcpy(&bits.less, less, 8);
    std::memcpy(&bits.tie, tie, 8);
#endif
    return bits;
}

// Decides the queued ties by 24 more random bits. Cell c takes word c % 4 of counter 32 + c / 4.
inline void run_ties(const Segment& g, BirthScratch& s) {
    constexpr int kBatch = 64;
    HWY_ALIGN std::uint64_t counters[kBatch + kMaxLanes64] = {};
    HWY_ALIGN std::uint32_t words[4 * (kBatch + kMaxLanes64)];
    Tie ties[kBatch];
    int count = 0;
    const auto decide = [&]() HWY_ATTR {
        philox_counters(g.batch(), counters, count, words);
        for (int n = 0; n < count; ++n) {
            const Tie& tie = ties[n];
            const std::uint64_t event = words[4 * std::uint32_t(n) + tie.cell % 4] >> 8 < tie.below;
            s.dense_events[tie.draw][tie.block][tie.cell / 64] |= event << (tie.cell % 64);
        }
        count = 0;
    };
    for (int i = 0; i < s.tie_count; ++i) {
        const LayerTies& layer = s.ties[i];
        for (std::uint64_t cells = layer.cells; cells != 0; cells &= cells - 1) {
            const std::uint32_t cell = 64 * layer.layer + std::uint32_t(std::countr_zero(cells));
            counters[count] = g.counter(draw_of(layer.draw), layer.block, 32 + cell / 4);
            ties[count++] = {layer.block, layer.draw, cell, layer.below};
            if (count == kBatch) decide();
        }
    }
    decide();
    s.tie_count = 0;
}

// Returns the threshold of the 24 further bits of a tied cell.
inline std::uint32_t tie_threshold(std::uint32_t t) { return t == kCertain ? 0x1000000u : t & 0xFFFFFFu; }

// Queues the tied cells of a layer that share a threshold. Branchless: about half of all layers have one.
HWY_INLINE LayerTies* queue_ties(LayerTies* to, int block, int draw, int layer, std::uint64_t cells,
                                 std::uint32_t below) {
    *to = {cells, below, std::uint8_t(block), std::uint8_t(draw), std::uint8_t(layer)};
    return to + int{cells != 0};
}

// Generates the random bytes of the layers in `layers` (a bit each): 4 counters a layer, 16 bytes a counter.
inline void random_bytes(const Segment& g, int block, int draw, unsigned layers, BirthScratch& s,
                         std::uint32_t* out) {
    const std::uint64_t first = g.counter(draw_of(draw), block, 0);
    if (layers == 0xFF) {
        std::optional<PhiloxTable<32>>& table = s.dense_tables[draw];
        if (!table) table.emplace(g.batch(), std::uint32_t(draw_of(draw)));
        philox_counters(g.batch(), *table, PhiloxBlock(g.batch(), std::uint32_t(first >> 32)), 32, out);
        return;
    }
    HWY_ALIGN std::uint64_t counters[32 + kMaxLanes64] = {};
    int count = 0;
    for (; layers != 0; layers &= layers - 1) {
        const auto sub = std::uint64_t(4 * std::countr_zero(layers));
        for (std::uint64_t i = 0; i < 4; ++i) counters[count++] = first + sub + i;
    }
    philox_counters(g.batch(), counters, count, out);
}

// Compares the random bytes of the layers in `layers` (a bit each) with one threshold.
inline void compare_uniform(const Segment& g, int block, int draw, std::uint32_t threshold,
                            const CellBits& requested, unsigned layers, const std::uint8_t* bytes,
                            BirthScratch& s) {
    if (s.tie_count + 8 > kMaxTies) run_ties(g, s);
    const std::uint32_t below = tie_threshold(threshold);
    const auto top = [threshold](auto d, std::size_t)
                         HWY_ATTR { return hn::Set(d, std::uint8_t(threshold >> 24)); };
    CellBits& events = s.dense_events[draw][block];
    LayerTies* ties = s.ties + s.tie_count;
    for (; layers != 0; layers &= layers - 1, bytes += 64) {
        const int layer = std::countr_zero(layers);
        const LayerBits bits = compare_bytes(bytes, top);
        ties = queue_ties(ties, block, draw, layer, bits.tie & requested[layer], below);
        events[layer] = bits.less & requested[layer];
    }
    s.tie_count = int(ties - s.ties);
}

inline void run_dense(const Segment& g, int block, int draw, const BlockPlan& plan, BirthScratch& s) {
    s.dense_words[draw] |= 1u << (block / 8);
    CellBits& events = s.dense_events[draw][block];
    CellBits requested;
    if (draw == kExt) {
        std::memcpy(requested, cloud_of_block(g, block, s), sizeof requested);
    } else {
        std::fill_n(requested, 8, ~std::uint64_t{0});
    }
    const DrawPlan& draw_plan = plan.draws[std::size_t(draw)];
    if (draw_plan.kind == DrawPlan::Kind::certain) {
        std::memcpy(events, requested, sizeof requested);
        return;
    }
    unsigned layers = 0;
    for (int layer = 0; layer < 8; ++layer) layers |= unsigned{requested[layer] != 0} << layer;
    HWY_ALIGN std::uint32_t random[4 * (32 + kMaxLanes64)];
    random_bytes(g, block, draw, layers, s, random);
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(random);
    if (draw_plan.kind == DrawPlan::Kind::uniform) {
        compare_uniform(g, block, draw, probability_threshold(draw_plan.p_max), requested, layers, bytes, s);
        return;
    }
    locate_columns(plan, s.columns);
    LayerThresholds t{};
    for (; layers != 0; layers &= layers - 1, bytes += 64) {
        const int layer = std::countr_zero(layers);
        if (s.tie_count + 64 > kMaxTies) run_ties(g, s);
        find_in_layer(plan, draw, layer, s);
        make_thresholds(plan, draw, layer, requested[layer], s.layer, t);
        const LayerBits bits = compare_bytes(
            bytes, [&t](auto d, std::size_t c) HWY_ATTR { return hn::LoadU(d, t.top.data() + c); });
        LayerTies* ties = s.ties + s.tie_count;
        for (std::uint64_t cells = bits.tie & requested[layer]; cells != 0; cells &= cells - 1) {
            const std::uint32_t full = t.full[std::size_t(std::countr_zero(cells))];
            ties = queue_ties(ties, block, draw, layer, cells & (~cells + 1), tie_threshold(full));
        }
        s.tie_count = int(ties - s.ties);
        events[layer] = bits.less & requested[layer];
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
