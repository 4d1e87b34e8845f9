// SPDX-License-Identifier: Apache-2.0

// The dense draw (docs/adr/0002): compares one random byte a cell with the top byte of its p; ties, 1 in 256,
// compare 24 bits more. A draw is made for all blocks of a segment that it is dense in: Philox runs through a list of quarters of
// blocks (PhiloxJob), 8 sub-indices or 128 cells each, whose words are compared where they lie, in their order
// (BitOrder::words). Quarters that extinction finds no cloud in are left out.

#if defined(NEPHOS_DENSE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_DENSE_INL_H_
#undef NEPHOS_DENSE_INL_H_
#else
#define NEPHOS_DENSE_INL_H_
#endif

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <hwy/highway.h>

#include "automaton/block_bits-inl.h"
#include "automaton/segment-inl.h"
#include "automaton/ties-inl.h"
#include "automaton/undecided-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

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

// Calls store(c, thresholds) with those of the cells c, c + 1, ... of a layer, 32 bits each; leaves vectors out that have no bit
// in `requested`.
template <class Store>
HWY_INLINE void make_thresholds(const BlockPlan& plan, int draw, int layer, std::uint64_t requested,
                                const std::vector<LayerEllipsoid>& ellipsoids, const Store& store) {
    const hn::CappedTag<float, 16> d;
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
        store(c, threshold_of(d, p));
    }
}

// Top bytes of the thresholds of a quarter, in the order of its words: 64 for words 0 and 1, 64 for words 2 and 3.
struct JobThresholds {
    alignas(64) std::array<std::uint64_t, 8> words01{}, words23{};
};

// Computes them for the layers 2 job.quarter and 2 job.quarter + 1 of its block, of which `requested` has the cells that matter.
inline void top_bytes(const BlockPlan& plan, int draw, const PhiloxJob& job, const CellBits& requested,
                      BirthScratch& s, JobThresholds& out) {
    const hn::CappedTag<std::int32_t, 16> di;
    const hn::Rebind<std::uint8_t, decltype(di)> d8;
    alignas(64) std::array<std::uint64_t, 16> rows{};  // of 8 cells each, in the order of the block
    for (int n = 0; n < 2; ++n) {
        const int layer = 2 * job.quarter + n;
        find_in_layer(plan, draw, layer, s);
        auto* const bytes = reinterpret_cast<std::uint8_t*>(rows.data() + 8 * n);
        make_thresholds(plan, draw, layer, requested[layer], s.layer, [&](std::size_t c, auto threshold) HWY_ATTR {
            hn::StoreU(hn::DemoteTo(d8, hn::BitCast(di, hn::ShiftRight<24>(threshold))), d8, bytes + c);
        });
    }
    for (std::size_t i = 0; i < 8; ++i) {
        out.words01[i] = rows[2 * i];
        out.words23[i] = rows[2 * i + 1];
    }
}

// Compares the random bytes of the jobs with top(n, word), 8 bytes for each of 8 rows, into s.events and s.ties.
template <class Top>
HWY_INLINE void compare_jobs(const Segment& g, int draw, std::span<const PhiloxJob> jobs, const Top& top,
                             BirthScratch& s) {
    const hn::CappedTag<std::uint64_t, 8> d;
    philox_jobs(g.batch(), dense_table(g, draw, s), s.philox_blocks, jobs.data(), int(jobs.size()),
                [&](int n, int i, auto words01, auto words23) HWY_ATTR {
                    const PhiloxJob job = jobs[std::size_t(n)];
                    const ByteBits first = compare_bytes(d, words01, top(d, n, 0, i)),
                                   second = compare_bytes(d, words23, top(d, n, 1, i));
                    std::uint64_t* const events = s.events[job.block] + 2 * job.quarter;
                    std::uint64_t* const ties = s.ties[job.block] + 2 * job.quarter;
                    const int shift = 8 * i;
                    events[0] = shift == 0 ? first.less : events[0] | first.less << shift;
                    events[1] = shift == 0 ? second.less : events[1] | second.less << shift;
                    ties[0] = shift == 0 ? first.tie : ties[0] | first.tie << shift;
                    ties[1] = shift == 0 ? second.tie : ties[1] | second.tie << shift;
                });
}

// Compares in the blocks where p is the same in all cells.
inline void compare_uniform(const Segment& g, int draw, int count, BirthScratch& s) {
    if (count == 0) return;
    fill_up(s.uniform_jobs, count);
    compare_jobs(
        g, draw, std::span(s.uniform_jobs).first(std::size_t(count)),
        [&](auto d, int n, int, int) HWY_ATTR { return hn::Set(d, s.tops[s.uniform_jobs[n].block]); }, s);
}

// Compares in the blocks where p varies: a few jobs at a time, whose thresholds are computed first.
inline void compare_varying(const Segment& g, int draw, int count, BirthScratch& s) {
    constexpr int kAtATime = 4;
    alignas(64) CellBits all;
    fill_bits(&all, 1, ~std::uint64_t{0});
    JobThresholds thresholds[kAtATime];
    int located = -1;
    fill_up(s.varying_jobs, count);
    for (int first = 0; first < count; first += kAtATime) {
        const int some = std::min(kAtATime, count - first);
        for (int n = 0; n < some; ++n) {
            const PhiloxJob job = s.varying_jobs[first + n];
            const BlockPlan& plan = s.plans[job.block];
            if (job.block != located) locate_columns(plan, s.columns);
            located = job.block;
            top_bytes(plan, draw, job, draw == kExt ? cloud_of_block(g, job.block, s) : all, s, thresholds[n]);
        }
        for (int n = some; n < kAtATime; ++n) thresholds[n] = thresholds[some - 1];
        compare_jobs(
            g, draw, std::span(s.varying_jobs + first, std::size_t(some)),
            [&](auto d, int n, int word, int i) HWY_ATTR {
                return hn::LoadU(d, (word == 0 ? thresholds[n].words01 : thresholds[n].words23).data() + i);
            },
            s);
    }
}

// Appends the quarters of a block, those with any `cloud` unless that is null.
inline void add_jobs(std::uint8_t block, const CellBits* cloud, PhiloxJob* jobs, int& count) {
    for (int quarter = 0; quarter < 4; ++quarter) {
        jobs[count] = {block, std::uint8_t(quarter)};
        count += int{cloud == nullptr || ((*cloud)[2 * quarter] | (*cloud)[2 * quarter + 1]) != 0};
    }
}

// Makes a draw in the blocks in `blocks`, dense in each, and applies it.
inline void run_dense(const Segment& g, int draw, std::span<const std::uint8_t> blocks, BirthScratch& s) {
    if (blocks.empty()) return;
    fill_bits(s.events, kSegmentBlocks, 0);
    int uniform = 0, varying = 0, undecided = 0;
    for (const std::uint8_t block : blocks) {
        fill_bits(s.ties + block, 1, 0);
        const BlockPlan& plan = s.plans[block];
        const DrawPlan& draw_plan = plan.draws[std::size_t(draw)];
        if (draw_plan.kind == DrawPlan::Kind::certain) {
            fill_bits(s.events + block, 1, ~std::uint64_t{0});
            continue;
        }
        if ((s.known_philox >> block & 1) == 0) s.philox_blocks[block] = PhiloxBlock(g.batch(), g.block_word(block));
        s.known_philox |= std::uint64_t{1} << block;
        const CellBits* const cloud = draw == kExt ? &cloud_of_block(g, block, s) : nullptr;
        constexpr std::uint64_t kEachByte = 0x0101010101010101u;
        if (draw_plan.kind == DrawPlan::Kind::uniform) {
            const std::uint32_t threshold = probability_threshold(draw_plan.p_max);
            s.tops[block] = (threshold >> 24) * kEachByte;
            s.tie_thresholds[block] = tie_threshold(threshold);
            add_jobs(block, cloud, s.uniform_jobs, uniform);
            continue;
        }
        const TopBounds bounds = top_bounds(plan, draw);
        if (few_undecided(cloud == nullptr ? kBlockCells : s.cloud_cells[block], bounds)) {
            s.tops[block] = bounds.low * kEachByte;
            s.high_tops[block] = bounds.high * kEachByte;
            add_jobs(block, cloud, s.undecided_jobs, undecided);
        } else {
            add_jobs(block, cloud, s.varying_jobs, varying);
        }
    }
    compare_uniform(g, draw, uniform, s);
    compare_varying(g, draw, varying, s);
    run_undecided(g, draw, undecided, s);
    run_ties(g, draw, blocks, s);
    apply_bits(g, draw, s.events);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
