// SPDX-License-Identifier: Apache-2.0

// Extinction and birth for one row of blocks (D): per cell and draw an event with the field's probability, which
// sets hum or act or clears cld. Two exact ways, chosen per block and draw (docs/adr/0002):
//
//   sparse   N ~ Poisson events on random cells, each accepted with ln(1-p)/ln(1-p_level) for its cell: the work
//            is proportional to the events, and the ellipsoids are evaluated only there;
//   dense    one random byte a cell against the top byte of p; the 1 in 256 that tie compare 24 bits more.
//
// A word of the sparse draw holds the cell (9 bits) and the number that decides on acceptance (23 bits).

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

// One sparse draw of one block.
struct SparseJob {
    int block;          // in the segment
    int draw;           // kHum, kAct, kExt
    int events;
    int first;          // its first counter in the queue
    bool accept_all;    // p is the level itself in every cell
    float rate_unit;    // rate of the level * 2^-23
};

// Memory of one thread.
struct BirthScratch {
    // Cells that have an event: bit i of byte `block` of row y + 8 z is the cell i of that block. 0 between segments.
    std::uint64_t events[3][64][kSegmentWords] = {};
    std::uint64_t counters[kMaxCounters + kMaxLanes];             // packed, see philox-inl.h
    std::uint32_t words[4 * (kMaxCounters + kMaxLanes) + 16];     // 16 more: the last vector of events reads beyond
    std::uint32_t counts[4 * (kSegmentBlocks + kMaxLanes)];
    std::uint64_t cloudy[kSegmentWords];                          // a byte a block: not 0 when it holds any cld
    SparseJob jobs[3 * kSegmentBlocks];
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

// p of up to a vector of cells of a block; the operations and their order are those of block_field.h.
template <class DF, class V = hn::Vec<DF>>
HWY_INLINE V probability_of_cells(DF d, const BlockPlan& plan, int draw, float background, V dx, V dy, V dz) {
    V p = hn::Set(d, background);
    const V one = hn::Set(d, 1.0f);
    for (const BlockEllipsoid& e : plan.ellipsoids) {
        const V a = hn::Add(hn::Set(d, e.base_a), hn::Add(hn::Mul(dx, hn::Set(d, e.xx)), hn::Mul(dy, hn::Set(d, e.xy))));
        const V b = hn::Add(hn::Set(d, e.base_b), hn::Add(hn::Mul(dx, hn::Set(d, e.yx)), hn::Mul(dy, hn::Set(d, e.yy))));
        const V c = hn::Add(hn::Set(d, e.base_c), hn::Mul(dz, hn::Set(d, e.zz)));
        const V u2 = hn::Add(hn::Add(hn::Mul(a, a), hn::Mul(b, b)), hn::Mul(c, c));
        const V s = hn::Max(hn::Sub(one, u2), hn::Zero(d));
        const V value = hn::Add(hn::Set(d, e.source->rim[std::size_t(draw)]),
                                hn::Mul(hn::Set(d, e.source->span[std::size_t(draw)]), hn::Mul(s, s)));
        const V combined = draw == kExt ? hn::Min(p, value) : hn::Max(p, value);
        p = hn::IfThenElse(hn::Lt(u2, one), combined, p);
    }
    return p;
}

// Runs one sparse job whose words are ready.
inline void run_sparse(const Segment& g, const SparseJob& job, BirthScratch& s) {
    const std::uint32_t* words = s.words + 4 * job.first;
    std::uint8_t* bytes = event_bytes(s, job.draw, job.block);
    if (job.accept_all) {
        for (int e = 0; e < job.events; ++e) mark(bytes, words[e] & 511u);
        return;
    }
    const hn::ScalableTag<float> d;
    const hn::RebindToUnsigned<decltype(d)> du;
    const hn::RebindToSigned<decltype(d)> di;
    const int lanes = int(hn::Lanes(d));
    const BlockPlan& plan = s.plans[std::size_t(job.block)];
    const float background = g.random.field->background()[std::size_t(job.draw)];
    const auto seven = hn::Set(du, 7);
    const auto one = hn::Set(d, 1.0f), two = hn::Set(d, 2.0f);
    const auto to_float = [&](auto v) { return hn::ConvertTo(d, hn::BitCast(di, v)); };
    for (int e = 0; e < job.events; e += lanes) {
        const auto word = hn::LoadU(du, words + e);
        const auto dx = to_float(hn::And(word, seven));
        const auto dy = to_float(hn::And(hn::ShiftRight<3>(word), seven));
        const auto dz = to_float(hn::And(hn::ShiftRight<6>(word), seven));
        const auto p = probability_of_cells(d, plan, job.draw, background, dx, dy, dz);
        // sparse_rate() of kernels.h
        const auto z = hn::Div(p, hn::Sub(two, p));
        const auto z2 = hn::Mul(z, z);
        auto series = hn::Add(hn::Set(d, 0.2f), hn::Mul(z2, hn::Set(d, 1.0f / 7.0f)));
        series = hn::Add(hn::Set(d, 1.0f / 3.0f), hn::Mul(z2, series));
        series = hn::Add(one, hn::Mul(z2, series));
        const auto rate = hn::Mul(hn::Add(z, z), series);
        const auto uniform = hn::Add(to_float(hn::ShiftRight<9>(word)), hn::Set(d, 0.5f));
        const auto accepted = hn::Lt(hn::Mul(uniform, hn::Set(d, job.rate_unit)), rate);
        std::uint8_t mask[8] = {};
        hn::StoreMaskBits(d, accepted, mask);
        std::uint32_t bits = std::uint32_t(mask[0]) | std::uint32_t(mask[1]) << 8;
        if (job.events - e < lanes) bits &= (1u << (job.events - e)) - 1;
        for (; bits != 0; bits &= bits - 1) mark(bytes, words[e + std::countr_zero(bits)] & 511u);
    }
}

// Makes the words of all queued sparse draws and runs them.
inline void run_queue(const Segment& g, BirthScratch& s) {
    philox_counters(g.batch(), s.counters, s.counter_count, s.words);
    for (int j = 0; j < s.job_count; ++j) run_sparse(g, s.jobs[j], s);
    s.job_count = 0;
    s.counter_count = 0;
}

// Queues a sparse draw with its counters.
inline void queue_sparse(const Segment& g, int block, int draw, const DrawPlan& plan, BirthScratch& s) {
    const SparseTables& tables = *g.random.tables;
    const bool uniform = plan.kind == DrawPlan::Kind::uniform;
    const PoissonTable& table =
        uniform ? tables.background[std::size_t(draw)] : tables.ladder.level(plan.p_max);
    const int events = table.events(s.counts[4 * block + draw]);
    if (events == 0) return;
    const int counters = (events + 3) / 4;
    if (s.counter_count + counters > kMaxCounters) run_queue(g, s);
    s.jobs[s.job_count++] = {block, draw, events, s.counter_count, uniform, table.rate * 0x1p-23f};
    const std::uint64_t first = g.counter(draw_of(draw), block, 0);
    for (int c = 0; c < counters; ++c) s.counters[s.counter_count + c] = first + std::uint64_t(c);
    s.counter_count += counters;
    s.dirty[draw] = true;
}

// Thresholds of the 512 cells of a block, x fastest, and their top bytes.
struct DenseThresholds {
    std::array<std::uint32_t, kBlockCells> full;
    std::array<std::uint8_t, kBlockCells> top;
};

inline void make_thresholds(const Segment& g, const BlockPlan& plan, int draw, DenseThresholds& out) {
    const hn::CappedTag<float, 8> d;
    const std::size_t lanes = hn::Lanes(d);
    const float background = g.random.field->background()[std::size_t(draw)];
    HWY_ALIGN std::array<float, 8> p;
    for (std::size_t row = 0; row < 64; ++row) {
        const auto dy = hn::Set(d, float(row & 7)), dz = hn::Set(d, float(row >> 3));
        for (std::size_t x = 0; x < 8; x += lanes) {
            const auto dx = hn::Iota(d, float(x));
            hn::Store(probability_of_cells(d, plan, draw, background, dx, dy, dz), d, p.data() + x);
        }
        for (std::size_t x = 0; x < 8; ++x) out.full[row * 8 + x] = probability_threshold(p[x]);
    }
    for (std::size_t c = 0; c < kBlockCells; ++c) out.top[c] = std::uint8_t(out.full[c] >> 24);
}

// A bit a cell of a block, 64 cells (a layer) a word.
using BlockBits = std::array<std::uint64_t, kBlockCells / 64>;

// Compares the 512 random bytes with `top(cell)`: cells below it, and cells that tie.
template <class Top>
HWY_INLINE void compare_bytes(const std::uint8_t* random, const Top& top, BlockBits& less, BlockBits& tie) {
#if HWY_TARGET == HWY_SCALAR  // one lane does not fill a byte of mask bits
    const hn::ScalableTag<std::uint8_t> d;
    less.fill(0);
    tie.fill(0);
    for (std::size_t c = 0; c < kBlockCells; ++c) {
        const std::uint8_t threshold = hn::GetLane(top(d, c));
        less[c / 64] |= std::uint64_t{random[c] < threshold} << (c % 64);
        tie[c / 64] |= std::uint64_t{random[c] == threshold} << (c % 64);
    }
#else
    const hn::CappedTag<std::uint8_t, 64> d;
    for (std::size_t c = 0; c < kBlockCells; c += hn::Lanes(d)) {
        const auto value = hn::LoadU(d, random + c), threshold = top(d, c);
        hn::StoreMaskBits(d, hn::Lt(value, threshold), reinterpret_cast<std::uint8_t*>(less.data()) + c / 8);
        hn::StoreMaskBits(d, hn::Eq(value, threshold), reinterpret_cast<std::uint8_t*>(tie.data()) + c / 8);
    }
#endif
}

// Decides tied cells by 24 more bits each, in rising order of cells, from counter sub-index 32 on.
template <class Threshold>
HWY_INLINE void resolve_ties(const Segment& g, int block, int draw, const Threshold& threshold, const BlockBits& tie,
                             BlockBits& less) {
    constexpr std::uint32_t kBatch = 16;  // words made at once; two ties are expected
    std::uint64_t counters[kMaxLanes];
    std::uint32_t words[4 * kMaxLanes];
    std::uint32_t used = 0;
    for (std::size_t layer = 0; layer < tie.size(); ++layer) {
        for (std::uint64_t bits = tie[layer]; bits != 0; bits &= bits - 1) {
            if (used % kBatch == 0) {
                for (std::uint32_t c = 0; c < kMaxLanes; ++c) {
                    counters[c] = g.counter(draw_of(draw), block, 32 + used / 4 + c);
                }
                philox_counters(g.batch(), counters, kBatch / 4, words);
            }
            const int cell = std::countr_zero(bits);
            const std::uint32_t t = threshold(layer * 64 + std::size_t(cell));
            const bool event = t == kCertain || (words[used % kBatch] >> 8) < (t & 0xFFFFFFu);
            less[layer] |= std::uint64_t{event} << cell;
            ++used;
        }
    }
}

inline void run_dense(const Segment& g, int block, int draw, const BlockPlan& plan, BirthScratch& s) {
    s.dirty[draw] = true;
    const DrawPlan& draw_plan = plan.draws[std::size_t(draw)];
    HWY_ALIGN BlockBits less, tie;
    if (draw_plan.kind == DrawPlan::Kind::certain) {
        less.fill(~std::uint64_t{0});
    } else {
        HWY_ALIGN std::uint64_t counters[32];
        HWY_ALIGN std::uint32_t random[kBlockCells / 4];
        const std::uint64_t first = g.counter(draw_of(draw), block, 0);
        for (std::uint64_t sub = 0; sub < 32; ++sub) counters[sub] = first + sub;
        philox_counters(g.batch(), counters, 32, random);
        const auto* bytes = reinterpret_cast<const std::uint8_t*>(random);
        if (draw_plan.kind == DrawPlan::Kind::uniform) {
            const std::uint32_t t = probability_threshold(draw_plan.p_max);
            compare_bytes(bytes, [t](auto d, std::size_t) { return hn::Set(d, std::uint8_t(t >> 24)); }, less, tie);
            resolve_ties(g, block, draw, [t](std::size_t) { return t; }, tie, less);
        } else {
            HWY_ALIGN DenseThresholds t;
            make_thresholds(g, plan, draw, t);
            compare_bytes(bytes, [&t](auto d, std::size_t c) { return hn::LoadU(d, t.top.data() + c); }, less, tie);
            resolve_ties(g, block, draw, [&t](std::size_t c) { return t.full[c]; }, tie, less);
        }
    }
    std::uint8_t* out = event_bytes(s, draw, block);
    const auto* rows = reinterpret_cast<const std::uint8_t*>(less.data());
    for (std::size_t row = 0; row < 64; ++row) out[row * kSegmentBlocks] = rows[row];
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
        for (int draw = 0; draw < 3; ++draw) {
            const DrawPlan& draw_plan = plan.draws[std::size_t(draw)];
            if (draw_plan.kind == DrawPlan::Kind::none) continue;
            if (draw == kExt && (s.cloudy[b / 8] >> (b % 8 * 8) & 0xFF) == 0) continue;
            if (is_sparse(draw_plan)) {
                queue_sparse(g, b, draw, draw_plan, s);
            } else {
                run_dense(g, b, draw, plan, s);
            }
        }
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
