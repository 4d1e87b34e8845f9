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
#include <vector>

#include "automaton/kernels.h"
#include "automaton/philox-inl.h"
#include "automaton/random.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

inline constexpr std::size_t kMaxLanes = 8;  // of 64 bits, in the widest vector

// One sparse draw of one block.
struct SparseJob {
    int bx;
    int draw;           // kHum, kAct, kExt
    int events;
    std::size_t first;  // its first word
    bool accept_all;    // p is the level itself in every cell
    float rate_unit;    // rate of the level * 2^-23
};

// Memory that a thread reuses from one row of blocks to the next.
struct BirthScratch {
    std::vector<const FieldEllipsoid*> row;
    std::vector<BlockPlan> plans;
    std::vector<std::uint64_t> word0, word2;  // counters
    std::vector<std::uint32_t> counts, words;
    std::vector<std::uint64_t> cloudy;        // a byte a block: not 0 when the block holds any cld
    std::vector<SparseJob> jobs;
};

// A row of blocks: where its 64 rows of cells lie, and its planes.
struct BlockRow {
    const StepPlanes& planes;
    const StepRandom& random;
    const PhiloxKeys& keys;
    int by, bz;
    std::array<std::ptrdiff_t, 64> row_word;  // first word of cell row y + 8 z, -1 outside the lattice
    std::array<std::uint64_t*, 3> target;     // plane that a draw changes
};

inline std::uint32_t draw_word(int draw) { return std::uint32_t(draw) + std::uint32_t(Draw::hum); }

// Changes one cell of block bx.
HWY_INLINE void apply_event(const BlockRow& r, int bx, int draw, std::uint32_t cell) {
    const std::ptrdiff_t at = r.row_word[cell >> 3];
    const int x = bx * kBlockEdge + int(cell & 7);
    if (at < 0 || x >= r.planes.extent.x) return;
    std::uint64_t& word = r.target[std::size_t(draw)][at + x / 64];
    const std::uint64_t bit = std::uint64_t{1} << (x % 64);
    word = draw == kExt ? word & ~bit : word | bit;
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
inline void run_sparse(const BlockRow& r, const SparseJob& job, const BlockPlan& plan, const std::uint32_t* words) {
    if (job.accept_all) {
        for (int e = 0; e < job.events; ++e) apply_event(r, job.bx, job.draw, words[e] & 511u);
        return;
    }
    const hn::ScalableTag<float> d;
    const hn::RebindToUnsigned<decltype(d)> du;
    const hn::RebindToSigned<decltype(d)> di;
    const std::size_t lanes = hn::Lanes(d);
    const float background = r.random.field->background()[std::size_t(job.draw)];
    const auto seven = hn::Set(du, 7);
    const auto one = hn::Set(d, 1.0f), two = hn::Set(d, 2.0f);
    for (std::size_t e = 0; e < std::size_t(job.events); e += lanes) {
        const auto word = hn::LoadU(du, words + e);
        const auto to_float = [&](auto v) { return hn::ConvertTo(d, hn::BitCast(di, v)); };
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
        std::uint8_t bytes[8] = {};
        hn::StoreMaskBits(d, accepted, bytes);
        std::uint32_t bits = std::uint32_t(bytes[0]) | std::uint32_t(bytes[1]) << 8;
        const std::size_t left = std::size_t(job.events) - e;
        if (left < lanes) bits &= (1u << left) - 1;
        for (; bits != 0; bits &= bits - 1) {
            apply_event(r, job.bx, job.draw, words[e + std::size_t(std::countr_zero(bits))] & 511u);
        }
    }
}

// Thresholds of the 512 cells of a block, x fastest.
inline void dense_thresholds(const BlockRow& r, const BlockPlan& plan, int draw,
                             std::array<std::uint32_t, kBlockCells>& out) {
    const DrawPlan& draw_plan = plan.draws[std::size_t(draw)];
    if (draw_plan.kind != DrawPlan::Kind::varying) {
        out.fill(probability_threshold(draw_plan.p_max));
        return;
    }
    const hn::CappedTag<float, 8> d;
    const std::size_t lanes = hn::Lanes(d);
    const float background = r.random.field->background()[std::size_t(draw)];
    HWY_ALIGN std::array<float, 8> p;
    for (int row = 0; row < 64; ++row) {
        const auto dy = hn::Set(d, float(row & 7)), dz = hn::Set(d, float(row >> 3));
        for (std::size_t x = 0; x < 8; x += lanes) {
            const auto dx = hn::Iota(d, float(x));
            hn::Store(probability_of_cells(d, plan, draw, background, dx, dy, dz), d, p.data() + x);
        }
        for (std::size_t x = 0; x < 8; ++x) out[std::size_t(row) * 8 + x] = probability_threshold(p[x]);
    }
}

// Compares the 512 random bytes with the top bytes; one bit a cell, and the cells where they tie.
inline void compare_bytes(const std::uint8_t* random, const std::uint8_t* top, std::uint8_t* less, std::uint8_t* tie) {
#if HWY_TARGET == HWY_SCALAR  // one lane does not fill a byte of mask bits
    for (std::size_t c = 0; c < kBlockCells; ++c) {
        less[c / 8] = std::uint8_t(less[c / 8] | int(random[c] < top[c]) << (c % 8));
        tie[c / 8] = std::uint8_t(tie[c / 8] | int(random[c] == top[c]) << (c % 8));
    }
#else
    const hn::ScalableTag<std::uint8_t> d;
    const std::size_t lanes = hn::Lanes(d);
    for (std::size_t c = 0; c < kBlockCells; c += lanes) {
        const auto value = hn::LoadU(d, random + c), threshold = hn::LoadU(d, top + c);
        hn::StoreMaskBits(d, hn::Lt(value, threshold), less + c / 8);
        hn::StoreMaskBits(d, hn::Eq(value, threshold), tie + c / 8);
    }
#endif
}

// Decides tied cells by 24 more bits each, in rising order of cells, from counter sub-index 32 on.
inline void resolve_ties(const BlockRow& r, int bx, int draw, const std::array<std::uint32_t, kBlockCells>& threshold,
                         const std::uint8_t* tie, std::uint8_t* less) {
    PhiloxWords words{};
    std::uint32_t used = 0;
    for (std::size_t byte = 0; byte < kBlockCells / 8; ++byte) {
        for (std::uint32_t bits = tie[byte]; bits != 0; bits &= bits - 1) {
            const int lane = std::countr_zero(bits);
            if (used % 4 == 0) {
                words = philox(r.random.seed, block_counter(Domain::lattice, Draw(draw_word(draw)), r.random.step, bx,
                                                            r.by, r.bz, 32 + used / 4));
            }
            const std::uint32_t t = threshold[byte * 8 + std::size_t(lane)];
            const bool event = t == kCertain || (words[used % 4] >> 8) < (t & 0xFFFFFFu);
            less[byte] = std::uint8_t(less[byte] | int(event) << lane);
            ++used;
        }
    }
}

// Changes the cells of block bx whose bit in `events` (a byte a row of 8 cells) is set.
inline void apply_block(const BlockRow& r, int bx, int draw, const std::uint8_t* events) {
    const int cells = std::min(kBlockEdge, r.planes.extent.x - bx * kBlockEdge);
    const std::uint64_t inside = (1u << cells) - 1;
    std::uint64_t* plane = r.target[std::size_t(draw)];
    for (std::size_t row = 0; row < 64; ++row) {
        if (r.row_word[row] < 0) continue;
        const std::uint64_t bits = (events[row] & inside) << (bx % 8 * 8);
        std::uint64_t& word = plane[r.row_word[row] + bx / 8];
        word = draw == kExt ? word & ~bits : word | bits;
    }
}

inline void run_dense(const BlockRow& r, int bx, int draw, const BlockPlan& plan) {
    HWY_ALIGN std::array<std::uint8_t, kBlockCells / 8 + 8> less{}, tie{};  // 8 more: StoreMaskBits may write them
    if (plan.draws[std::size_t(draw)].kind == DrawPlan::Kind::certain) {
        less.fill(0xFF);
        return apply_block(r, bx, draw, less.data());
    }
    HWY_ALIGN std::array<std::uint64_t, 32> word0, word2;
    HWY_ALIGN std::array<std::uint32_t, kBlockCells / 4> random;
    for (std::uint32_t sub = 0; sub < 32; ++sub) {
        word0[sub] = counter_word_0(draw_word(draw), sub);
        word2[sub] = std::uint32_t(bx) | std::uint32_t(r.by) << 16;
    }
    const PhiloxBatch batch{r.keys, r.random.step, std::uint32_t(r.bz) | std::uint32_t(Domain::lattice) << 16};
    philox_counters(batch, word0.data(), word2.data(), 32, random.data());

    HWY_ALIGN std::array<std::uint32_t, kBlockCells> threshold;
    HWY_ALIGN std::array<std::uint8_t, kBlockCells> top;
    dense_thresholds(r, plan, draw, threshold);
    for (std::size_t c = 0; c < kBlockCells; ++c) top[c] = std::uint8_t(threshold[c] >> 24);
    compare_bytes(reinterpret_cast<const std::uint8_t*>(random.data()), top.data(), less.data(), tie.data());
    resolve_ties(r, bx, draw, threshold, tie.data(), less.data());
    apply_block(r, bx, draw, less.data());
}

// Which blocks of the row hold any cld: the others need no extinction.
inline void find_cloudy(const BlockRow& r, std::vector<std::uint64_t>& any) {
    const hn::ScalableTag<std::uint64_t> d;
    const std::size_t words = r.planes.words_per_row, lanes = hn::Lanes(d);
    any.assign(words, 0);
    for (std::ptrdiff_t at : r.row_word) {
        if (at < 0) continue;
        std::size_t w = 0;
        for (; w + lanes <= words; w += lanes) {
            hn::StoreU(hn::Or(hn::LoadU(d, any.data() + w), hn::LoadU(d, r.planes.cld + at + w)), d, any.data() + w);
        }
        for (; w < words; ++w) any[w] |= r.planes.cld[std::size_t(at) + w];
    }
}

// The counts of the three draws of every block: counts[4 * bx + draw] are uniform words.
inline void draw_counts(const BlockRow& r, int blocks, BirthScratch& s) {
    const std::size_t padded = std::size_t(blocks) + kMaxLanes;
    s.word0.assign(padded, counter_word_0(std::uint32_t(Draw::counts), 0));
    s.word2.resize(padded);
    s.counts.resize(4 * padded);
    for (std::size_t bx = 0; bx < padded; ++bx) s.word2[bx] = std::uint32_t(bx) | std::uint32_t(r.by) << 16;
    const PhiloxBatch batch{r.keys, r.random.step, std::uint32_t(r.bz) | std::uint32_t(Domain::lattice) << 16};
    philox_counters(batch, s.word0.data(), s.word2.data(), std::size_t(blocks), s.counts.data());
}

// Queues a sparse draw with its counters, or runs a dense one at once.
inline void start_draw(const BlockRow& r, int bx, int draw, const BlockPlan& plan, BirthScratch& s) {
    const DrawPlan& draw_plan = plan.draws[std::size_t(draw)];
    const bool uniform = draw_plan.kind == DrawPlan::Kind::uniform;
    const float limit = uniform ? kUniformSparseLimit : kVaryingSparseLimit;
    if (draw_plan.kind == DrawPlan::Kind::certain || draw_plan.p_max >= limit) return run_dense(r, bx, draw, plan);

    const SparseTables& tables = *r.random.tables;
    const PoissonTable& table =
        uniform ? tables.background[std::size_t(draw)] : tables.ladder.level(double(draw_plan.p_max));
    const int events = table.events(s.counts[4 * std::size_t(bx) + std::size_t(draw)]);
    if (events == 0) return;
    s.jobs.push_back({bx, draw, events, 4 * s.word0.size(), uniform, table.rate * 0x1p-23f});
    for (std::uint32_t sub = 0; sub * 4 < std::uint32_t(events); ++sub) {
        s.word0.push_back(counter_word_0(draw_word(draw), sub));
        s.word2.push_back(std::uint32_t(bx) | std::uint32_t(r.by) << 16);
    }
}

inline void draw_row(const BlockRow& r, BirthScratch& s) {
    const BlockField& field = *r.random.field;
    const int blocks = (r.planes.extent.x + kBlockEdge - 1) / kBlockEdge;
    field.collect(r.by, r.bz, s.row);
    if (field.any_extinction()) find_cloudy(r, s.cloudy);
    draw_counts(r, blocks, s);

    s.plans.resize(std::size_t(blocks));
    s.jobs.clear();
    s.word0.clear();
    s.word2.clear();
    for (int bx = 0; bx < blocks; ++bx) {
        BlockPlan& plan = s.plans[std::size_t(bx)];
        field.plan_block(bx, r.by, r.bz, s.row, plan);
        for (int draw = 0; draw < 3; ++draw) {
            if (plan.draws[std::size_t(draw)].kind == DrawPlan::Kind::none) continue;
            if (draw == kExt && (s.cloudy[std::size_t(bx) / 8] >> (bx % 8 * 8) & 0xFF) == 0) continue;
            start_draw(r, bx, draw, plan, s);
        }
    }
    const std::size_t counters = s.word0.size();
    s.word0.resize(counters + kMaxLanes);
    s.word2.resize(counters + kMaxLanes);
    s.words.resize(4 * (counters + kMaxLanes) + 16);  // 16 more: the last event vector may read beyond its job
    const PhiloxBatch batch{r.keys, r.random.step, std::uint32_t(r.bz) | std::uint32_t(Domain::lattice) << 16};
    philox_counters(batch, s.word0.data(), s.word2.data(), counters, s.words.data());
    for (const SparseJob& job : s.jobs) run_sparse(r, job, s.plans[std::size_t(job.bx)], s.words.data() + job.first);
}

// Rows of blocks by_begin..by_end of slab bz.
inline void draw_part(const StepPlanes& planes, const StepRandom& random, int bz, int by_begin, int by_end) {
    const PhiloxKeys keys(random.seed);
    BirthScratch scratch;
    for (int by = by_begin; by < by_end; ++by) {
        BlockRow row{planes, random, keys, by, bz, {}, {planes.hum, planes.act_next, planes.cld}};
        for (int i = 0; i < 64; ++i) {
            const int j = by * kBlockEdge + i % 8, k = bz * kBlockEdge + i / 8;
            const bool inside = j < planes.extent.y && k < planes.extent.z;
            row.row_word[std::size_t(i)] =
                inside ? (std::ptrdiff_t(k) * planes.extent.y + j) * std::ptrdiff_t(planes.words_per_row) : -1;
        }
        draw_row(row, scratch);
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
