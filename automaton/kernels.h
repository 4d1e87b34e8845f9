// SPDX-License-Identifier: Apache-2.0
#pragma once

// The step of a part of the lattice: growth, then extinction and birth (D), for some rows of blocks of one
// slab of 8 layers. Vectorised with Highway and dispatched at run time; every target gives the same bits.
//
// hum and cld are updated in place, cell by cell; act is read around each cell and therefore written to a
// second plane. Different parts may run in different threads: each writes only its own rows.

#include <algorithm>
#include <array>
#include <cstdint>

#include "automaton/block_field.h"
#include "automaton/lattice.h"
#include "automaton/poisson.h"
#include "core/random.h"

namespace nephos {

// The planes of one step; all have the same extent.
struct StepPlanes {
    Extent extent;
    std::size_t words_per_row = 0;
    Boundaries boundaries;
    const std::uint64_t* act = nullptr;  // at time t
    std::uint64_t* act_next = nullptr;   // at time t + 1; every word of the part is written
    std::uint64_t* hum = nullptr;
    std::uint64_t* cld = nullptr;
    const std::uint64_t* zero_row = nullptr;  // words_per_row zeros with 64 bytes of zeros before and after
};

// Limits of p_max: births below are sparse, others dense. Extinctions below the second are sparse if they also meet the limits
// that follow. Part of the random stream (docs/adr/0002).
inline constexpr float kUniformSparseLimit = 0.125f;  // p is the background's in the whole block
inline constexpr float kVaryingSparseLimit = 0.25f;   // p varies: evaluating it in every cell would cost more
// Limits of p_max n, n being the cells of the block that are cld: sparse extinctions are fewer, in the mean.
inline constexpr float kUniformExtinctions = 16, kVaryingExtinctions = 64;
// Cells of cloud in a block from which on sparse extinctions fall on all its cells, as births do, and those without cloud are
// left as they are; below, they fall on cells of cloud alone, which are found by their rank.
inline constexpr int kThickCloud = 128;

// Returns whether a draw of hum or act is sparse.
inline bool is_sparse(const DrawPlan& plan) {
    if (plan.kind == DrawPlan::Kind::uniform) return plan.p_max < kUniformSparseLimit;
    return plan.kind == DrawPlan::Kind::varying && plan.p_max < kVaryingSparseLimit;
}

// Returns whether the draw of ext is sparse in a block with `cloud` cells of cloud.
inline bool is_sparse_extinction(const DrawPlan& plan, int cloud) {
    if (plan.kind != DrawPlan::Kind::uniform && plan.kind != DrawPlan::Kind::varying) return false;
    const float limit = plan.kind == DrawPlan::Kind::uniform ? kUniformExtinctions : kVaryingExtinctions;
    return plan.p_max < kVaryingSparseLimit && plan.p_max * float(cloud) < limit;
}

// The random numbers and probabilities of one step, or of the first state.
struct StepRandom {
    std::uint64_t seed = 0;
    Domain domain = Domain::lattice;
    std::uint32_t step = 0;
    const BlockField* field = nullptr;
    const PoissonLadder* ladder = nullptr;
};

// Steps the rows of blocks by_begin..by_end (end excluded) of slab bz. Blocks are 8x8x8 cells; the last ones
// may be cut by the extent.
void step_part(const StepPlanes& planes, const StepRandom& random, int bz, int by_begin, int by_end);

// Draws the births of the same part without growth: of an empty lattice its first hum and act, into planes.hum and
// planes.act_next.
void bear_part(const StepPlanes& planes, const StepRandom& random, int bz, int by_begin, int by_end);

// Returns the name of the instruction set in use, for tests and reports.
const char* kernel_target();

// Returns the integer that 32 random bits are compared with for an event of probability p in 0..1;
// `kCertain` means always.
inline constexpr std::uint32_t kCertain = 0xFFFFFFFFu;
inline std::uint32_t probability_threshold(float p) {
    return p >= 1.0f ? kCertain : std::uint32_t(std::int32_t(p * 0x1p31f)) << 1;
}

// Returns -ln(1 - p) in float32 for 0 <= p <= kVaryingSparseLimit, by the series of 2 artanh(p / (2 - p));
// relative error < 1e-6. Same operations in every kernel.
inline float sparse_rate(float p) {
    const float z = p / (2.0f - p);
    const float z2 = z * z;
    return (z + z) * (1.0f + z2 * (1.0f / 3.0f + z2 * (0.2f + z2 * (1.0f / 7.0f))));
}

// Returns an upper bound of the rates of a sparse draw in the cells of a block. Rounding of these may exceed that of the bound
// by a few units in the last place.
inline float sparse_rate_bound(const DrawPlan& plan) {
    return sparse_rate(std::min(plan.p_max, kVaryingSparseLimit)) * 1.00001f;
}

// Selects the draw that a sparse birth belongs to (docs/adr/0002): kHum, kAct, or 2 for a rejected event.
// `first` and `second` are the event's random words, `level` the rate of its block's ladder level,
// `rates` those of its cell (0 for draws that are not sparse). v has 53 bits, so that a draw of 2^-30 of the
// level's rate has a relative precision of 2^-23.
inline int sparse_birth(std::uint32_t first, std::uint32_t second, double level, const std::array<float, 2>& rates) {
    const auto bits = std::int64_t{second >> 1} << 22 | first >> 10;
    const double v = double(bits) * (level * 0x1p-53);
    double sum = 0;
    int draw = 0;
    for (; draw < 2; ++draw) {
        sum += double(rates[std::size_t(draw)]);
        if (v < sum) break;
    }
    return draw;
}

// Returns the rate of the ladder that the sparse extinctions of a block need, from the bound on the rates of its cells.
inline float extinction_rate(float rate_bound, int cloud) {
    return cloud < kThickCloud ? rate_bound * (float(cloud) * 0x1p-9f) : rate_bound;
}

// Returns 2^-31 of the largest v of the extinctions of a block: the events of the level's rate over the cells that they fall on.
inline float extinction_unit(float level, int cloud) {
    return cloud < kThickCloud ? level * 0x1p-22f / float(cloud) : level * 0x1p-31f;
}

// Returns whether a sparse extinction takes place (docs/adr/0002) in a cell of the given rate: its v is below. `unit` is
// extinction_unit(), `left` what the choice of the cell leaves of the event's first word. v has 54 random bits in thick cloud, and
// 56 or more in thin cloud, so that a rate of 2^-30 of its largest value has a relative precision of 2^-24.
inline bool sparse_extinction(std::uint32_t left, std::uint32_t second, float unit, float rate) {
    const float v = float(std::int32_t(second >> 1)) * unit + float(std::int32_t(left >> 1)) * (unit * 0x1p-31f);
    return v < rate;
}

}  // namespace nephos
