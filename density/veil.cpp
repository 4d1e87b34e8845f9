// SPDX-License-Identifier: Apache-2.0
#include "density/veil.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/math.h"
#include "density/openvdb_access.h"
#include "density/veil_kernel.h"
#include "density/veil_plan.h"

namespace nephos {
namespace {

constexpr float kLeastDensity = 0x1p-10f;

// The state shared by all blocks of voxels.
struct VeilField {
    VeilPlan plan;
    Extent extent;
    double cell_m = 0;
    Rotation along;                       // direction of the fibres
    double east_m = 0, north_m = 0;       // of the lattice's corner from the point that the wind carries
    std::vector<float> by_x, by_y, by_z;  // weights 0..1 of columns and levels
    std::vector<double> up_m, behind_m;   // of levels: height above the base, and displacement along
    float sheet = 0;
    VeilArea area;
    bool is_limited = false;  // by the area
    Rotation of_area;
    double area_x_m = 0, area_y_m = 0;  // of its centre from the lattice's corner
    Vec2 period_m{0, 0};                // as VeilOptions::period_m
};

std::vector<float> side_weights(int cells, double cell_m, double margin_m) {
    std::vector<float> weights;
    for (int n = 0; n < cells; ++n) {
        const double in = (std::min(n, cells - 1 - n) + 0.5) * cell_m;
        weights.push_back(float(fade_in(in, margin_m)));
    }
    return weights;
}

VeilField field_of(const VeilOptions& options, const Wind& wind, const Extent& extent,
                   const Placement& placement, double time_s) {
    VeilField field;
    field.plan = veil_plan(options, time_s);
    field.extent = extent;
    field.cell_m = placement.cell_size_m;
    field.along = rotation_of_degrees(options.direction_deg);
    const Vec3 carried = wind_displacement_m(wind, options.top_m, time_s);
    field.east_m = placement.origin_m.x - carried.x;
    field.north_m = placement.origin_m.y - carried.y;
    field.by_x = side_weights(extent.x, field.cell_m, options.margin_m);
    field.by_y = side_weights(extent.y, field.cell_m, options.margin_m);
    const double depth = options.top_m - options.base_m;
    for (int k = 0; k < extent.z; ++k) {
        const double z = placement.origin_m.z + (k + 0.5) * field.cell_m;
        field.by_z.push_back(float(fade_in(z - options.base_m, options.soft_base_m) *
                                   fade_in(options.top_m - z, options.soft_top_m)));
        const double fallen = std::max(0.0, (options.top_m - z) / depth);
        field.up_m.push_back(z - options.base_m);
        field.behind_m.push_back(options.fallstreak_m * fallen * fallen);
    }
    field.sheet = float(options.sheet);
    field.area = options.area;
    field.is_limited = std::isfinite(options.area.semi_a_m) || std::isfinite(options.area.semi_b_m);
    field.of_area = rotation_of_degrees(options.area.yaw_deg);
    field.period_m = options.period_m;
    field.area_x_m = options.area.x_m + (options.area.carried ? carried.x : 0) - placement.origin_m.x;
    field.area_y_m = options.area.y_m + (options.area.carried ? carried.y : 0) - placement.origin_m.y;
    return field;
}

// The weight of a column by the area.
float area_weight(const VeilField& field, int i, int j) {
    if (!field.is_limited) return 1;
    double east = (i + 0.5) * field.cell_m - field.area_x_m, north = (j + 0.5) * field.cell_m - field.area_y_m;
    if (field.period_m.x > 0) {  // from the nearest image of the centre
        east = std::remainder(east, field.period_m.x);
        north = std::remainder(north, field.period_m.y);
    }
    const double a = (east * field.of_area.cos + north * field.of_area.sin) / field.area.semi_a_m,
                 b = (north * field.of_area.cos - east * field.of_area.sin) / field.area.semi_b_m;
    return float(fade_in(1 - std::sqrt(a * a + b * b), field.area.softness));
}

// The voxels of a block whose weight is above 0, side by side.
struct BlockPoints {
    std::array<std::array<float, kBlockVoxels>, 3> from_base_m;
    std::array<float, kBlockVoxels> weight;
    std::array<std::uint16_t, kBlockVoxels> offset;  // in the leaf
    std::array<double, 3> base_m;
    std::size_t count = 0;

    void add(int leaf_voxel, float voxel_weight, double along, double across, double up) {
        from_base_m[0][count] = float(along);
        from_base_m[1][count] = float(across);
        from_base_m[2][count] = float(up);
        weight[count] = voxel_weight;
        offset[count++] = std::uint16_t(leaf_voxel);
    }
    // Pads the points to a multiple of the kernel's lanes; results of the padding are ignored.
    std::size_t padded() {
        const std::size_t whole = (count + kVeilLanes - 1) / kVeilLanes * kVeilLanes;
        for (std::size_t n = count; n < whole; ++n) {
            for (auto& axis : from_base_m) axis[n] = axis[0];
        }
        return whole;
    }
};

void collect(const VeilField& field, const openvdb::Coord& origin, BlockPoints& points) {
    const Rotation& r = field.along;
    const auto z0 = std::size_t(origin.z());
    const double east = field.east_m + (origin.x() + 0.5) * field.cell_m;
    const double north = field.north_m + (origin.y() + 0.5) * field.cell_m;
    points.base_m = {east * r.cos + north * r.sin + field.behind_m[z0], north * r.cos - east * r.sin,
                     field.up_m[z0]};
    points.count = 0;
    const int nx = std::min(kBlock, field.extent.x - origin.x()),
              ny = std::min(kBlock, field.extent.y - origin.y());
    const int nz = std::min(kBlock, field.extent.z - origin.z());
    for (int x = 0; x < nx; ++x) {
        for (int y = 0; y < ny; ++y) {
            const float side = field.by_x[std::size_t(origin.x() + x)] *
                               field.by_y[std::size_t(origin.y() + y)] *
                               area_weight(field, origin.x() + x, origin.y() + y);
            const double dx = x * field.cell_m, dy = y * field.cell_m;
            const double along = dx * r.cos + dy * r.sin, across = dy * r.cos - dx * r.sin;
            for (int z = 0; z < nz; ++z) {
                const std::size_t level = z0 + std::size_t(z);
                const float weight = side * field.by_z[level];
                if (weight < kLeastDensity) continue;
                points.add(leaf_offset(x, y, z), weight, along + (field.behind_m[level] - field.behind_m[z0]),
                           across, field.up_m[level] - field.up_m[z0]);
            }
        }
    }
}

float density_of(const VeilField& field, float q, float weight) {
    const float pattern = smoothstep(field.plan.low, field.plan.high, q);
    const float density = (field.sheet + (1 - field.sheet) * pattern) * weight;
    return density < kLeastDensity ? 0.0f : density;
}

NewBlock make_block(const VeilField& field, const openvdb::Coord& origin) {
    BlockPoints block;
    collect(field, origin, block);
    if (block.count == 0) return {};
    VeilPoints points;
    points.base_m = block.base_m;
    points.count = block.padded();
    for (std::size_t axis = 0; axis < 3; ++axis) points.from_base_m[axis] = block.from_base_m[axis].data();
    std::array<float, kBlockVoxels> sums;
    veil_sums(field.plan, points, field.plan.low, sums.data());
    auto leaf = uninitialised_leaf(origin);
    float* out = leaf->buffer().data();
    std::fill_n(out, kBlockVoxels, 0.0f);
    for (std::size_t n = 0; n < block.count; ++n)
        out[block.offset[n]] = density_of(field, sums[n], block.weight[n]);
    return NewBlock::from(std::move(leaf));
}

}  // namespace

Vec3 wind_displacement_m(const Wind& wind, double height_m, double time_s) {
    // Times at which the wind changes its course, and both ends; between two of them it is linear.
    std::vector<double> times{std::min(0.0, time_s), std::max(0.0, time_s)};
    for (const WindKeyframe& key : wind.keyframes) {
        if (key.time_s > times.front() && key.time_s < std::max(0.0, time_s)) times.push_back(key.time_s);
    }
    std::ranges::sort(times);
    Vec3 way{};
    for (std::size_t n = 1; n < times.size(); ++n) {
        const Velocity from = wind_at(wind, height_m, times[n - 1]), to = wind_at(wind, height_m, times[n]);
        const double half = (times[n] - times[n - 1]) / 2;
        way.x += (from.east_m_per_s + to.east_m_per_s) * half;
        way.y += (from.north_m_per_s + to.north_m_per_s) * half;
    }
    return time_s < 0 ? Vec3{-way.x, -way.y, 0} : way;
}

DensityGrid veil_density(const VeilOptions& options, const Wind& wind, const Extent& extent,
                         const Placement& placement, double time_s) {
    check(options, extent, placement);
    if (!std::isfinite(time_s) || std::abs(time_s) > 1e9) {
        throw Error(ErrorCode::usage, "the time of a veil is beyond 1e9 s");
    }
    const VeilField field = field_of(options, wind, extent, placement, time_s);
    const auto blocks_along = [](int n) { return (n + kBlock - 1) / kBlock; };
    const int bx = blocks_along(extent.x), by = blocks_along(extent.y), bz = blocks_along(extent.z);
    TreeBuilder builder;
    std::vector<NewBlock> level(std::size_t(bx) * std::size_t(by));
    for (int z = 0; z < bz; ++z) {
        const auto origin = [&](std::size_t n) {
            return openvdb::Coord(int(n) % bx * kBlock, int(n) / bx * kBlock, z * kBlock);
        };
        tbb::parallel_for(std::size_t{0}, level.size(),
                          [&](std::size_t n) { level[n] = make_block(field, origin(n)); });
        for (std::size_t n = 0; n < level.size(); ++n) level[n].move_to(builder, origin(n));
    }
    return builder.finish(extent, placement);
}

}  // namespace nephos
