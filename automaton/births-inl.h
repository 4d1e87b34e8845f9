// SPDX-License-Identifier: Apache-2.0

// Extinction and birth for one row of blocks (D): per cell and draw an event with the field's probability, which
// sets hum or act or clears cld. Two exact ways, chosen per block and draw (docs/adr/0002):
//
//   sparse   Poisson events on random cells, one process for all sparse draws of a block together; each event's
//            second word decides by the rates of its cell which draw it belongs to, or none. The work is
//            proportional to the events, and the ellipsoids are evaluated only there;
//   dense    one random byte a cell against the top byte of p; the 1 in 256 that tie compare 24 bits more.

#if defined(NEPHOS_BIRTHS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_BIRTHS_INL_H_
#undef NEPHOS_BIRTHS_INL_H_
#else
#define NEPHOS_BIRTHS_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <vector>

#include "automaton/kernels.h"
#include "automaton/philox-inl.h"
#include "automaton/random.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

inline constexpr int kMaxLanes = 8;  // of 64 bits, in the widest vector

// Blocks are taken in segments of 64 along x: their events fill 64 rows of 64 bytes a draw, which stay in the
// first-level cache, and everything below has a fixed size.
inline constexpr int kSegmentBlocks = 64;
inline constexpr int kSegmentWords = kSegmentBlocks * kBlockEdge / 64;
inline constexpr int kMaxCounters = 512;  // queued before the sparse draws are run

// The sparse draws of one block.
struct SparseJob {
    int block;        // in the segment
    unsigned draws;   // a bit each
    int events;
    int first;        // its first counter in the queue; two events a counter
    float rate_unit;  // rate of the level * 2^-31
};

// Memory of one thread.
struct BirthScratch {
    // Cells that have an event: bit i of byte `block` of row y + 8 z is the cell i of that block. 0 between segments.
    std::uint64_t events[3][64][kSegmentWords] = {};
    std::uint64_t counters[kMaxCounters + kMaxLanes];             // packed, see philox-inl.h
    std::uint32_t words[4 * (kMaxCounters + kMaxLanes) + 32];     // 32 more: the last vector of events reads beyond
    std::uint32_t counts[4 * (kSegmentBlocks + kMaxLanes)];
    std::uint64_t cloudy[kSegmentWords];                          // a byte a block: not 0 when it holds any cld
    SparseJob jobs[kSegmentBlocks];
    int job_count = 0, counter_count = 0;
    bool dirty[3] = {};                                           // draws with events in this segment
    std::vector<const FieldEllipsoid*> row;
    std::vector<BlockPlan> plans = std::vector<BlockPlan>(kSegmentBlocks);
};

// A segment of a row of blocks: where its 64 rows of cells lie, and its planes.
struct Segment {
    const StepPlanes& planes;
    const StepRandom& random;
    const PhiloxKeys& keys;
    int by, bz;
    int bx0 = 0, blocks = 0;                                      // first block and number of blocks, <= 64
    std::array<std::ptrdiff_t, 64> row_word{};                    // first word of cell row y + 8 z; -1 outside

    PhiloxBatch batch() const {
        return {keys, random.step, std::uint32_t(bz) | std::uint32_t(Domain::lattice) << 16};
    }
    std::uint64_t counter(Draw draw, int block, std::uint32_t sub) const {
        const std::uint32_t word2 = std::uint32_t(bx0 + block) | std::uint32_t(by) << 16;
        return pack_counter(counter_word_0(std::uint32_t(draw), sub), word2);
    }
};

inline Draw draw_of(int draw) { return Draw(std::uint32_t(draw) + std::uint32_t(Draw::hum)); }

inline std::uint8_t* event_bytes(BirthScratch& s, int draw, int block) {
    return reinterpret_cast<std::uint8_t*>(s.events[draw]) + block;
}

// Marks a cell (x + 8 y + 64 z in its block); `bytes` comes from event_bytes().
HWY_INLINE void mark(std::uint8_t* bytes, std::uint32_t cell) {
    std::uint8_t& byte = bytes[(cell >> 3) * kSegmentBlocks];
    byte = std::uint8_t(byte | 1u << (cell & 7));
}

// The place of a vector of cells in one ellipsoid; the operations and their order are those of block_field.h.
template <class V>
struct InEllipsoid {
    V u2;        // squared normalised distance
    V falloff;   // (1 - u^2)^2
};

template <class DF, class V = hn::Vec<DF>>
HWY_INLINE InEllipsoid<V> locate(DF d, const BlockEllipsoid& e, V dx, V dy, V dz) {
    const V a = hn::Add(hn::Set(d, e.base_a), hn::Add(hn::Mul(dx, hn::Set(d, e.xx)), hn::Mul(dy, hn::Set(d, e.xy))));
    const V b = hn::Add(hn::Set(d, e.base_b), hn::Add(hn::Mul(dx, hn::Set(d, e.yx)), hn::Mul(dy, hn::Set(d, e.yy))));
    const V c = hn::Add(hn::Set(d, e.base_c), hn::Mul(dz, hn::Set(d, e.zz)));
    const V u2 = hn::Add(hn::Add(hn::Mul(a, a), hn::Mul(b, b)), hn::Mul(c, c));
    const V s = hn::Max(hn::Sub(hn::Set(d, 1.0f), u2), hn::Zero(d));
    return {u2, hn::Mul(s, s)};
}

// Takes an ellipsoid into p: the larger hum and act, the smaller ext.
template <class DF, class V = hn::Vec<DF>>
HWY_INLINE V combine(DF d, const BlockEllipsoid& e, std::size_t draw, const InEllipsoid<V>& at, V p) {
    const V value = hn::Add(hn::Set(d, e.source->rim[draw]), hn::Mul(hn::Set(d, e.source->span[draw]), at.falloff));
    const V combined = draw == kExt ? hn::Min(p, value) : hn::Max(p, value);
    return hn::IfThenElse(hn::Lt(at.u2, hn::Set(d, 1.0f)), combined, p);
}

// sparse_rate() of kernels.h
template <class DF, class V = hn::Vec<DF>>
HWY_INLINE V rate_of(DF d, V p) {
    const V z = hn::Div(p, hn::Sub(hn::Set(d, 2.0f), p));
    const V z2 = hn::Mul(z, z);
    V series = hn::Add(hn::Set(d, 0.2f), hn::Mul(z2, hn::Set(d, 1.0f / 7.0f)));
    series = hn::Add(hn::Set(d, 1.0f / 3.0f), hn::Mul(z2, series));
    series = hn::Add(hn::Set(d, 1.0f), hn::Mul(z2, series));
    return hn::Mul(hn::Add(z, z), series);
}

// A bit for each lane of a mask of floats.
template <class DF, class M>
HWY_INLINE std::uint32_t bits_of(DF d, M mask) {
    std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(d, mask, bytes);
    return std::uint32_t(bytes[0]) | std::uint32_t(bytes[1]) << 8;
}

// Runs one sparse job whose words are ready: the first word of an event holds its cell, the second is v, uniform in
// 0..rate of the level. v below the cell's rate of hum is a birth of hum, below that plus the rate of act one of act,
// below the sum of all three an extinction.
inline void run_sparse(const Segment& g, const SparseJob& job, BirthScratch& s) {
    const hn::ScalableTag<float> d;
    const hn::RebindToUnsigned<decltype(d)> du;
    const hn::RebindToSigned<decltype(d)> di;
    const int lanes = int(hn::Lanes(d));
    const std::uint32_t* words = s.words + 4 * job.first;
    const BlockPlan& plan = s.plans[std::size_t(job.block)];
    const auto& background = g.random.field->background();
    const auto seven = hn::Set(du, 7);
    const auto to_float = [&](auto v) HWY_ATTR { return hn::ConvertTo(d, hn::BitCast(di, v)); };
    for (int e = 0; e < job.events; e += lanes) {
        hn::Vec<decltype(du)> cell, second;
        hn::LoadInterleaved2(du, words + 2 * e, cell, second);
        const auto dx = to_float(hn::And(cell, seven));
        const auto dy = to_float(hn::And(hn::ShiftRight<3>(cell), seven));
        const auto dz = to_float(hn::And(hn::ShiftRight<6>(cell), seven));
        auto hum = hn::Set(d, background[kHum]), act = hn::Set(d, background[kAct]), ext = hn::Set(d, background[kExt]);
        for (const BlockEllipsoid& ellipsoid : plan.ellipsoids) {
            const auto at = locate(d, ellipsoid, dx, dy, dz);
            hum = combine(d, ellipsoid, kHum, at, hum);
            act = combine(d, ellipsoid, kAct, at, act);
            ext = combine(d, ellipsoid, kExt, at, ext);
        }
        const auto v = hn::Mul(to_float(hn::ShiftRight<1>(second)), hn::Set(d, job.rate_unit));
        auto sum = hn::Zero(d);
        if ((job.draws & 1u << kHum) != 0) sum = rate_of(d, hum);
        const std::uint32_t up_to_hum = bits_of(d, hn::Lt(v, sum));
        if ((job.draws & 1u << kAct) != 0) sum = hn::Add(sum, rate_of(d, act));
        const std::uint32_t up_to_act = bits_of(d, hn::Lt(v, sum));
        if ((job.draws & 1u << kExt) != 0) sum = hn::Add(sum, rate_of(d, ext));
        std::uint32_t accepted = bits_of(d, hn::Lt(v, sum));
        if (job.events - e < lanes) accepted &= (1u << (job.events - e)) - 1;
        for (; accepted != 0; accepted &= accepted - 1) {
            const int lane = std::countr_zero(accepted);
            const int draw = 2 - int(up_to_hum >> lane & 1) - int(up_to_act >> lane & 1);
            mark(event_bytes(s, draw, job.block), words[2 * (e + lane)] & 511u);
        }
    }
}

// Makes the words of all queued sparse draws and runs them.
inline void run_queue(const Segment& g, BirthScratch& s) {
    philox_counters(g.batch(), s.counters, s.counter_count, s.words);
    for (int j = 0; j < s.job_count; ++j) run_sparse(g, s.jobs[j], s);
    s.job_count = 0;
    s.counter_count = 0;
}

// Queues the sparse draws of a block with their counters.
inline void queue_sparse(const Segment& g, int block, unsigned draws, BirthScratch& s) {
    const PoissonTable& table =
        g.random.ladder->level(sparse_rate_bound(s.plans[std::size_t(block)], draws));
    const int events = table.events(s.counts[4 * block]);
    if (events == 0) return;
    const int counters = (events + 1) / 2;
    if (s.counter_count + counters > kMaxCounters) run_queue(g, s);
    s.jobs[s.job_count++] = {block, draws, events, s.counter_count, float(table.rate) * 0x1p-31f};
    const std::uint64_t first = g.counter(Draw::sparse, block, 0);
    for (int c = 0; c < counters; ++c) s.counters[s.counter_count + c] = first + std::uint64_t(c);
    s.counter_count += counters;
    for (int draw = 0; draw < 3; ++draw) s.dirty[draw] = s.dirty[draw] || (draws >> draw & 1) != 0;
}

// Thresholds of the 64 cells of a layer of a block, x fastest, and their top bytes.
struct LayerThresholds {
    std::array<std::uint32_t, 64> full;
    std::array<std::uint8_t, 64> top;
};

// Only rows with a bit in `wanted` are made.
inline void make_thresholds(const Segment& g, const BlockPlan& plan, int draw, int layer, std::uint64_t wanted,
                            LayerThresholds& out) {
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
            hn::StoreU(hn::IfThenElse(certain, hn::Set(du, kCertain), threshold), du, out.full.data() + row * 8 + x);
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

// Decides tied cells by 24 more bits each: word c % 4 of counter 32 + c / 4. `threshold(cell)` for cells of the layer.
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
            bits = compare_bytes(bytes, [t](auto d, std::size_t) HWY_ATTR { return hn::Set(d, std::uint8_t(t >> 24)); });
            bits.tie &= wanted[layer];
            resolve_ties(g, block, draw, layer, [t](std::size_t) { return t; }, bits);
        } else {
            HWY_ALIGN LayerThresholds t{};
            make_thresholds(g, plan, draw, layer, wanted[layer], t);
            bits = compare_bytes(bytes, [&t](auto d, std::size_t c) HWY_ATTR { return hn::LoadU(d, t.top.data() + c); });
            bits.tie &= wanted[layer];
            resolve_ties(g, block, draw, layer, [&t](std::size_t c) { return t.full[c]; }, bits);
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
    for (std::size_t row = 0; row < 64; ++row) out[row * kSegmentBlocks] = std::uint8_t(out[row * kSegmentBlocks] | rows[row]);
}

// Which blocks of the segment hold any cld: the others need no extinction.
inline void find_cloudy(const Segment& g, std::uint64_t* any) {
    const int words = (g.blocks + 7) / 8;
    const std::uint64_t* cld = g.planes.cld + g.bx0 / 8;
    std::fill_n(any, kSegmentWords, std::uint64_t{0});
    for (std::ptrdiff_t at : g.row_word) {
        if (at < 0) continue;
        if (words == kSegmentWords) {  // a fixed length, so that it becomes a few vectors
            for (int w = 0; w < kSegmentWords; ++w) any[w] |= cld[at + w];
        } else {
            for (int w = 0; w < words; ++w) any[w] |= cld[at + w];
        }
    }
}

// Puts the events of the segment into the planes and forgets them.
inline void merge_events(const Segment& g, BirthScratch& s) {
    const int words = (g.blocks + 7) / 8;
    const int cells_left = g.planes.extent.x - g.bx0 * kBlockEdge;
    const std::uint64_t last = cells_left >= words * 64 ? ~std::uint64_t{0}
                                                        : (std::uint64_t{1} << (cells_left % 64)) - 1;
    std::uint64_t* const planes[3] = {g.planes.hum, g.planes.act_next, g.planes.cld};
    for (int draw = 0; draw < 3; ++draw) {
        if (!s.dirty[draw]) continue;
        s.dirty[draw] = false;
        for (std::size_t row = 0; row < 64; ++row) {
            std::uint64_t* events = s.events[draw][row];
            if (g.row_word[row] >= 0) {
                std::uint64_t* out = planes[draw] + g.row_word[row] + g.bx0 / 8;
                events[words - 1] &= last;
                if (draw == kExt) {
                    for (int w = 0; w < words; ++w) out[w] &= ~events[w];
                } else {
                    for (int w = 0; w < words; ++w) out[w] |= events[w];
                }
            }
            std::fill_n(events, kSegmentWords, std::uint64_t{0});
        }
    }
}

inline void draw_segment(const Segment& g, BirthScratch& s) {
    const BlockField& field = *g.random.field;
    if (field.any_extinction()) find_cloudy(g, s.cloudy);
    std::uint64_t counters[kSegmentBlocks + kMaxLanes];
    for (int b = 0; b < kSegmentBlocks + kMaxLanes; ++b) counters[b] = g.counter(Draw::counts, b, 0);
    philox_counters(g.batch(), counters, g.blocks, s.counts);

    field.plan_blocks(g.bx0, g.by, g.bz, s.row, std::span(s.plans).first(std::size_t(g.blocks)));
    for (int b = 0; b < g.blocks; ++b) {
        const BlockPlan& plan = s.plans[std::size_t(b)];
        unsigned sparse = 0;
        for (int draw = 0; draw < 3; ++draw) {
            const DrawPlan& draw_plan = plan.draws[std::size_t(draw)];
            if (draw_plan.kind == DrawPlan::Kind::none) continue;
            if (draw == kExt && (s.cloudy[b / 8] >> (b % 8 * 8) & 0xFF) == 0) continue;
            if (is_sparse(draw_plan)) {
                sparse |= 1u << draw;
            } else {
                run_dense(g, b, draw, plan, s);
            }
        }
        if (sparse != 0) queue_sparse(g, b, sparse, s);
    }
    run_queue(g, s);
    merge_events(g, s);
}

// Rows of blocks by_begin..by_end of slab bz.
inline void draw_part(const StepPlanes& planes, const StepRandom& random, int bz, int by_begin, int by_end) {
    const PhiloxKeys keys(random.seed);
    const auto scratch = std::make_unique<BirthScratch>();
    const int all_blocks = (planes.extent.x + kBlockEdge - 1) / kBlockEdge;
    for (int by = by_begin; by < by_end; ++by) {
        Segment segment{planes, random, keys, by, bz};
        for (int i = 0; i < 64; ++i) {
            const int j = by * kBlockEdge + i % 8, k = bz * kBlockEdge + i / 8;
            const bool inside = j < planes.extent.y && k < planes.extent.z;
            segment.row_word[std::size_t(i)] =
                inside ? (std::ptrdiff_t(k) * planes.extent.y + j) * std::ptrdiff_t(planes.words_per_row) : -1;
        }
        random.field->collect(by, bz, scratch->row);
        for (segment.bx0 = 0; segment.bx0 < all_blocks; segment.bx0 += kSegmentBlocks) {
            segment.blocks = std::min(kSegmentBlocks, all_blocks - segment.bx0);
            draw_segment(segment, *scratch);
        }
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
