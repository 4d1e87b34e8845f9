// SPDX-License-Identifier: Apache-2.0

// The sparse draw (docs/adr/0002): Poisson events on random cells, one process for all sparse draws of a
// block together; each event's second word decides by the rates of its cell which draw it belongs to, or
// none. The work is proportional to the events, and the ellipsoids are evaluated only there.

#if defined(NEPHOS_SPARSE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_SPARSE_INL_H_
#undef NEPHOS_SPARSE_INL_H_
#else
#define NEPHOS_SPARSE_INL_H_
#endif

#include <bit>
#include <cstdint>

#include <hwy/highway.h>

#include "automaton/segment-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

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

// Marks the events of the lanes in `close`, whose v is too near a threshold for float32: sparse_draw()
// decides. `words` are those of lane 0; rates are 0 for draws that the job does not make.
template <class DF, class V = hn::Vec<DF>>
HWY_NOINLINE void run_close(DF d, const SparseJob& job, std::uint32_t close, const std::uint32_t* words,
                            const V& hum, const V& act, const V& ext, BirthScratch& s) {
    HWY_ALIGN float rates[3][hn::MaxLanes(d)];
    hn::Store(hum, d, rates[kHum]);
    hn::Store(act, d, rates[kAct]);
    hn::Store(ext, d, rates[kExt]);
    for (; close != 0; close &= close - 1) {
        const int lane = std::countr_zero(close);
        const std::uint32_t first = words[2 * lane], second = words[2 * lane + 1];
        const int draw = sparse_draw(first, second, double(job.rate_unit) * 0x1p31,
                                     {rates[kHum][lane], rates[kAct][lane], rates[kExt][lane]});
        if (draw <= kExt) mark(event_bytes(s, draw, job.block), first & 511u);
    }
}

// Runs one sparse job whose words are ready. Makes the choice of sparse_draw() in float32, whose v and sums
// of rates are right to 2^-22 of the level's rate, and leaves events to run_close() whose v lies within
// 2^-21 of a sum: three in a million.
inline void run_sparse(const SparseJob& job, BirthScratch& s) {
    const hn::ScalableTag<float> d;
    const hn::RebindToUnsigned<decltype(d)> du;
    const hn::RebindToSigned<decltype(d)> di;
    const int lanes = int(hn::Lanes(d));
    const std::uint32_t* words = s.words + 4 * job.first;
    const BlockPlan& plan = s.plans[std::size_t(job.block)];
    const BlockBackground& background = plan.background;
    const auto seven = hn::Set(du, 7);
    const auto slack = hn::Set(d, job.rate_unit * 0x1p10f);
    const auto to_float = [&](auto v) HWY_ATTR { return hn::ConvertTo(d, hn::BitCast(di, v)); };
    for (int e = 0; e < job.events; e += lanes) {
        hn::Vec<decltype(du)> cell, second;
        hn::LoadInterleaved2(du, words + 2 * e, cell, second);
        const auto dx = to_float(hn::And(cell, seven));
        const auto dy = to_float(hn::And(hn::ShiftRight<3>(cell), seven));
        const auto dz = to_float(hn::And(hn::ShiftRight<6>(cell), seven));
        const auto of = [&](int draw) HWY_ATTR {
            const float* values = background.values[std::size_t(draw)];
            if (values == nullptr) return hn::Set(d, background.low[std::size_t(draw)]);
            return hn::GatherIndex(d, values, hn::BitCast(di, hn::And(cell, hn::Set(du, 511))));
        };
        auto hum = of(kHum), act = of(kAct), ext = of(kExt);
        for (const BlockEllipsoid& ellipsoid : plan.ellipsoids) {
            const auto at = locate(d, ellipsoid, dx, dy, dz);
            hum = combine(d, ellipsoid, kHum, at, hum);
            act = combine(d, ellipsoid, kAct, at, act);
            ext = combine(d, ellipsoid, kExt, at, ext);
        }
        const auto zero = hn::Zero(d);
        hum = (job.draws & 1u << kHum) != 0 ? rate_of(d, hum) : zero;
        act = (job.draws & 1u << kAct) != 0 ? rate_of(d, act) : zero;
        ext = (job.draws & 1u << kExt) != 0 ? rate_of(d, ext) : zero;
        const auto v = hn::Mul(to_float(hn::ShiftRight<1>(second)), hn::Set(d, job.rate_unit));
        const auto two = hn::Add(hum, act), three = hn::Add(two, ext);
        const auto distance =
            hn::Min(hn::AbsDiff(v, hum), hn::Min(hn::AbsDiff(v, two), hn::AbsDiff(v, three)));
        const std::uint32_t used = job.events - e < lanes ? (1u << (job.events - e)) - 1 : 0xFFFFFFFFu;
        const std::uint32_t up_to_hum = bits_of(d, hn::Lt(v, hum)), up_to_act = bits_of(d, hn::Lt(v, two));
        std::uint32_t accepted = bits_of(d, hn::Lt(v, three)) & used;
        const auto close = hn::Lt(distance, slack);
        if (HWY_UNLIKELY(!hn::AllFalse(d, close))) {
            const std::uint32_t lanes_close = bits_of(d, close);
            run_close(d, job, lanes_close & used, words + 2 * e, hum, act, ext, s);
            accepted &= ~lanes_close;
        }
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
    for (int j = 0; j < s.job_count; ++j) run_sparse(s.jobs[j], s);
    s.job_count = 0;
    s.counter_count = 0;
}

// Queues the sparse draws of a block with their counters.
inline void queue_sparse(const Segment& g, int block, unsigned draws, BirthScratch& s) {
    const PoissonTable& table = g.random.ladder->level(sparse_rate_bound(s.plans[std::size_t(block)], draws));
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

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
