// SPDX-License-Identifier: Apache-2.0
#include "density/combine.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/text.h"
#include "density/openvdb_access.h"

namespace nephos {
namespace {

using openvdb::Coord;

// Edges that differ from whole voxels by less than this, in voxels, are whole: sums of decimal fractions
// seldom are.
constexpr double kWhole = 1e-6;

// Maps voxel centres of the common box to those of one grid: source = scale * common + offset.
struct Mapping {
    double scale = 1;
    Vec3 offset{};
    bool exact = false;  // source and common voxels are the same ones, moved by `shift`
    Coord shift;         // common = source + shift
};

Mapping mapping_of(const GridBox& common, const Placement& source) {
    const double size = source.cell_size_m;
    const Vec3 &to = common.placement.origin_m, &from = source.origin_m;
    Mapping map;
    map.scale = common.placement.cell_size_m / size;
    const auto offset = [&](double common_m, double source_m) {
        return (common_m - source_m) / size + map.scale / 2 - 0.5;
    };
    map.offset = {offset(to.x, from.x), offset(to.y, from.y), offset(to.z, from.z)};
    const auto whole = [](double x) { return std::abs(x - std::round(x)) <= kWhole; };
    map.exact = common.placement.cell_size_m == size && whole(map.offset.x) && whole(map.offset.y) &&
                whole(map.offset.z);
    if (map.exact) {
        map.shift = {-int(std::llround(map.offset.x)), -int(std::llround(map.offset.y)),
                     -int(std::llround(map.offset.z))};
    }
    return map;
}

// One axis of a grid in the common box.
struct Axis {
    double scale, offset;  // as in Mapping
    int voxels;            // of the grid
    int common;            // voxels of the common box
    Boundary boundary;
};

// Origins along an axis of the common blocks that the grid's block at `block` reaches into; on a periodic
// axis an origin may come twice.
std::vector<int> reached_along(const Axis& axis, int block) {
    std::vector<int> origins;
    const auto add = [&](int first, int last) {  // voxels of the grid
        const double low = (first - axis.offset) / axis.scale, high = (last - axis.offset) / axis.scale;
        const int begin = std::max(0, int(std::ceil(low - kWhole))) / kBlock;
        const int end = std::min(axis.common - 1, int(std::floor(high + kWhole))) / kBlock;
        for (int n = begin; n <= end; ++n) origins.push_back(n * kBlock);
    };
    add(block - 1, block + kBlock);  // interpolation reaches one voxel beyond the block on both sides
    if (axis.boundary == Boundary::open) return origins;
    if (block == 0) add(axis.voxels - 1, axis.voxels);
    if (block + kBlock >= axis.voxels) add(-1, 0);
    return origins;
}

// Origins of the blocks of the common box that a grid's blocks reach into, each once, in order.
std::vector<Coord> reached_blocks(const DensityGrid& grid, const Mapping& map, const Boundaries& boundaries,
                                  const Extent& extent) {
    const Extent own = grid.extent();
    const Axis x_axis{map.scale, map.offset.x, own.x, extent.x, boundaries.x},
        y_axis{map.scale, map.offset.y, own.y, extent.y, boundaries.y},
        z_axis{map.scale, map.offset.z, own.z, extent.z, boundaries.z};
    std::vector<Coord> origins;
    for (const Block& block : blocks_of(grid)) {
        if (block.positive_count() == 0) continue;
        const auto along_x = reached_along(x_axis, block.origin.x()),
                   along_y = reached_along(y_axis, block.origin.y()),
                   along_z = reached_along(z_axis, block.origin.z());
        for (const int z : along_z) {
            for (const int y : along_y) {
                for (const int x : along_x) origins.emplace_back(x, y, z);
            }
        }
    }
    const auto before = [](const Coord& a, const Coord& b) { return block_order(a) < block_order(b); };
    std::sort(origins.begin(), origins.end(), before);
    origins.erase(std::unique(origins.begin(), origins.end()), origins.end());
    return origins;
}

// The two voxels around a place on an axis and their weights; of a periodic axis none beyond its sides.
struct Neighbours {
    std::array<int, 2> index;
    std::array<double, 2> weight;

    Neighbours(double p, int voxels, Boundary boundary) {
        const double below = std::floor(p);
        const bool inside = p >= -0.5 - kWhole && p < voxels - 0.5 - kWhole;
        const bool nothing = boundary == Boundary::periodic && !inside;
        index = {repeated(int(below), voxels, boundary), repeated(int(below) + 1, voxels, boundary)};
        weight = {nothing ? 0 : 1 - (p - below), nothing ? 0 : p - below};
    }
};

// Tells what a block of the common box reads of a grid along an axis: its voxels, and for each voxel of the block its two
// neighbours as indices of these.
struct BlockAxis {
    std::vector<int> voxels;
    std::array<std::array<std::size_t, 2>, kBlock> index;
    std::array<std::array<double, 2>, kBlock> weight;

    BlockAxis(const Axis& axis, int first) {
        for (std::size_t n = 0; n < kBlock; ++n) {
            const Neighbours at(axis.scale * (first + int(n)) + axis.offset, axis.voxels, axis.boundary);
            weight[n] = at.weight;
            for (std::size_t side = 0; side < 2; ++side) {
                const auto known = std::ranges::find(voxels, at.index[side]);
                index[n][side] = std::size_t(known - voxels.begin());
                if (known == voxels.end()) voxels.push_back(at.index[side]);
            }
        }
    }
};

// Adds a grid that is resampled to the values of a block.
void add_resampled(float* values, const FloatGrid& grid, const Axis& x_axis, const Axis& y_axis,
                   const Axis& z_axis, const Coord& origin) {
    const BlockAxis x(x_axis, origin.x()), y(y_axis, origin.y()), z(z_axis, origin.z());
    auto accessor = grid.getConstAccessor();
    const std::size_t row = z.voxels.size(), slice = row * y.voxels.size();
    std::vector<double> read;
    read.reserve(slice * x.voxels.size());
    for (const int i : x.voxels)
        for (const int j : y.voxels)
            for (const int k : z.voxels) read.push_back(double(accessor.getValue({i, j, k})));
    for (int n = 0; n < kBlockVoxels; ++n) {
        const std::size_t i = std::size_t(n >> 6), j = std::size_t(n >> 3 & 7), k = std::size_t(n & 7);
        if (origin.x() + int(i) >= x_axis.common || origin.y() + int(j) >= y_axis.common ||
            origin.z() + int(k) >= z_axis.common)
            continue;
        double sum = 0;
        for (std::size_t c = 0; c < 8; ++c) {
            const std::size_t dx = c & 1, dy = c >> 1 & 1, dz = c >> 2;
            const double weight = x.weight[i][dx] * y.weight[j][dy] * z.weight[k][dz];
            sum += weight * read[x.index[i][dx] * slice + y.index[j][dy] * row + z.index[k][dz]];
        }
        values[n] = std::min(1.0f, values[n] + float(sum));
    }
}

// Adds one grid to the values of a block of the common box.
void add_to_block(float* values, const DensityGrid& grid, const Mapping& map, const Boundaries& boundaries,
                  const Coord& origin, const Extent& extent) {
    const FloatGrid& source = OpenvdbAccess::grid(grid);
    if (!map.exact) {
        const Extent own = grid.extent();
        return add_resampled(values, source, {map.scale, map.offset.x, own.x, extent.x, boundaries.x},
                             {map.scale, map.offset.y, own.y, extent.y, boundaries.y},
                             {map.scale, map.offset.z, own.z, extent.z, boundaries.z}, origin);
    }
    auto accessor = source.getConstAccessor();
    for (int n = 0; n < kBlockVoxels; ++n) {
        const Coord at(origin.x() + (n >> 6), origin.y() + (n >> 3 & 7), origin.z() + (n & 7));
        if (at.x() >= extent.x || at.y() >= extent.y || at.z() >= extent.z) continue;
        values[n] = std::min(1.0f, values[n] + accessor.getValue(at - map.shift));
    }
}

// One side of the common box: the first voxel, counted from `origin`, and how many.
std::pair<double, double> side(std::span<const GridBox> boxes, double origin, double size, double Vec3::*axis,
                               int Extent::*count) {
    double low = 0, high = 0;
    for (const GridBox& box : boxes) {
        const double begin = (box.placement.origin_m.*axis - origin) / size;
        const double end = begin + double(box.extent.*count) * box.placement.cell_size_m / size;
        low = std::min(low, std::floor(begin + kWhole));
        high = std::max(high, std::ceil(end - kWhole));
    }
    return {low, high - low};
}

}  // namespace

GridBox common_box(std::span<const GridBox> boxes) {
    if (boxes.empty()) throw Error(ErrorCode::usage, "no grids to combine");
    const GridBox& finest =
        *std::ranges::min_element(boxes, {}, [](const GridBox& box) { return box.placement.cell_size_m; });
    const double size = finest.placement.cell_size_m;
    const Vec3& origin = finest.placement.origin_m;
    const auto [x, nx] = side(boxes, origin.x, size, &Vec3::x, &Extent::x);
    const auto [y, ny] = side(boxes, origin.y, size, &Vec3::y, &Extent::y);
    const auto [z, nz] = side(boxes, origin.z, size, &Vec3::z, &Extent::z);
    const double most = double(std::numeric_limits<int>::max());
    if (nx > most || ny > most || nz > most) {
        throw Error(ErrorCode::usage, "the grids lie too far apart for one grid of their smallest voxels: " +
                                          number_text(nx, 17) + " x " + number_text(ny, 17) + " x " +
                                          number_text(nz, 17));
    }
    return {{int(nx), int(ny), int(nz)},
            {{origin.x + x * size, origin.y + y * size, origin.z + z * size}, size}};
}

DensityGrid combine(std::span<const DensityGrid> grids, std::span<const Boundaries> boundaries) {
    if (!boundaries.empty() && boundaries.size() != grids.size()) {
        throw Error(ErrorCode::usage, std::to_string(boundaries.size()) + " boundaries for " +
                                          std::to_string(grids.size()) + " grids: expected one for each");
    }
    if (grids.size() == 1) return grids.front();
    std::vector<GridBox> boxes;
    for (const DensityGrid& grid : grids) boxes.push_back({grid.extent(), grid.placement()});
    const GridBox common = common_box(boxes);
    const auto boundaries_of = [&](std::size_t g) {
        return boundaries.empty() ? Boundaries{} : boundaries[g];
    };
    std::vector<Mapping> maps;
    std::vector<std::vector<Coord>> reached;
    std::vector<Coord> origins;
    for (std::size_t g = 0; g < grids.size(); ++g) {
        maps.push_back(mapping_of(common, grids[g].placement()));
        reached.push_back(reached_blocks(grids[g], maps.back(), boundaries_of(g), common.extent));
        origins.insert(origins.end(), reached.back().begin(), reached.back().end());
    }
    const auto before = [](const Coord& a, const Coord& b) { return block_order(a) < block_order(b); };
    std::sort(origins.begin(), origins.end(), before);
    origins.erase(std::unique(origins.begin(), origins.end()), origins.end());

    std::vector<NewBlock> blocks(origins.size());
    tbb::parallel_for(std::size_t{0}, origins.size(), [&](std::size_t n) {
        auto leaf = uninitialised_leaf(origins[n]);
        float* values = leaf->buffer().data();
        std::fill_n(values, kBlockVoxels, 0.0f);
        for (std::size_t g = 0; g < grids.size(); ++g) {
            if (!std::binary_search(reached[g].begin(), reached[g].end(), origins[n], before)) continue;
            add_to_block(values, grids[g], maps[g], boundaries_of(g), origins[n], common.extent);
        }
        blocks[n] = NewBlock::from(std::move(leaf));
    });
    TreeBuilder builder;
    for (std::size_t n = 0; n < blocks.size(); ++n) blocks[n].move_to(builder, origins[n]);
    return builder.finish(common.extent, common.placement);
}

DensityGrid scaled(const DensityGrid& grid, double factor) {
    if (!(factor > 0 && factor <= 1)) {
        throw Error(ErrorCode::usage,
                    "factor of a density is " + number_text(factor, 6) + ": must be above 0 and at most 1");
    }
    if (factor == 1) return grid;
    const std::vector<Block> sources = blocks_of(grid);
    std::vector<NewBlock> blocks(sources.size());
    tbb::parallel_for(std::size_t{0}, sources.size(), [&](std::size_t n) {
        auto leaf = uninitialised_leaf(sources[n].origin);
        for (int v = 0; v < kBlockVoxels; ++v) leaf->buffer().data()[v] = sources[n].value(v) * float(factor);
        blocks[n] = NewBlock::from(std::move(leaf));
    });
    TreeBuilder builder;
    for (std::size_t n = 0; n < blocks.size(); ++n) blocks[n].move_to(builder, sources[n].origin);
    return builder.finish(grid.extent(), grid.placement());
}

}  // namespace nephos
