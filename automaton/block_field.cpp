// SPDX-License-Identifier: Apache-2.0
#include "automaton/block_field.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <tuple>
#include <utility>

#include "automaton/air_parcels.h"

namespace nephos {
namespace {

std::array<double, 3> as_array(const Probabilities& p) { return {p.hum, p.act, p.ext}; }

int blocks(int cells) { return (cells + kBlockEdge - 1) / kBlockEdge; }

// Blocks that cells with centres in [low, high] lie in, clipped to the lattice; half-open.
std::pair<int, int> block_range(double low, double high, int cells) {
    const double first = std::clamp(std::ceil(low - 0.5), 0.0, double(cells));
    const double last = std::clamp(std::floor(high - 0.5) + 1, 0.0, double(cells));
    if (first >= last) return {0, 0};
    return {int(first) / kBlockEdge, blocks(int(last))};
}

// The rows of M (block_field.h).
struct Turned {
    double xx, xy, yx, yy, zz;
};

// Converts an ellipsoid to cells, without its position.
FieldEllipsoid field_ellipsoid(const AutomatonOptions& options, const ActiveEllipsoid& active,
                               const Turned& m) {
    FieldEllipsoid f{.xx = m.xx, .xy = m.xy, .yx = m.yx, .yy = m.yy, .zz = m.zz};
    // The farthest cell centre of a block is 3.5 cells from the block's centre on each axis.
    constexpr double kHalf = 3.5;
    const double reach_a = kHalf * (std::abs(f.xx) + std::abs(f.xy));
    const double reach_b = kHalf * (std::abs(f.yx) + std::abs(f.yy));
    const double reach_c = kHalf * f.zz;
    f.block_reach =
        float(std::sqrt(reach_a * reach_a + reach_b * reach_b + reach_c * reach_c) * (1 + 1e-5) + 1e-6);
    const bool varies = !options.field.profile.empty() || !options.field.grids.empty();
    const auto centre = as_array(active.ellipsoid.centre), rim = as_array(active.ellipsoid.rim),
               background = varies ? std::array<double, 3>{0, 0, 1} : as_array(options.field.background);
    for (std::size_t d = 0; d < 3; ++d) {
        f.rim[d] = float(background[d] + active.weight * (rim[d] - background[d]));
        f.span[d] = float(active.weight * (centre[d] - rim[d]));
    }
    return f;
}

// The plan of a block without ellipsoids.
DrawPlan plan_of_background(const BlockBackground& background, std::size_t draw) {
    const float low = background.low[draw], high = background.high[draw];
    if (!(high > 0)) return {};
    if (low < high) return {DrawPlan::Kind::varying, high};
    return {high < 1 ? DrawPlan::Kind::uniform : DrawPlan::Kind::certain, high};
}

// Takes an ellipsoid with p <= bound into the plan of a draw. The smallest ext wins, from the background down: everywhere only
// if the block lies inside.
void widen(std::size_t d, float bound, bool covered, BlockPlan& plan) {
    DrawPlan& draw = plan.draws[d];
    if (d == kExt) {
        if (draw.kind == DrawPlan::Kind::none) return;
        draw.kind = DrawPlan::Kind::varying;
        if (covered) draw.p_max = std::min(draw.p_max, bound);
        if (draw.p_max <= 0) draw.kind = DrawPlan::Kind::none;
    } else if (bound > draw.p_max) {
        draw = {DrawPlan::Kind::varying, bound};
    } else if (draw.kind != DrawPlan::Kind::none && bound > plan.background.low[d]) {
        draw.kind = DrawPlan::Kind::varying;
    }
}

}  // namespace

BlockField::BlockField(const AutomatonOptions& options, std::span<const ActiveEllipsoid> active,
                       const Background& background)
    : background_(&background) {
    if (!background.varies()) {
        uniform_ = background.of_block(0, 0, 0);
        for (std::size_t d = 0; d < 3; ++d) uniform_plan_[d] = plan_of_background(uniform_, d);
    }
    by_slab_.resize(std::size_t(blocks(options.extent.z)));

    for (const ActiveEllipsoid& e : active) add_with_images(options, e);
    for (std::uint32_t i = 0; i < ellipsoids_.size(); ++i) {
        for (int bz = ellipsoids_[i].bz0; bz < ellipsoids_[i].bz1; ++bz)
            by_slab_[std::size_t(bz)].push_back(i);
    }

    const auto can_be_born = [](const std::array<float, 3>& p) { return p[kHum] > 0 || p[kAct] > 0; };
    bool any_birth = can_be_born(background.high());
    for (const FieldEllipsoid& e : ellipsoids_) {
        const std::array<float, 3> centre{e.rim[0] + e.span[0], e.rim[1] + e.span[1], 0};
        any_birth = any_birth || can_be_born(e.rim) || can_be_born(centre);
    }
    any_extinction_ = background.high()[kExt] > 0;  // ellipsoids can only lower it
    anything_ = any_birth || any_extinction_;
}

// Adds an ellipsoid; on a periodic axis with its centre wrapped into the box and with all periodic images
// that reach the box.
void BlockField::add_with_images(const AutomatonOptions& options, const ActiveEllipsoid& active) {
    const auto place = [](double cells, Boundary boundary, int extent) {
        return boundary == Boundary::periodic ? cells - std::floor(cells / extent) * extent : cells;
    };
    const auto images = [](double half_size_cells, Boundary boundary, int extent) {
        return boundary == Boundary::periodic ? int(std::ceil(half_size_cells / extent)) : 0;
    };
    const Ellipsoid& e = active.ellipsoid;
    const double cell = options.placement.cell_size_m;
    const Vec3& origin = options.placement.origin_m;
    const Extent& extent = options.extent;
    const Boundaries& sides = options.boundaries;
    const double x = place((e.centre_m.x - origin.x) / cell, sides.x, extent.x);
    const double y = place((e.centre_m.y - origin.y) / cell, sides.y, extent.y);
    const double z = place((e.centre_m.z - origin.z) / cell, sides.z, extent.z);
    // Takes semi-axes below 1e-9 cells as 1e-9: both miss all cells off their plane, and no float overflows.
    const auto in_cells = [&](double semi_axis_m) { return std::max(semi_axis_m / cell, 1e-9); };
    const double a = in_cells(e.semi_axes_m.x), b = in_cells(e.semi_axes_m.y), c = in_cells(e.semi_axes_m.z);
    const Rotation turn = sin_cos_deg(e.yaw_deg);
    const Vec3 half = reach_of({a, b, c}, turn);
    const int nx = images(half.x, sides.x, extent.x), ny = images(half.y, sides.y, extent.y),
              nz = images(half.z, sides.z, extent.z);

    FieldEllipsoid f =
        field_ellipsoid(options, active, {turn.cos / a, turn.sin / a, -turn.sin / b, turn.cos / b, 1 / c});
    for (int image_z = -nz; image_z <= nz; ++image_z) {
        f.centre_z = z + double(image_z) * extent.z;
        std::tie(f.bz0, f.bz1) = block_range(f.centre_z - half.z, f.centre_z + half.z, extent.z);
        if (f.bz0 == f.bz1) continue;
        for (int image_y = -ny; image_y <= ny; ++image_y) {
            f.centre_y = y + double(image_y) * extent.y;
            std::tie(f.by0, f.by1) = block_range(f.centre_y - half.y, f.centre_y + half.y, extent.y);
            if (f.by0 == f.by1) continue;
            for (int image_x = -nx; image_x <= nx; ++image_x) {
                f.centre_x = x + double(image_x) * extent.x;
                std::tie(f.bx0, f.bx1) = block_range(f.centre_x - half.x, f.centre_x + half.x, extent.x);
                if (f.bx0 != f.bx1) ellipsoids_.push_back(f);
            }
        }
    }
}

void BlockField::collect(int by, int bz, std::vector<const FieldEllipsoid*>& out) const {
    out.clear();
    for (std::uint32_t i : by_slab_[std::size_t(bz)]) {
        const FieldEllipsoid& e = ellipsoids_[i];
        if (by >= e.by0 && by < e.by1) out.push_back(&e);
    }
}

void BlockField::plan_blocks(int bx0, int by, int bz, std::span<const FieldEllipsoid* const> row,
                             std::span<BlockPlan> plans) const {
    for (std::size_t n = 0; n < plans.size(); ++n) {
        BlockPlan& plan = plans[n];
        plan.ellipsoids.clear();
        plan.background = uniform_;
        plan.draws = uniform_plan_;
        if (!background_->varies()) continue;
        plan.background = background_->of_block(bx0 + int(n), by, bz);
        for (std::size_t d = 0; d < 3; ++d) plan.draws[d] = plan_of_background(plan.background, d);
    }
    const int bx1 = bx0 + int(plans.size());
    for (const FieldEllipsoid* e : row) {
        const double dy = by * kBlockEdge + 0.5 - e->centre_y;
        const double dz = bz * kBlockEdge + 0.5 - e->centre_z;
        BlockEllipsoid seen{.base_c = float(e->zz * dz),
                            .xx = float(e->xx),
                            .xy = float(e->xy),
                            .yx = float(e->yx),
                            .yy = float(e->yy),
                            .zz = float(e->zz),
                            .source = e};
        const int end = std::min(bx1, e->bx1);
        for (int bx = std::max(bx0, e->bx0); bx < end; bx += EllipsoidInRow::kBlocks) {
            EllipsoidInRow in_row;
            find_in_row(*e, seen, dy, bx, in_row);
            std::uint32_t touched = in_row.touched;
            if (end - bx < EllipsoidInRow::kBlocks) touched &= (1u << (end - bx)) - 1;
            for (; touched != 0; touched &= touched - 1) {
                const auto n = std::size_t(std::countr_zero(touched));
                BlockPlan& plan = plans[std::size_t(bx - bx0) + n];
                // Set in the copy: a copy of what has just been set, by wider loads, would wait for it to reach the cache.
                BlockEllipsoid& in_block = plan.ellipsoids.emplace_back(seen);
                in_block.base_a = in_row.base_a[n];
                in_block.base_b = in_row.base_b[n];
                for (std::size_t d = 0; d < 3; ++d)
                    widen(d, in_row.bound[d][n], (in_row.covered >> n & 1) != 0, plan);
            }
        }
    }
}

float probability_at(const BlockPlan& plan, int draw, int dx, int dy, int dz) {
    const float* background = plan.background.values[std::size_t(draw)];
    float p =
        background != nullptr ? background[dx + 8 * dy + 64 * dz] : plan.background.low[std::size_t(draw)];
    for (const BlockEllipsoid& e : plan.ellipsoids) {
        const float inside = ellipsoid_probability(e, draw, float(dx), float(dy), float(dz));
        if (inside < 0) continue;
        p = draw == kExt ? std::min(p, inside) : std::max(p, inside);
    }
    return p;
}

}  // namespace nephos
