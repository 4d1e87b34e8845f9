// SPDX-License-Identifier: Apache-2.0

// The dense draw (docs/adr/0002): one random byte a cell against the top byte of its p; the 1 in 256 that tie
// compare 24 bits more. Layers of a block that the draw cannot change are skipped.

#if defined(NEPHOS_DENSE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_DENSE_INL_H_
#undef NEPHOS_DENSE_INL_H_
#else
#define NEPHOS_DENSE_INL_H_
#endif

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>

#include <hwy/highway.h>

#include "automaton/segment-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Thresholds of the 64 cells of a layer of a block, x fastest, and their top bytes.
struct LayerThresholds {
    std::array<std::uint32_t, 64> full;
    std::array<std::uint8_t, 64> top;
};

// Only rows with a bit in `wanted` are made.
inline void make_thresholds(const Segment& g, const BlockPlan& plan, int draw, int layer,
                            std::uint64_t wanted, LayerThresholds& out) {
    const hn::CappedTag<float, 8> d;
    const std::size_t lanes = hn::Lanes(d);
    const auto which = std::size_t(draw);
    const auto background = hn::Set(d, g.random.field->background()[which]);
    const auto dz = hn::Set(d, float(layer));
    const hn::RebindToSigned<decltype(d)> di;
    const hn::RebindToUnsigned<decltype(d)> du;
    for (std::size_t row = 0; row < 8; ++row) {
        if ((wanted >> (8 * row) & 0xFF) == 0) continue;
        const auto dy = hn::Set(d, float(row));
        for (std::size_t x = 0; x < 8; x += lanes) {
            auto value = background;
            for (const BlockEllipsoid& e : plan.ellipsoids) {
                value = combine(d, e, which, locate(d, e, hn::Iota(d, float(x)), dy, dz), value);
            }
            // probability_threshold() of kernels.h
            const auto scaled = hn::ConvertTo(di, hn::Mul(value, hn::Set(d, 0x1p31f)));
            const auto threshold = hn::ShiftLeft<1>(hn::BitCast(du, scaled));
            const auto certain = hn::RebindMask(du, hn::Ge(value, hn::Set(d, 1.0f)));
            hn::StoreU(hn::IfThenElse(certain, hn::Set(du, kCertain), threshold), du,
                       out.full.data() + row * 8 + x);
        }
    }
    for (std::size_t c = 0; c < 64; ++c) out.top[c] = std::uint8_t(out.full[c] >> 24);
}

// A bit for each of 64 cells: random byte below `top(cell)`, and equal to it.
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

// Decides tied cells by 24 more bits each: word c % 4 of counter 32 + c / 4. `threshold(cell)` for cells of
// the layer.
template <class Threshold>
HWY_INLINE void resolve_ties(const Segment& g, int block, int draw, int layer, const Threshold& threshold,
                             LayerBits& bits) {
    while (bits.tie != 0) {
        int cells[kMaxLanes];
        std::uint64_t counters[kMaxLanes] = {};
        int count = 0;
        for (; bits.tie != 0 && count < 4; bits.tie &= bits.tie - 1, ++count) {
            cells[count] = std::countr_zero(bits.tie);
            const int cell = layer * 64 + cells[count];
            counters[count] = g.counter(draw_of(draw), block, 32 + std::uint32_t(cell) / 4);
        }
        std::uint32_t words[4 * kMaxLanes];
        philox_counters(g.batch(), counters, count, words);
        for (int n = 0; n < count; ++n) {
            const std::uint32_t t = threshold(std::size_t(cells[n]));
            const bool event = t == kCertain || (words[4 * n + cells[n] % 4] >> 8) < (t & 0xFFFFFFu);
            bits.less |= std::uint64_t{event} << cells[n];
        }
    }
}

// Cells of a layer that are cld now: only these can be extinguished.
inline std::uint64_t cloud_of_layer(const Segment& g, int block, int layer) {
    std::uint64_t bits = 0;
    for (int row = 0; row < 8; ++row) {
        const std::ptrdiff_t at = g.row_word[std::size_t(8 * layer + row)];
        if (at < 0) continue;
        const std::uint64_t word = g.planes.cld[at + (g.bx0 + block) / 8];
        bits |= (word >> (block % 8 * 8) & 0xFF) << (8 * row);
    }
    return bits;
}

// The dense draw of two layers, whose random bytes are 8 counters.
inline void run_dense_layers(const Segment& g, int block, int draw, const BlockPlan& plan, int first_layer,
                             const std::uint64_t* wanted, std::uint64_t* events) {
    HWY_ALIGN std::uint64_t counters[8];
    HWY_ALIGN std::uint32_t random[32];
    const std::uint64_t first = g.counter(draw_of(draw), block, std::uint32_t(4 * first_layer));
    for (std::uint64_t sub = 0; sub < 8; ++sub) counters[sub] = first + sub;
    philox_counters(g.batch(), counters, 8, random);
    const DrawPlan& draw_plan = plan.draws[std::size_t(draw)];
    for (int layer = first_layer; layer < first_layer + 2; ++layer) {
        if (wanted[layer] == 0) continue;
        const auto* bytes = reinterpret_cast<const std::uint8_t*>(random) + 64 * (layer - first_layer);
        LayerBits bits;
        if (draw_plan.kind == DrawPlan::Kind::uniform) {
            const std::uint32_t t = probability_threshold(draw_plan.p_max);
            bits = compare_bytes(
                bytes, [t](auto d, std::size_t) HWY_ATTR { return hn::Set(d, std::uint8_t(t >> 24)); });
            bits.tie &= wanted[layer];
            resolve_ties(
                g, block, draw, layer, [t](std::size_t) { return t; }, bits);
        } else {
            HWY_ALIGN LayerThresholds t{};
            make_thresholds(g, plan, draw, layer, wanted[layer], t);
            bits = compare_bytes(
                bytes, [&t](auto d, std::size_t c) HWY_ATTR { return hn::LoadU(d, t.top.data() + c); });
            bits.tie &= wanted[layer];
            resolve_ties(
                g, block, draw, layer, [&t](std::size_t c) { return t.full[c]; }, bits);
        }
        events[layer] = bits.less & wanted[layer];
    }
}

inline void run_dense(const Segment& g, int block, int draw, const BlockPlan& plan, BirthScratch& s) {
    s.dirty[draw] = true;
    std::array<std::uint64_t, 8> wanted, events{};  // a word a layer
    wanted.fill(~std::uint64_t{0});
    if (draw == kExt) {
        for (int layer = 0; layer < 8; ++layer) wanted[std::size_t(layer)] = cloud_of_layer(g, block, layer);
    }
    if (plan.draws[std::size_t(draw)].kind == DrawPlan::Kind::certain) {
        events = wanted;
    } else {
        for (int layer = 0; layer < 8; layer += 2) {
            if ((wanted[std::size_t(layer)] | wanted[std::size_t(layer) + 1]) == 0) continue;
            run_dense_layers(g, block, draw, plan, layer, wanted.data(), events.data());
        }
    }
    std::uint8_t* out = event_bytes(s, draw, block);
    const auto* rows = reinterpret_cast<const std::uint8_t*>(events.data());
    for (std::size_t row = 0; row < 64; ++row)
        out[row * kSegmentBlocks] = std::uint8_t(out[row * kSegmentBlocks] | rows[row]);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
