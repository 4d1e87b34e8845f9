// SPDX-License-Identifier: Apache-2.0

// Extinction and birth for rows of blocks (D): per cell and draw an event with the field's probability, which
// sets hum or act or clears cld. Two exact methods, chosen per block and draw: sparse-inl.h and dense-inl.h.

#if defined(NEPHOS_BIRTHS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_BIRTHS_INL_H_
#undef NEPHOS_BIRTHS_INL_H_
#else
#define NEPHOS_BIRTHS_INL_H_
#endif

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>

#include <hwy/highway.h>

#include "automaton/block_bits-inl.h"
#include "automaton/dense-inl.h"
#include "automaton/segment-inl.h"
#include "automaton/sparse-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Marks the blocks of the segment that hold any cld: the others need no extinction.
inline void find_cloudy(const Segment& g, std::uint64_t* any) {
    const int words = (g.blocks + 7) / 8;
    const std::uint64_t* cld = g.planes.cld + g.bx0 / 8;
#if HWY_TARGET <= HWY_AVX3
    const hn::CappedTag<std::uint64_t, kSegmentWords> d;
    const auto of_segment = hn::FirstN(d, std::size_t(words));
    auto seen = hn::Zero(d);
    for (std::ptrdiff_t at : g.row_word) {
        if (at >= 0) seen = hn::Or(seen, hn::MaskedLoad(of_segment, d, cld + at));
    }
    hn::StoreU(seen, d, any);
#else
    std::fill_n(any, kSegmentWords, std::uint64_t{0});
    for (std::ptrdiff_t at : g.row_word) {
        if (at < 0) continue;
        if (words == kSegmentWords) {  // a fixed length, so that it becomes a few vectors
            for (int w = 0; w < kSegmentWords; ++w) any[w] |= cld[at + w];
        } else {
            for (int w = 0; w < words; ++w) any[w] |= cld[at + w];
        }
    }
#endif
}

inline void draw_segment(const Segment& g, BirthScratch& s) {
    const BlockField& field = *g.random.field;
    s.known_cloud = 0;
    s.known_philox = 0;
    if (field.any_extinction()) find_cloudy(g, s.cloudy);
    std::uint64_t counters[kSegmentBlocks + kMaxLanes64];
    for (int b = 0; b < kSegmentBlocks + kMaxLanes64; ++b) counters[b] = g.counter(Draw::counts, b, 0);
    philox_counters(g.batch(), counters, g.blocks, s.counts);

    field.plan_blocks(g.bx0, g.by, g.bz, s.row, std::span(s.plans).first(std::size_t(g.blocks)));
    bound_rates(g, s);
    std::size_t dense[3] = {};
    for (int b = 0; b < g.blocks; ++b) {
        const BlockPlan& plan = s.plans[std::size_t(b)];
        unsigned sparse = 0;
        for (int draw : {kHum, kAct}) {
            const DrawPlan& draw_plan = plan.draws[std::size_t(draw)];
            if (draw_plan.kind == DrawPlan::Kind::none) continue;
            if (is_sparse(draw_plan)) {
                sparse |= 1u << draw;
            } else {
                s.dense_blocks[draw][dense[draw]++] = std::uint8_t(b);
            }
        }
        if (plan.draws[kExt].kind != DrawPlan::Kind::none && (s.cloudy[b / 8] >> (b % 8 * 8) & 0xFF) != 0) {
            s.cloud_cells[b] = count_bits(cloud_of_block(g, b, s));
            if (is_sparse_extinction(plan.draws[kExt], s.cloud_cells[b])) {
                sparse |= 1u << kExt;
            } else {
                s.dense_blocks[kExt][dense[kExt]++] = std::uint8_t(b);
            }
        }
        if (sparse != 0) queue_sparse(g, b, sparse, s);
    }
    run_queue(g, s);
    for (int draw = 0; draw < 3; ++draw) run_dense(g, draw, std::span(s.dense_blocks[draw]).first(dense[draw]), s);
}

// Finds the rows of cells of a row of blocks in the planes.
inline void find_rows(const StepPlanes& planes, int by, int bz, Segment& segment, BirthScratch& s) {
    s.outside.resize(planes.words_per_row);
    auto* const outside = reinterpret_cast<std::uint8_t*>(s.outside.data());
    std::uint64_t* const of_draw[3] = {planes.hum, planes.act_next, planes.cld};
    for (std::size_t i = 0; i < 64; ++i) {
        const int j = by * kBlockEdge + int(i % 8), k = bz * kBlockEdge + int(i / 8);
        const bool inside = j < planes.extent.y && k < planes.extent.z;
        const std::ptrdiff_t word =
            inside ? (std::ptrdiff_t(k) * planes.extent.y + j) * std::ptrdiff_t(planes.words_per_row) : -1;
        segment.row_word[i] = word;
        for (int draw = 0; draw < 3; ++draw)
            s.rows[draw][i] = inside ? reinterpret_cast<std::uint8_t*>(of_draw[draw] + word) : outside;
    }
}

// Removes what a part left that ended with an exception in the midst of a segment: other parts would run it.
inline void empty_queues(BirthScratch& s) {
    s.accepted_count = s.job_count = s.counter_count = 0;
}

// Returns the memory of this thread, for any number of parts: a part of a small lattice takes less time than making it.
// Parts that a thread begins while it waits within another part would share it; nothing in a part waits.
inline BirthScratch& scratch_of_thread() {
    static thread_local const std::unique_ptr<BirthScratch> scratch = std::make_unique<BirthScratch>();
    // Tables are those of a ladder, a seed and a slab.
    for (UniformBirths& births : scratch->uniform) births.level = -1;
    for (auto& table : scratch->dense_tables) table.reset();
    empty_queues(*scratch);
    return *scratch;
}

// Calls `draw` with every segment of the rows of blocks by_begin..by_end of slab bz.
template <class DrawSegment>
inline void draw_part(const StepPlanes& planes, const StepRandom& random, int bz, int by_begin, int by_end,
                      const DrawSegment& draw) {
    const PhiloxKeys keys(random.seed);
    BirthScratch& scratch = scratch_of_thread();
    const int all_blocks = (planes.extent.x + kBlockEdge - 1) / kBlockEdge;
    for (int by = by_begin; by < by_end; ++by) {
        Segment segment{planes, random, keys, by, bz};
        find_rows(planes, by, bz, segment, scratch);
        random.field->collect(by, bz, scratch.row);
        for (segment.bx0 = 0; segment.bx0 < all_blocks; segment.bx0 += kSegmentBlocks) {
            segment.blocks = std::min(kSegmentBlocks, all_blocks - segment.bx0);
            draw(segment, scratch);
        }
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
