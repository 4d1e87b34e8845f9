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

#include "automaton/block_bits-inl.h"
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

// An event that takes place: the cell (9 bits), the draw (2), the block in the segment.
HWY_INLINE std::uint32_t pack_event(int block, int draw, std::uint32_t cell) {
    return cell | std::uint32_t(draw) << 9 | std::uint32_t(block) << 11;
}

// Applies the events that were accepted: each sets hum or act, or clears cld. In a loop of their own, as a few of many are
// accepted and no processor foretells which.
inline void apply_events(const Segment& g, BirthScratch& s) {
    const int last_block = g.blocks - 1;
    const int cells_left = g.planes.extent.x - (g.bx0 + last_block) * kBlockEdge;
    const std::uint32_t last = cells_left >= kBlockEdge ? 0xFFu : (1u << cells_left) - 1;
    for (int n = 0; n < s.accepted_count; ++n) {
        const std::uint32_t event = s.accepted[n];
        const int block = int(event >> 11);
        const std::uint32_t bit = 1u << (event & 7) & (block == last_block ? last : 0xFFu);
        std::uint8_t& byte = s.rows[event >> 9 & 3][event >> 3 & 63][g.bx0 + block];
        byte = std::uint8_t((byte | bit) ^ ((event >> 9 & 3) == kExt ? bit : 0u));
    }
    s.accepted_count = 0;
}

// Decides the events of the lanes in `close`, whose v is too near a threshold for float32, by sparse_draw(). `at` is the
// place of lane 0 in the queue.
template <class DF, class V = hn::Vec<DF>>
HWY_NOINLINE void run_close(DF d, const SparseJob& job, hn::Mask<DF> close, int at, const V& hum,
                            const V& act, const V& ext, BirthScratch& s) {
    HWY_ALIGN float rates[3][hn::MaxLanes(d)];
    hn::Store(hum, d, rates[kHum]);
    hn::Store(act, d, rates[kAct]);
    hn::Store(ext, d, rates[kExt]);
    std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(d, close, bytes);
    for (int lane = 0; lane < int(hn::Lanes(d)); ++lane) {
        if ((bytes[lane / 8] >> (lane % 8) & 1) == 0) continue;
        const std::uint32_t first = s.first[at + lane], second = s.second[at + lane];
        const int draw = sparse_draw(first, second, double(job.rates.unit) * 0x1p31,
                                     {rates[kHum][lane], rates[kAct][lane], rates[kExt][lane]});
        if (draw <= kExt) s.accepted[s.accepted_count++] = pack_event(job.block, draw, first & 511u);
    }
}

#if HWY_TARGET <= HWY_AVX2
// Returns the lanes whose cells, the low 9 bits of `first`, have a bit in `cloud`: looks up the cell's word of 32 cells, in a
// vector of 16 lanes or two of 8, and moves its bit to the sign.
template <class DU, class V = hn::Vec<DU>>
HWY_INLINE hn::Mask<DU> has_cloud(DU du, const CellBits& cloud, V first) {
    const hn::RebindToSigned<DU> di;
    const auto* words = reinterpret_cast<const std::uint32_t*>(&cloud[0]);
    const auto look_up = [&](const std::uint32_t* table, V index) HWY_ATTR {
        return hn::TableLookupLanes(hn::LoadU(du, table), hn::IndicesFromVec(du, index));
    };
    const auto index = hn::ShiftRight<5>(first);
    V word;
    if constexpr (hn::MaxLanes(du) >= 16) {
        word = look_up(words, hn::And(index, hn::Set(du, 15)));
    } else {
        const auto lane = hn::And(index, hn::Set(du, 7));
        const auto upper = hn::TestBit(index, hn::Set(du, 8));
        word = hn::IfThenElse(upper, look_up(words + 8, lane), look_up(words, lane));
    }
    const auto bit = hn::Shl(word, hn::AndNot(first, hn::Set(du, 31)));
    return hn::RebindMask(du, hn::Lt(hn::BitCast(di, bit), hn::Zero(di)));
}
#endif

// Rates of the cells of a vector of events.
template <class V>
struct EventRates {
    V hum, act, ext, two, three;
};

// Evaluates the field at a vector of cells.
template <class DF, class VU, class V = hn::Vec<DF>>
HWY_INLINE EventRates<V> rates_at(DF d, const SparseJob& job, const BlockPlan& plan, VU first) {
    const hn::RebindToUnsigned<DF> du;
    const hn::RebindToSigned<DF> di;
    const auto seven = hn::Set(du, 7);
    const auto to_float = [&](auto v) HWY_ATTR { return hn::ConvertTo(d, hn::BitCast(di, v)); };
    const auto dx = to_float(hn::And(first, seven));
    const auto dy = to_float(hn::And(hn::ShiftRight<3>(first), seven));
    const auto dz = to_float(hn::And(hn::ShiftRight<6>(first), seven));
    const auto of = [&](int draw) HWY_ATTR {
        const float* values = plan.background.values[std::size_t(draw)];
        if (values == nullptr) return hn::Set(d, plan.background.low[std::size_t(draw)]);
        return hn::GatherIndex(d, values, hn::BitCast(di, hn::And(first, hn::Set(du, 511))));
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
    const auto two = hn::Add(hum, act);
    return {hum, act, ext, two, hn::Add(two, ext)};
}

// What the vectors of a job have in common.
template <class DF>
struct JobVectors {
    using V = hn::Vec<DF>;
    using VU = hn::Vec<hn::RebindToUnsigned<DF>>;
    JobVectors(DF d, const SparseJob& job)
        : unit(hn::Set(d, job.rates.unit)),
          slack(hn::Set(d, job.rates.unit * 0x1p10f)),
          of_hum(hn::Set(hn::RebindToUnsigned<DF>(), pack_event(job.block, kHum, 0))),
          of_act(hn::Set(hn::RebindToUnsigned<DF>(), pack_event(job.block, kAct, 0))),
          of_ext(hn::Set(hn::RebindToUnsigned<DF>(), pack_event(job.block, kExt, 0))) {}
    V unit, slack;
    VU of_hum, of_act, of_ext;
};

// Decides the events of a vector from `at` on, of which `left` are those of the job. Makes the choice of sparse_draw() in
// float32, whose v and sums of rates are right to 2^-22 of the level's rate, and leaves events to run_close() whose v lies
// within 2^-21 of a sum: three in a million. Extinctions where there is no cloud are left out, as nothing would happen; `cloud`
// is null where none can be. Rates stay where they are: a copy in parts would be read in whole before it has reached the cache.
template <class DF>
HWY_INLINE void decide_events(DF d, const SparseJob& job, const JobVectors<DF>& common,
                              const EventRates<hn::Vec<DF>>& rates, const CellBits* cloud, int at, int left,
                              BirthScratch& s) {
    const hn::RebindToUnsigned<DF> du;
    const hn::RebindToSigned<DF> di;
    const auto first = hn::LoadU(du, s.first + at);
    const auto v =
        hn::Mul(hn::ConvertTo(d, hn::BitCast(di, hn::ShiftRight<1>(hn::LoadU(du, s.second + at)))), common.unit);
    const auto distance = hn::Min(hn::AbsDiff(v, rates.hum),
                                  hn::Min(hn::AbsDiff(v, rates.two), hn::AbsDiff(v, rates.three)));
    const auto used = hn::FirstN(d, std::size_t(left));
    const auto up_to_act = hn::Lt(v, rates.two);
    auto accepted = hn::And(used, hn::Lt(v, rates.three));
#if HWY_TARGET <= HWY_AVX2
    if (cloud != nullptr)
        accepted = hn::And(accepted, hn::Or(up_to_act, hn::RebindMask(d, has_cloud(du, *cloud, first))));
#else
    (void)cloud;
#endif
    const auto close = hn::And(used, hn::Lt(distance, common.slack));
    if (HWY_UNLIKELY(!hn::AllFalse(d, close))) {
        run_close(d, job, close, at, rates.hum, rates.act, rates.ext, s);
        accepted = hn::AndNot(close, accepted);
    }
    const auto accepted_u = hn::RebindMask(du, accepted);
    const auto of_draw = hn::IfThenElse(hn::RebindMask(du, hn::Lt(v, rates.hum)), common.of_hum,
                                        hn::IfThenElse(hn::RebindMask(du, up_to_act), common.of_act, common.of_ext));
    const auto event = hn::Or(hn::And(first, hn::Set(du, 511)), of_draw);
    hn::StoreU(compress(du, event, accepted_u), du, s.accepted + s.accepted_count);
    s.accepted_count += int(hn::CountTrue(du, accepted_u));
}

// Runs one sparse job whose words are ready. Where p varies, its last events take half a vector if that holds them: most jobs
// have no more, and processors that halve the widest vectors are done earlier.
template <bool kUniform>
HWY_INLINE void run_sparse([[maybe_unused]] const Segment& g, const SparseJob& job, BirthScratch& s) {
    const hn::ScalableTag<float> d;
    const BlockPlan& plan = s.plans[std::size_t(job.block)];
    const CellBits* cloud = nullptr;
#if HWY_TARGET <= HWY_AVX2
    if ((job.draws & 1u << kExt) != 0) cloud = &cloud_of_block(g, job.block, s);
#endif
    const int lanes = int(hn::Lanes(d)), at = 2 * job.first;
    const JobVectors<hn::ScalableTag<float>> common(d, job);
    if constexpr (kUniform) {
        const EventRates<hn::Vec<hn::ScalableTag<float>>> rates{hn::Set(d, job.rates.hum), hn::Set(d, job.rates.act),
                                                                hn::Set(d, job.rates.ext), hn::Set(d, job.rates.two),
                                                                hn::Set(d, job.rates.three)};
        for (int e = 0; e < job.events; e += lanes)
            decide_events(d, job, common, rates, cloud, at + e, job.events - e, s);
        return;
    }
    const auto decide = [&](auto tag, const auto& vectors, int e) HWY_ATTR {
        const hn::RebindToUnsigned<decltype(tag)> du;
        const auto rates = rates_at(tag, job, plan, hn::LoadU(du, s.first + at + e));
        decide_events(tag, job, vectors, rates, cloud, at + e, job.events - e, s);
    };
    int e = 0;
#if HWY_TARGET <= HWY_AVX3
    for (; e + lanes / 2 < job.events; e += lanes) decide(d, common, e);
    const hn::Half<hn::ScalableTag<float>> half;
    if (e < job.events) decide(half, JobVectors<hn::Half<hn::ScalableTag<float>>>(half, job), e);
#else
    for (; e < job.events; e += lanes) decide(d, common, e);
#endif
}

// Makes the words of all queued sparse draws and runs them.
inline void run_queue(const Segment& g, BirthScratch& s) {
    philox_events(g.batch(), s.counters, s.counter_count, s.first, s.second);
    for (int j = 0; j < s.job_count; ++j) {
        if (s.jobs[j].uniform) {
            run_sparse<true>(g, s.jobs[j], s);
        } else {
            run_sparse<false>(g, s.jobs[j], s);
        }
    }
    apply_events(g, s);
    s.job_count = 0;
    s.counter_count = 0;
}

// Returns the draws of a block of nothing but a background that is the same in all cells. Most blocks of a step have the
// same, so the last one is kept.
inline const UniformDraws& uniform_draws(const Segment& g, const BlockPlan& plan, unsigned draws,
                                         BirthScratch& s) {
    UniformDraws& known = s.uniform[draws];
    if (known.table != nullptr && known.p == plan.background.low) return known;
    const auto rate = [&](int draw) {
        return (draws >> draw & 1) != 0 ? sparse_rate(plan.background.low[std::size_t(draw)]) : 0.0f;
    };
    known.table = &g.random.ladder->level(sparse_rate_bound(plan, draws));
    known.p = plan.background.low;
    const float hum = rate(kHum), act = rate(kAct), ext = rate(kExt), two = hum + act;
    known.rates = {float(known.table->rate) * 0x1p-31f, hum, act, ext, two, two + ext};
    return known;
}

// Computes the terms of sparse_rate_bound() of all blocks of the segment.
inline void bound_rates(const Segment& g, BirthScratch& s) {
    const hn::CappedTag<float, 16> d;
    for (std::size_t draw = 0; draw < 3; ++draw) {
        float* bounds = s.rate_bounds[draw];
        for (std::size_t b = 0; b < std::size_t(g.blocks); ++b) bounds[b] = s.plans[b].draws[draw].p_max;
        for (std::size_t b = 0; b < std::size_t(g.blocks); b += hn::Lanes(d)) {
            const auto p = hn::Min(hn::LoadU(d, bounds + b), hn::Set(d, kVaryingSparseLimit));
            hn::StoreU(hn::Mul(rate_of(d, p), hn::Set(d, 1.00001f)), d, bounds + b);
        }
    }
}

// Queues the sparse draws of a block with their counters.
inline void queue_sparse(const Segment& g, int block, unsigned draws, BirthScratch& s) {
    const BlockPlan& plan = s.plans[std::size_t(block)];
    const auto& values = plan.background.values;
    const bool uniform = plan.ellipsoids.empty() && values[kHum] == nullptr && values[kAct] == nullptr &&
                         values[kExt] == nullptr;
    const UniformDraws* known = nullptr;
    const PoissonTable* table = nullptr;
    if (uniform) {
        known = &uniform_draws(g, plan, draws, s);
        table = known->table;
    } else {
        // Sums as in sparse_rate_bound(): adding 0 changes nothing.
        float bound = 0;
        for (std::size_t draw = 0; draw < 3; ++draw)
            bound += (draws >> draw & 1) != 0 ? s.rate_bounds[draw][block] : 0.0f;
        table = &g.random.ladder->level(bound);
    }
    const int events = table->events(s.counts[4 * block]);
    if (events == 0) return;
    const int counters = (events + 1) / 2;
    if (s.counter_count + counters > kMaxCounters) run_queue(g, s);
    // Written where it stays: a copy of what has just been set, by wider loads, would wait for it to reach the cache.
    SparseJob& job = s.jobs[s.job_count++];
    job.block = block;
    job.draws = draws;
    job.events = events;
    job.first = s.counter_count;
    job.uniform = uniform;
    if (uniform) {
        job.rates = known->rates;
    } else {
        job.rates.unit = float(table->rate) * 0x1p-31f;
    }
    // Whole vectors, as the array has room: most blocks have no more counters than one.
    const hn::ScalableTag<std::uint64_t> d;
    const std::uint64_t first = g.counter(Draw::sparse, block, 0);
    std::uint64_t* const to = s.counters + s.counter_count;
    auto next = rising_from(d, first);
    for (int c = 0; c < counters; c += int(hn::Lanes(d))) {
        hn::StoreU(next, d, to + c);
        next = hn::Add(next, hn::Set(d, std::uint64_t(hn::Lanes(d))));
    }
    s.counter_count += counters;
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
