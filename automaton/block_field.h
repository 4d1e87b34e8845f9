// SPDX-License-Identifier: Apache-2.0
#pragma once

// The probability field of one step in the form that the kernels read: ellipsoids as matrices in cells,
// listed by slab of 8 layers, with bounds on the blocks of 8x8x8 cells that they touch and on p there.
//
// Values at a cell are float32, in this order of operations (IEEE, no FMA), for every kernel and for the
// naive twin:
//
//     dx, dy, dz  = cell - corner of its block (0..7)          base = M * (corner + 0.5 - centre), made in
//     double a = base_a + (dx * xx + dy * xy)     b = base_b + (dx * yx + dy * yy)     c = base_c + dz * zz
//     u2 = (a*a + b*b) + c*c               s = max(0, 1 - u2)                    p = rim + span * (s*s)

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "automaton/automaton.h"
#include "automaton/background.h"
#include "automaton/options.h"
#include "automaton/poisson.h"

namespace nephos {

// Index into per-draw arrays.
enum : int { kHum = 0, kAct = 1, kExt = 2 };

// One ellipsoid, in cells. The matrix M rotates and scales an offset so that the rim is at length 1.
struct FieldEllipsoid {
    double centre_x, centre_y, centre_z;
    double xx, xy, yx, yy, zz;
    float block_reach;                 // length of M * (half diagonal of a block's cell centres), rounded up
    std::array<float, 3> rim, span;    // p at the rim and centre minus rim, fade weight applied
    int bx0, bx1, by0, by1, bz0, bz1;  // half-open ranges of the blocks that it can touch
};

// One ellipsoid relative to one block: the terms that are evaluated per cell.
struct BlockEllipsoid {
    float base_a, base_b, base_c;
    float xx, xy, yx, yy, zz;
    const FieldEllipsoid* source;
};

// The kind of one draw of a block, which selects its method, with a bound on p.
struct DrawPlan {
    enum class Kind : std::uint8_t {
        none,     // p = 0 everywhere
        certain,  // p = 1 everywhere
        uniform,  // p = background everywhere, and it is the same in all cells
        varying,  // p from the ellipsoids and the background, at most p_max
    };
    Kind kind = Kind::none;
    float p_max = 0;
};

// An ellipsoid in 16 neighbouring blocks along x: a lane each.
struct EllipsoidInRow {
    static constexpr int kBlocks = 16;
    float base_a[kBlocks], base_b[kBlocks];  // of block_field.h
    float bound[3][kBlocks];                 // on p of each draw inside the ellipsoid, 0..1
    std::uint32_t touched = 0;               // blocks that are not outside, a bit each
    std::uint32_t covered = 0;               // blocks that lie inside altogether
};

// Computes it for the blocks bx, bx + 1, ...; `seen` has the row's terms. Vectorised (kernels.h): every instruction set gives
// the same bits.
void find_in_row(const FieldEllipsoid& e, const BlockEllipsoid& seen, double dy, int bx, EllipsoidInRow& out);

struct BlockPlan {
    std::array<DrawPlan, 3> draws;
    BlockBackground background;
    std::vector<BlockEllipsoid> ellipsoids;  // those that touch the block; capacity is reused
};

// Immutable after construction, hence thread-safe.
class BlockField {
  public:
    // `background` is that of the step; it must stay as it is for as long as this object lives.
    BlockField(const AutomatonOptions& options, std::span<const ActiveEllipsoid> ellipsoids,
               const Background& background);

    // Returns false when no cell of the lattice can change by chance.
    bool anything() const { return anything_; }
    bool any_extinction() const { return any_extinction_; }
    // Writes the ellipsoids that can touch blocks of row (by, bz) to `out`.
    void collect(int by, int bz, std::vector<const FieldEllipsoid*>& out) const;
    // Fills the plans of blocks bx0, bx0 + 1, ... from the ellipsoids collected for their row of blocks.
    void plan_blocks(int bx0, int by, int bz, std::span<const FieldEllipsoid* const> row,
                     std::span<BlockPlan> plans) const;

  private:
    void add_with_images(const AutomatonOptions& options, const ActiveEllipsoid& active);

    const Background* background_;
    BlockBackground uniform_;  // where the background does not vary, with its plan
    std::array<DrawPlan, 3> uniform_plan_;
    bool anything_ = false, any_extinction_ = false;
    std::vector<FieldEllipsoid> ellipsoids_;
    std::vector<std::vector<std::uint32_t>> by_slab_;  // indices into ellipsoids_, rising
};

// Returns p of one draw at offset (dx, dy, dz) cells inside the block, from one ellipsoid, by the formula
// above; -1 outside the ellipsoid.
inline float ellipsoid_probability(const BlockEllipsoid& e, int draw, float dx, float dy, float dz) {
    const float a = e.base_a + (dx * e.xx + dy * e.xy);
    const float b = e.base_b + (dx * e.yx + dy * e.yy);
    const float c = e.base_c + dz * e.zz;
    const float u2 = (a * a + b * b) + c * c;
    const float s = 1.0f - u2 > 0.0f ? 1.0f - u2 : 0.0f;
    return u2 < 1.0f ? e.source->rim[std::size_t(draw)] + e.source->span[std::size_t(draw)] * (s * s) : -1.0f;
}

// Combines all ellipsoids of the block and the background: the largest hum and act, the smallest ext.
float probability_at(const BlockPlan& plan, int draw, int dx, int dy, int dz);

}  // namespace nephos
