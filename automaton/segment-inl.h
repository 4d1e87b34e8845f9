// SPDX-License-Identifier: Apache-2.0

// Shared by the sparse and the dense draw: a segment of 64 blocks, its list of events, and the evaluation of
// the probability field on vectors of cells.

#if defined(NEPHOS_SEGMENT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_SEGMENT_INL_H_
#undef NEPHOS_SEGMENT_INL_H_
#else
#define NEPHOS_SEGMENT_INL_H_
#endif

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include <hwy/highway.h>

#include "automaton/kernels.h"
#include "automaton/philox-inl.h"
#include "core/random.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

inline constexpr int kMaxLanes64 = 8;  // of 64 bits, in the widest vector

// Blocks are taken in segments of 64 along x, so that everything below has a fixed size.
inline constexpr int kSegmentBlocks = 64;
inline constexpr int kSegmentWords = kSegmentBlocks * kBlockEdge / 64;
inline constexpr int kMaxJobs = 4 * kSegmentBlocks + 4;  // of a draw; up to 3 more may be written
// Counters that are queued before the sparse draws are run. One block has at most 219 of births and 123 of extinctions: as many
// events as the tables of the highest rates hold.
inline constexpr int kMaxCounters = 512;

// An ellipsoid in one layer of a block, for one draw.
struct LayerEllipsoid {
    const float* columns;  // 64, see locate_columns()
    float c2;              // c * c of block_field.h
    float rim, span;
    bool bounded;  // outside, where its value is the rim, it must be left out
};

// Holds what the sparse events of a block are compared with: births with the rates of hum and of hum + act, extinctions with that
// of ext; 0 for draws that are not made.
struct SparseRates {
    float unit;      // of births: the largest v * 2^-31
    float ext_unit;  // of extinctions
    float hum, act, both, ext;
};

// The sparse births of the blocks without ellipsoids whose background is the same in all cells.
struct UniformBirths {
    int level = -1;            // of the ladder; negative: not known yet
    std::array<float, 2> p{};  // of the background
    SparseRates rates{};       // without those of ext
};

// The sparse draws of one block. Its births stand in the queue from 2 `first` on, its extinctions from 2 (`first` +
// `birth_counters`) on.
struct SparseJob {
    int block;       // in the segment
    unsigned draws;  // a bit each
    int first, birth_counters;  // in the queue; two events a counter
    int births, extinctions;
    bool uniform;  // `rates` are those of all cells; else only the units are known
    SparseRates rates;
};

// A bit for each cell of a block, 64 rows of 8 cells, y fastest: a byte each, in one of two orders.
using CellBits = std::uint64_t[8];

enum class BitOrder {
    layers,  // bit c % 64 of word c / 64 is the cell c = x + 8 y + 64 z
    words,   // that of Philox's words in a dense draw, a byte a cell: byte i of word 2 v + h is decided by the words 2 h and
             // 2 h + 1 of sub-index 8 v + i
};

// Returns the row y + 8 z of a byte of a word.
constexpr int row_of(BitOrder order, int word, int byte) {
    return order == BitOrder::layers ? 8 * word + byte : 16 * (word / 2) + 2 * byte + word % 2;
}

// Memory of one thread.
struct BirthScratch {
    alignas(64) CellBits events[kSegmentBlocks];     // of the dense draw at hand
    alignas(64) CellBits ties[kSegmentBlocks];       // cells whose byte equals the top byte of their threshold
    alignas(64) CellBits cloud[kSegmentBlocks];      // cells that are cld, see cloud_of_block()
    int cloud_cells[kSegmentBlocks];                  // of `cloud`, in blocks that draw extinctions
    alignas(64) CellBits born[kSegmentBlocks];       // cells that are hum, or act, while that is drawn
    std::uint64_t counters[kMaxCounters + kMaxLanes64];  // packed, see philox-inl.h
    // The two words of each event; 16 more, as the last vector of events reads beyond.
    std::uint32_t first[2 * (kMaxCounters + kMaxLanes64) + 16], second[2 * (kMaxCounters + kMaxLanes64) + 16];
    // Cells of extinctions and what is left of their first words, see choose_cells().
    std::uint32_t cells[2 * (kMaxCounters + kMaxLanes64) + 16], left[2 * (kMaxCounters + kMaxLanes64) + 16];
    std::uint32_t accepted[2 * (kMaxCounters + kMaxLanes64) + 16];  // see pack_event()
    int accepted_count = 0;
    std::uint32_t counts[4 * (kSegmentBlocks + kMaxLanes64)];
    std::uint64_t cloudy[kSegmentWords];  // a byte a block: not 0 when it holds any cld
    // Where each plane keeps the 64 rows of cells y + 8 z of the row of blocks: byte bx holds the 8 cells of block bx. Rows
    // beyond the lattice lead to `outside`.
    std::uint8_t* rows[3][64];
    std::vector<std::uint64_t> outside;
    float rate_bounds[3][kSegmentBlocks];                   // of each draw: sparse_rate_bound()
    UniformBirths uniform[4];                               // by the draws, a bit each
    float uniform_ext = 0, uniform_ext_rate = 0;            // the last p_ext that was the same in a block, and its rate
    std::optional<PhiloxTable<32>> dense_tables[3];  // of the random bytes of each draw
    SparseJob jobs[kSegmentBlocks];
    int job_count = 0, counter_count = 0;
    // The dense draw at hand: quarters of blocks where p is the same in all cells; where it varies and is computed in all
    // cells; and where it is computed in the few that its bounds do not decide.
    PhiloxJob uniform_jobs[kMaxJobs], varying_jobs[kMaxJobs], undecided_jobs[kMaxJobs];
    PhiloxBlock philox_blocks[kSegmentBlocks];
    std::uint64_t known_philox = 0;  // blocks, a bit each, that are in philox_blocks
    // Of blocks with one threshold: its top byte in each byte, and what is left for ties.
    std::uint64_t tops[kSegmentBlocks];
    std::uint64_t high_tops[kSegmentBlocks];  // where p varies: `tops` of its lower bound, these of its upper bound
    std::uint32_t tie_thresholds[kSegmentBlocks];
    std::uint8_t dense_blocks[3][kSegmentBlocks];  // of each draw
    unsigned known_cloud = 0;  // words of the segment's rows, a bit each, whose 8 blocks are in `cloud`
    std::vector<float> columns;    // see locate_columns()
    std::vector<LayerEllipsoid> layer;
    std::vector<const FieldEllipsoid*> row;
    std::vector<BlockPlan> plans = std::vector<BlockPlan>(kSegmentBlocks);
};

// A segment of a row of blocks: the offsets of its 64 rows of cells, and its planes.
struct Segment {
    const StepPlanes& planes;
    const StepRandom& random;
    const PhiloxKeys& keys;
    int by, bz;
    int bx0 = 0, blocks = 0;                    // first block and number of blocks, <= 64
    std::array<std::ptrdiff_t, 64> row_word{};  // first word of cell row y + 8 z; -1 outside

    PhiloxBatch batch() const {
        return {keys, random.step, std::uint32_t(bz) | std::uint32_t(random.domain) << 16};
    }
    // Word 2 of the block's counters.
    std::uint32_t block_word(int block) const { return std::uint32_t(bx0 + block) | std::uint32_t(by) << 16; }
    std::uint64_t counter(Draw draw, int block, std::uint32_t sub) const {
        return pack_counter(block_word_0(draw, sub), block_word(block));
    }
};

inline Draw draw_of(int draw) { return Draw(std::uint32_t(draw) + std::uint32_t(Draw::hum)); }

// The place of a vector of cells in one ellipsoid; the operations and their order are those of block_field.h.
template <class V>
struct InEllipsoid {
    V u2;       // squared normalised distance
    V falloff;  // (1 - u^2)^2
};

template <class DF, class V = hn::Vec<DF>>
HWY_INLINE InEllipsoid<V> locate(DF d, const BlockEllipsoid& e, V dx, V dy, V dz) {
    const V a =
        hn::Add(hn::Set(d, e.base_a), hn::Add(hn::Mul(dx, hn::Set(d, e.xx)), hn::Mul(dy, hn::Set(d, e.xy))));
    const V b =
        hn::Add(hn::Set(d, e.base_b), hn::Add(hn::Mul(dx, hn::Set(d, e.yx)), hn::Mul(dy, hn::Set(d, e.yy))));
    const V c = hn::Add(hn::Set(d, e.base_c), hn::Mul(dz, hn::Set(d, e.zz)));
    const V u2 = hn::Add(hn::Add(hn::Mul(a, a), hn::Mul(b, b)), hn::Mul(c, c));
    const V s = hn::Max(hn::Sub(hn::Set(d, 1.0f), u2), hn::Zero(d));
    return {u2, hn::Mul(s, s)};
}

// Takes an ellipsoid into p: the larger hum and act, the smaller ext.
template <class DF, class V = hn::Vec<DF>>
HWY_INLINE V combine(DF d, const BlockEllipsoid& e, std::size_t draw, const InEllipsoid<V>& at, V p) {
    const V value =
        hn::Add(hn::Set(d, e.source->rim[draw]), hn::Mul(hn::Set(d, e.source->span[draw]), at.falloff));
    const V combined = draw == kExt ? hn::Min(p, value) : hn::Max(p, value);
    return hn::IfThenElse(hn::Lt(at.u2, hn::Set(d, 1.0f)), combined, p);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
