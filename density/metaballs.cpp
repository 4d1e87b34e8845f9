// SPDX-License-Identifier: Apache-2.0
#include "density/metaballs.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "automaton/error.h"
#include "density/openvdb_access.h"

namespace nephos {
namespace {

void check_radius(double radius_cells) {
    if (!(radius_cells >= kMinMetaballRadius && radius_cells <= kMaxMetaballRadius)) {
        throw Error(ErrorCode::usage,
                    "metaball radius of " + std::to_string(radius_cells) + " voxels: must be 1..8");
    }
}

// A lattice point in reach of a sample point, and the field there.
struct Tap {
    int i, j, k;
    double field;
};

// Lattice points within R of `point` (in voxel edges, voxel centres at +0.5), x fastest, with f > 0.
std::vector<Tap> taps_around(const Vec3& point, double radius) {
    std::vector<Tap> taps;
    const auto first = [&](double p) { return int(std::ceil(p - radius - 0.5)); };
    const auto last = [&](double p) { return int(std::floor(p + radius - 0.5)); };
    for (int k = first(point.z); k <= last(point.z); ++k) {
        for (int j = first(point.y); j <= last(point.y); ++j) {
            for (int i = first(point.x); i <= last(point.x); ++i) {
                const double dx = i + 0.5 - point.x, dy = j + 0.5 - point.y, dz = k + 0.5 - point.z;
                const double field = metaball_field(std::sqrt(dx * dx + dy * dy + dz * dz) / radius);
                if (field > 0) taps.push_back({i, j, k, field});
            }
        }
    }
    return taps;
}

double sum_of_fields(const std::vector<Tap>& taps) {
    double sum = 0;
    for (const Tap& tap : taps) sum += tap.field;
    return sum;
}

}  // namespace

// In w = 1 - a^2 the polynomial is w^2 (5 + 4 w) / 9: the same values without cancellation at the rim.
double metaball_field(double a) {
    if (!(a < 1)) return 0;
    const double w = 1 - a * a;
    return w * w * (5 + 4 * w) / 9;
}

// With s along the line, w = h^2 - s^2; the integrals of w^2 and w^3 over -h..h are 16/15 h^5 and 32/35 h^7.
double metaball_line_integral(double b) {
    if (!(b < 1)) return 0;
    const double h2 = 1 - b * b;
    return h2 * h2 * std::sqrt(h2) * (16.0 / 27.0 + 128.0 / 315.0 * h2);
}

double metaball_normalisation(double radius_cells) {
    return 2835.0 / (736.0 * std::numbers::pi * radius_cells * radius_cells * radius_cells);
}

std::vector<Metaball> metaballs(const DensityGrid& grid, double radius_cells) {
    check_radius(radius_cells);
    const auto blocks = blocks_of(grid);
    std::vector<std::size_t> first(blocks.size() + 1, 0);
    for (std::size_t n = 0; n < blocks.size(); ++n) {
        first[n + 1] = first[n] + (blocks[n].leaf ? blocks[n].leaf->onVoxelCount() : kBlockVoxels);
    }
    const Vec3 origin = grid.placement().origin_m;
    const double size = grid.placement().cell_size_m;
    std::vector<Metaball> balls(first.back());
    tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t n) {
        const Block& block = blocks[n];
        Metaball* out = balls.data() + first[n];
        for (int xyz = 0; xyz < kBlockVoxels; ++xyz) {  // x fastest
            const int x = xyz & 7, y = xyz >> 3 & 7, z = xyz >> 6;
            if (!block.active(leaf_offset(x, y, z))) continue;
            *out++ = {float(origin.x + (block.origin.x() + x + 0.5) * size),
                      float(origin.y + (block.origin.y() + y + 0.5) * size),
                      float(origin.z + (block.origin.z() + z + 0.5) * size), float(radius_cells * size),
                      block.value(leaf_offset(x, y, z))};
        }
    });
    return balls;
}

double density_at(const DensityGrid& grid, const Vec3& position_m, double radius_cells) {
    check_radius(radius_cells);
    const Placement& placement = grid.placement();
    const Vec3 point{(position_m.x - placement.origin_m.x) / placement.cell_size_m,
                     (position_m.y - placement.origin_m.y) / placement.cell_size_m,
                     (position_m.z - placement.origin_m.z) / placement.cell_size_m};
    // Also catches NaN, and keeps the conversion to integers in range.
    const Extent extent = grid.extent();
    const double reach = radius_cells + 1;
    const bool near = point.x > -reach && point.x < extent.x + reach && point.y > -reach &&
                      point.y < extent.y + reach && point.z > -reach && point.z < extent.z + reach;
    if (!near) return 0;
    const auto taps = taps_around(point, radius_cells);
    openvdb::FloatGrid::ConstAccessor voxels = OpenvdbAccess::grid(grid).getConstAccessor();
    double sum = 0;
    for (const Tap& tap : taps) sum += double(voxels.getValue({tap.i, tap.j, tap.k})) * tap.field;
    return sum / sum_of_fields(taps);
}

}  // namespace nephos
