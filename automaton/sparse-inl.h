// SPDX-License-Identifier: Apache-2.0

// The sparse draws (docs/adr/0002): Poisson events on random cells. Births of hum and act are one process on all cells of a
// block; each event's second word decides by the rates of its cell which of them it is, or none. Extinctions are a process of
// their own, on the cells that are cld or, in thick cloud, on all. The work is proportional to the events, and the ellipsoids are evaluated only
// there.

#if defined(NEPHOS_SPARSE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_SPARSE_INL_H_
#undef NEPHOS_SPARSE_INL_H_
#else
#define NEPHOS_SPARSE_INL_H_
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
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

// Decides the events of the lanes in `close`, whose v is too near a threshold for float32, by sparse_birth(). `at` is the
// place of lane 0 in the queue.
template <class DF, class V = hn::Vec<DF>>
HWY_NOINLINE void run_close(DF d, const SparseJob& job, hn::Mask<DF> close, int at, const V& hum, const V& act,
                            BirthScratch& s) {
    HWY_ALIGN float rates[2][hn::MaxLanes(d)];
    hn::Store(hum, d, rates[kHum]);
    hn::Store(act, d, rates[kAct]);
    std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(d, close, bytes);
    for (int lane = 0; lane < int(hn::Lanes(d)); ++lane) {
        if ((bytes[lane / 8] >> (lane % 8) & 1) == 0) continue;
        const std::uint32_t first = s.first[at + lane], second = s.second[at + lane];
        const int draw = sparse_birth(first, second, double(job.rates.unit) * 0x1p31,
                                      {rates[kHum][lane], rates[kAct][lane]});
        if (draw <= kAct) s.accepted[s.accepted_count++] = pack_event(job.block, draw, first & 511u);
    }
}

// Rates of the cells of a vector of events.
template <class V>
struct EventRates {
    V hum, act, both, ext;
};

// Evaluates the field at a vector of cells.
template <class DF, class VU, class V = hn::Vec<DF>>
HWY_INLINE EventRates<V> rates_at(DF d, const SparseJob& job, const BlockPlan& plan, VU cells) {
    const hn::RebindToUnsigned<DF> du;
    const hn::RebindToSigned<DF> di;
    const auto seven = hn::Set(du, 7);
    const auto to_float = [&](auto v) HWY_ATTR { return hn::ConvertTo(d, hn::BitCast(di, v)); };
    const auto dx = to_float(hn::And(cells, seven));
    const auto dy = to_float(hn::And(hn::ShiftRight<3>(cells), seven));
    const auto dz = to_float(hn::And(hn::ShiftRight<6>(cells), seven));
    const auto of = [&](int draw) HWY_ATTR {
        const float* values = plan.background.values[std::size_t(draw)];
        if (values == nullptr) return hn::Set(d, plan.background.low[std::size_t(draw)]);
        return hn::GatherIndex(d, values, hn::BitCast(di, cells));
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
    return {hum, act, hn::Add(hum, act), ext};
}

// Returns the cells of a job's events from the e-th on.
template <class DU, class V = hn::Vec<DU>>
HWY_INLINE V cells_of(DU du, const SparseJob& job, int e, const BirthScratch& s) {
    const int at = 2 * job.first + e;
    const auto births = hn::FirstN(du, std::size_t(std::max(2 * job.birth_counters - e, 0)));
    return hn::IfThenElse(births, hn::And(hn::LoadU(du, s.first + at), hn::Set(du, 511)), hn::LoadU(du, s.cells + at));
}

// What the vectors of a job have in common.
template <class DF>
struct JobVectors {
    using V = hn::Vec<DF>;
    using VU = hn::Vec<hn::RebindToUnsigned<DF>>;
    JobVectors(DF d, const SparseJob& job)
        : unit(hn::Set(d, job.rates.unit)),
          ext_unit(hn::Set(d, job.rates.ext_unit)),
          left_unit(hn::Set(d, job.rates.ext_unit * 0x1p-31f)),
          slack(hn::Set(d, job.rates.unit * 0x1p10f)),
          of_hum(hn::Set(hn::RebindToUnsigned<DF>(), pack_event(job.block, kHum, 0))),
          of_act(hn::Set(hn::RebindToUnsigned<DF>(), pack_event(job.block, kAct, 0))),
          of_ext(hn::Set(hn::RebindToUnsigned<DF>(), pack_event(job.block, kExt, 0))) {}
    V unit, ext_unit, left_unit, slack;
    VU of_hum, of_act, of_ext;
};

// Decides the events of a job from its e-th on, a vector. Births: makes the choice of sparse_birth() in float32, whose v and sums
// of rates are right to 2^-22 of the level's rate, and leaves events to run_close() whose v lies within 2^-21 of a sum: two in a
// million. Extinctions: sparse_extinction(). Rates stay where they are: a copy in parts would be read in whole before it has
// reached the cache.
template <class DF>
HWY_INLINE void decide_events(DF d, const SparseJob& job, const JobVectors<DF>& common,
                              hn::Vec<hn::RebindToUnsigned<DF>> cells, const EventRates<hn::Vec<DF>>& rates, int e,
                              BirthScratch& s) {
    const hn::RebindToUnsigned<DF> du;
    const hn::RebindToSigned<DF> di;
    const int at = 2 * job.first + e, extinctions_from = 2 * job.birth_counters - e;
    const auto first_of = [&](int count) HWY_ATTR { return hn::FirstN(d, std::size_t(std::max(count, 0))); };
    const auto births = first_of(job.births - e), no_extinctions = first_of(extinctions_from);
    const auto extinctions = hn::AndNot(no_extinctions, first_of(extinctions_from + job.extinctions));
    const auto half = [&](const std::uint32_t* words) HWY_ATTR {
        return hn::ConvertTo(d, hn::BitCast(di, hn::ShiftRight<1>(hn::LoadU(du, words + at))));
    };
    const auto v = hn::Add(hn::Mul(half(s.second), hn::IfThenElse(extinctions, common.ext_unit, common.unit)),
                           hn::IfThenElseZero(extinctions, hn::Mul(half(s.left), common.left_unit)));
    const auto distance = hn::Min(hn::AbsDiff(v, rates.hum), hn::AbsDiff(v, rates.both));
    auto accepted = hn::Or(hn::And(births, hn::Lt(v, rates.both)), hn::And(extinctions, hn::Lt(v, rates.ext)));
    const auto close = hn::And(births, hn::Lt(distance, common.slack));
    if (HWY_UNLIKELY(!hn::AllFalse(d, close))) {
        run_close(d, job, close, at, rates.hum, rates.act, s);
        accepted = hn::AndNot(close, accepted);
    }
    const auto accepted_u = hn::RebindMask(du, accepted);
    const auto of_birth = hn::IfThenElse(hn::RebindMask(du, hn::Lt(v, rates.hum)), common.of_hum, common.of_act);
    const auto of_draw = hn::IfThenElse(hn::RebindMask(du, extinctions), common.of_ext, of_birth);
    const auto event = hn::Or(cells, of_draw);
    hn::StoreU(compress(du, event, accepted_u), du, s.accepted + s.accepted_count);
    s.accepted_count += int(hn::CountTrue(du, accepted_u));
}

// Chooses the cells of a job's extinctions by their first words. In thin cloud it is that of rank floor(first n / 2^32) of the n
// cells that are cld, and first n modulo 2^32 is left; in thick cloud any, by the lowest 9 bits, and the others are left. Writes
// up to a vector beyond: jobs come in the order of the queue.
HWY_INLINE void choose_cells(const SparseJob& job, BirthScratch& s) {
    if (job.extinctions == 0) return;
    const int begin = 2 * (job.first + job.birth_counters), end = begin + job.extinctions;
    const auto count = std::uint32_t(s.cloud_cells[job.block]);
    if (count >= kThickCloud) {
        const hn::ScalableTag<std::uint32_t> du;
        const auto of_cell = hn::Set(du, 511);
        for (int at = begin; at < end; at += int(hn::Lanes(du))) {
            const auto first = hn::LoadU(du, s.first + at);
            hn::StoreU(hn::And(first, of_cell), du, s.cells + at);
            hn::StoreU(hn::AndNot(of_cell, first), du, s.left + at);
        }
        return;
    }
    const CellBits& cloud = s.cloud[job.block];
    int below[8] = {};  // set bits in the words before
    for (int word = 0; word < 7; ++word) below[word + 1] = below[word] + std::popcount(cloud[word]);
    for (int at = begin; at < end; ++at) {
        const std::uint64_t product = std::uint64_t{s.first[at]} * count;
        s.cells[at] = set_bit(cloud, below, int(product >> 32));
        s.left[at] = std::uint32_t(product);
    }
}

// Runs one sparse job whose words and cells are ready. Where p varies, its last events take half a vector if that holds them:
// most jobs have no more, and processors that halve the widest vectors are done earlier.
template <bool kUniform>
HWY_INLINE void run_sparse(const SparseJob& job, BirthScratch& s) {
    const hn::ScalableTag<float> d;
    const BlockPlan& plan = s.plans[std::size_t(job.block)];
    const int lanes = int(hn::Lanes(d));
    const int events = job.extinctions == 0 ? job.births : 2 * job.birth_counters + job.extinctions;
    const JobVectors<hn::ScalableTag<float>> common(d, job);
    if constexpr (kUniform) {
        const EventRates<hn::Vec<hn::ScalableTag<float>>> rates{hn::Set(d, job.rates.hum), hn::Set(d, job.rates.act),
                                                                hn::Set(d, job.rates.both), hn::Set(d, job.rates.ext)};
        const hn::ScalableTag<std::uint32_t> du;
        for (int e = 0; e < events; e += lanes) decide_events(d, job, common, cells_of(du, job, e, s), rates, e, s);
        return;
    }
    const auto decide = [&](auto tag, const auto& vectors, int e) HWY_ATTR {
        const hn::RebindToUnsigned<decltype(tag)> du;
        const auto cells = cells_of(du, job, e, s);
        decide_events(tag, job, vectors, cells, rates_at(tag, job, plan, cells), e, s);
    };
    int e = 0;
#if HWY_TARGET <= HWY_AVX3
    for (; e + lanes / 2 < events; e += lanes) decide(d, common, e);
    const hn::Half<hn::ScalableTag<float>> half;
    if (e < events) decide(half, JobVectors<hn::Half<hn::ScalableTag<float>>>(half, job), e);
#else
    for (; e < events; e += lanes) decide(d, common, e);
#endif
}

// Makes the words of all queued sparse draws and runs them.
inline void run_queue(const Segment& g, BirthScratch& s) {
    philox_events(g.batch(), s.counters, s.counter_count, s.first, s.second);
    // Cells are chosen well before they are read: a vector of what has just been stored in parts waits for the cache.
    for (int n = 0; n < s.job_count; ++n) choose_cells(s.jobs[n], s);
    for (int n = 0; n < s.job_count; ++n) {
        if (s.jobs[n].uniform) {
            run_sparse<true>(s.jobs[n], s);
        } else {
            run_sparse<false>(s.jobs[n], s);
        }
    }
    apply_events(g, s);
    s.job_count = 0;
    s.counter_count = 0;
}

// Returns the births of a block of nothing but a background that is the same in all cells. Most blocks of a step have the
// same, so the last one is kept.
inline const UniformBirths& uniform_births(const Segment& g, const BlockPlan& plan, unsigned draws, BirthScratch& s) {
    UniformBirths& known = s.uniform[draws];
    const std::array<float, 2> p{plan.background.low[kHum], plan.background.low[kAct]};
    if (known.level >= 0 && known.p == p) return known;
    const auto rate = [&](int draw) { return (draws >> draw & 1) != 0 ? sparse_rate(p[std::size_t(draw)]) : 0.0f; };
    float bound = 0;
    for (int draw : {kHum, kAct})
        bound += (draws >> draw & 1) != 0 ? sparse_rate_bound(plan.draws[std::size_t(draw)]) : 0.0f;
    known.level = g.random.ladder->number_of(bound);
    known.p = p;
    const float hum = rate(kHum), act = rate(kAct);
    known.rates = {g.random.ladder->rate(known.level) * 0x1p-31f, 0, hum, act, hum + act, 0};
    return known;
}

// Computes sparse_rate_bound() of each draw of all blocks of the segment.
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

// Appends counters from `first` on to the queue, which has room for them.
HWY_INLINE void append_counters(std::uint64_t first, int counters, BirthScratch& s) {
    // Whole vectors, as the array has room: most blocks have no more counters than one.
    const hn::ScalableTag<std::uint64_t> d;
    std::uint64_t* const to = s.counters + s.counter_count;
    auto next = rising_from(d, first);
    for (int c = 0; c < counters; c += int(hn::Lanes(d))) {
        hn::StoreU(next, d, to + c);
        next = hn::Add(next, hn::Set(d, std::uint64_t(hn::Lanes(d))));
    }
    s.counter_count += counters;
}

// Queues the sparse draws of a block, a bit each in `draws`, with their counters. With that of extinction its cells of
// cloud are counted.
inline void queue_sparse(const Segment& g, int block, unsigned draws, BirthScratch& s) {
    constexpr unsigned kBirths = 1u << kHum | 1u << kAct;
    const BlockPlan& plan = s.plans[std::size_t(block)];
    const auto& values = plan.background.values;
    const bool uniform = plan.ellipsoids.empty() && values[kHum] == nullptr && values[kAct] == nullptr &&
                         values[kExt] == nullptr;
    const UniformBirths* known = nullptr;
    const PoissonLadder& ladder = *g.random.ladder;
    int births = 0, extinctions = 0;
    float birth_level = 0, extinction_level = 0;
    const int cloud = s.cloud_cells[block];
    if ((draws & kBirths) != 0) {
        if (uniform) {
            known = &uniform_births(g, plan, draws & kBirths, s);
            births = ladder.events(known->level, s.counts[4 * block]);
        } else {
            float bound = 0;
            for (std::size_t draw : {kHum, kAct}) bound += (draws >> draw & 1) != 0 ? s.rate_bounds[draw][block] : 0.0f;
            const int number = ladder.number_of(bound);
            birth_level = ladder.rate(number);
            births = ladder.events(number, s.counts[4 * block]);
        }
    }
    if ((draws >> kExt & 1) != 0) {
        const int number = ladder.number_of(extinction_rate(s.rate_bounds[kExt][block], cloud));
        extinction_level = ladder.rate(number);
        extinctions = ladder.events(number, s.counts[4 * block + 1]);
    }
    if (births + extinctions == 0) return;
    const int birth_counters = (births + 1) / 2, extinction_counters = (extinctions + 1) / 2;
    assert(birth_counters + extinction_counters <= kMaxCounters);
    if (s.counter_count + birth_counters + extinction_counters > kMaxCounters) run_queue(g, s);
    // Written where it stays: a copy of what has just been set, by wider loads, would wait for it to reach the cache.
    SparseJob& job = s.jobs[s.job_count++];
    job.block = block;
    job.draws = draws;
    job.first = s.counter_count;
    job.birth_counters = birth_counters;
    job.births = births;
    job.extinctions = extinctions;
    job.uniform = uniform;
    // Rates of draws that this job does not make stay those of an earlier one; nothing reads them.
    if (known != nullptr) {
        job.rates = known->rates;
    } else {
        job.rates.unit = birth_level * 0x1p-31f;
    }
    if (extinctions > 0) {
        job.rates.ext_unit = extinction_unit(extinction_level, cloud);
        if (uniform) {
            const float p = plan.background.low[kExt];
            if (p != s.uniform_ext) {
                s.uniform_ext = p;
                s.uniform_ext_rate = sparse_rate(p);
            }
            job.rates.ext = s.uniform_ext_rate;
        }
    }
    append_counters(g.counter(Draw::births, block, 0), birth_counters, s);
    append_counters(g.counter(Draw::extinctions, block, 0), extinction_counters, s);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
