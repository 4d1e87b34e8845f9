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

// Applies the events of the segment to the planes and clears them.
inline void merge_events(const Segment& g, BirthScratch& s) {
    const int words = (g.blocks + 7) / 8;
    const int cells_left = g.planes.extent.x - g.bx0 * kBlockEdge;
    const std::uint64_t last =
        cells_left >= words * 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << (cells_left % 64)) - 1;
    std::uint64_t* const planes[3] = {g.planes.hum, g.planes.act_next, g.planes.cld};
    for (int draw = 0; draw < 3; ++draw) {
        if (!s.dirty[draw]) continue;
        s.dirty[draw] = false;
        move_dense_events(draw, s);
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
    s.known_cloud = 0;
    if (field.any_extinction()) find_cloudy(g, s.cloudy);
    std::uint64_t counters[kSegmentBlocks + kMaxLanes64];
    for (int b = 0; b < kSegmentBlocks + kMaxLanes64; ++b) counters[b] = g.counter(Draw::counts, b, 0);
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
    run_ties(g, s);
    merge_events(g, s);
}

// Calls `draw` with every segment of the rows of blocks by_begin..by_end of slab bz.
template <class DrawSegment>
inline void draw_part(const StepPlanes& planes, const StepRandom& random, int bz, int by_begin, int by_end,
                      const DrawSegment& draw) {
    const PhiloxKeys keys(random.seed);
    const auto scratch = std::make_unique<BirthScratch>();
    const int all_blocks = (planes.extent.x + kBlockEdge - 1) / kBlockEdge;
    for (int by = by_begin; by < by_end; ++by) {
        Segment segment{planes, random, keys, by, bz};
        for (int i = 0; i < 64; ++i) {
            const int j = by * kBlockEdge + i % 8, k = bz * kBlockEdge + i / 8;
            const bool inside = j < planes.extent.y && k < planes.extent.z;
            segment.row_word[std::size_t(i)] =
                inside ? (std::ptrdiff_t(k) * planes.extent.y + j) * std::ptrdiff_t(planes.words_per_row)
                       : -1;
        }
        random.field->collect(by, bz, scratch->row);
        for (segment.bx0 = 0; segment.bx0 < all_blocks; segment.bx0 += kSegmentBlocks) {
            segment.blocks = std::min(kSegmentBlocks, all_blocks - segment.bx0);
            draw(segment, *scratch);
        }
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
