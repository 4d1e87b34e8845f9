// SPDX-License-Identifier: Apache-2.0
#include "density/combine.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include <tbb/parallel_for.h>

#include "automaton/error.h"
#include "automaton/text.h"
#include "density/openvdb_access.h"

namespace nephos {
namespace {

using openvdb::Coord;

// Edges that differ from whole voxels by less than this, in voxels, are whole: sums of decimal fractions
// seldom are.
constexpr double kWhole = 1e-6;

// From the common box's voxels to those of one grid: source = scale * common + offset, both at voxel centres.
struct Mapping {
    double scale = 1;
    Vec3 offset;
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

// Origins of the blocks of the common box that a grid's blocks reach into, each once, in order.
std::vector<Coord> reached_blocks(const DensityGrid& grid, const Mapping& map, const Extent& extent) {
    std::vector<Coord> origins;
    const auto range = [&](int block, double offset, int n) {
        // Interpolation reaches one source voxel beyond the block on both sides.
        const double low = (block - 1 - offset) / map.scale, high = (block + kBlock - offset) / map.scale;
        return std::pair{std::max(0, int(std::ceil(low - kWhole))) / kBlock,
                         std::min(n - 1, int(std::floor(high + kWhole))) / kBlock};
    };
    for (const Block& block : blocks_of(grid)) {
        if (block.positive_count() == 0) continue;
        const auto [x0, x1] = range(block.origin.x(), map.offset.x, extent.x);
        const auto [y0, y1] = range(block.origin.y(), map.offset.y, extent.y);
        const auto [z0, z1] = range(block.origin.z(), map.offset.z, extent.z);
        for (int z = z0; z <= z1; ++z) {
            for (int y = y0; y <= y1; ++y) {
                for (int x = x0; x <= x1; ++x) origins.emplace_back(x * kBlock, y * kBlock, z * kBlock);
            }
        }
    }
    const auto before = [](const Coord& a, const Coord& b) { return block_order(a) < block_order(b); };
    std::sort(origins.begin(), origins.end(), before);
    origins.erase(std::unique(origins.begin(), origins.end()), origins.end());
    return origins;
}

// Reads one grid in the common box.
class Sampler {
  public:
    Sampler(const DensityGrid& grid, const Mapping& map)
        : map_(map), accessor_(OpenvdbAccess::grid(grid).getConstAccessor()) {}

    float at(int x, int y, int z) {
        if (map_.exact) return accessor_.getValue(Coord(x, y, z) - map_.shift);
        return between(
            {map_.scale * x + map_.offset.x, map_.scale * y + map_.offset.y, map_.scale * z + map_.offset.z});
    }

  private:
    float between(const Vec3& p) {
        const double fx = std::floor(p.x), fy = std::floor(p.y), fz = std::floor(p.z);
        const Coord at{int(fx), int(fy), int(fz)};
        const double wx = p.x - fx, wy = p.y - fy, wz = p.z - fz;
        double sum = 0;
        for (int n = 0; n < 8; ++n) {
            const int dx = n & 1, dy = n >> 1 & 1, dz = n >> 2;
            const double weight = (dx ? wx : 1 - wx) * (dy ? wy : 1 - wy) * (dz ? wz : 1 - wz);
            if (weight > 0) sum += weight * double(accessor_.getValue(at.offsetBy(dx, dy, dz)));
        }
        return float(sum);
    }

    const Mapping& map_;
    openvdb::FloatGrid::ConstAccessor accessor_;
};

// Adds one grid to the values of a block of the common box.
void add_to_block(float* values, const DensityGrid& grid, const Mapping& map, const Coord& origin,
                  const Extent& extent) {
    Sampler sampler(grid, map);
    for (int n = 0; n < kBlockVoxels; ++n) {
        const int x = origin.x() + (n >> 6), y = origin.y() + (n >> 3 & 7), z = origin.z() + (n & 7);
        if (x >= extent.x || y >= extent.y || z >= extent.z) continue;
        values[n] = std::min(1.0f, values[n] + sampler.at(x, y, z));
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

DensityGrid combine(std::span<const DensityGrid> grids) {
    if (grids.size() == 1) return grids.front();
    std::vector<GridBox> boxes;
    for (const DensityGrid& grid : grids) boxes.push_back({grid.extent(), grid.placement()});
    const GridBox common = common_box(boxes);
    std::vector<Mapping> maps;
    std::vector<std::vector<Coord>> reached;
    std::vector<Coord> origins;
    for (const DensityGrid& grid : grids) {
        maps.push_back(mapping_of(common, grid.placement()));
        reached.push_back(reached_blocks(grid, maps.back(), common.extent));
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
            add_to_block(values, grids[g], maps[g], origins[n], common.extent);
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
