// SPDX-License-Identifier: Apache-2.0
#pragma once

// The OpenVDB tree behind a DensityGrid, for the .cpp files of this module (not installed).
//
// Invariants of a wrapped tree:
// - background 0, inactive values 0, nothing active outside 0 .. extent-1;
// - a value is active exactly when it is above 0. Two voxels are always active, 0 and extent-1: so the active
//   bounds, which OpenVDB and its users take for the grid's bounds, are the extent's;
// - tiles are exactly one leaf large (8x8x8), so that a tree is a set of blocks;
// - a block of one value is a tile.

#include <array>
#include <memory>
#include <tuple>
#include <vector>

#include "density/density_grid.h"
#include "density/openvdb_grids.h"

namespace nephos {

using FloatLeaf = FloatTree::LeafNodeType;

inline constexpr int kBlock = 8;  // voxels along the edge of a leaf
inline constexpr int kBlockVoxels = 512;

// Offset of voxel (x, y, z) in a leaf's arrays: z runs fastest in OpenVDB.
inline constexpr int leaf_offset(int x, int y, int z) { return x << 6 | y << 3 | z; }

// One 8x8x8 block of a tree: a leaf, or a tile of one value.
struct Block {
    openvdb::Coord origin;
    const FloatLeaf* leaf = nullptr;  // null for a tile
    float tile = 0;

    float value(int offset) const { return leaf ? leaf->buffer().data()[offset] : tile; }
    int positive_count() const;  // values above 0
    // Copies the voxels that lie inside of `extent` into a dense array: `to` is that of voxel (0, 0, 0), `stride` the
    // array's steps along x, y and z.
    void copy_to(float* to, const std::array<std::size_t, 3>& stride, Extent extent) const;
};

// Assembles a tree from finished blocks. Not thread-safe: blocks are computed in parallel and added in a
// fixed order.
class TreeBuilder {
  public:
    TreeBuilder();
    // Adds a leaf whose mask is set.
    void add(std::unique_ptr<FloatLeaf> leaf);
    void add_tile(const openvdb::Coord& origin, float value);  // value > 0
    // Activates the two corner voxels and returns the grid; leaves the builder empty.
    DensityGrid finish(Extent extent, const Placement& placement);

  private:
    FloatGrid::Ptr grid_;
    openvdb::tree::ValueAccessor<FloatTree> accessor_;
};

struct OpenvdbAccess {
    static const FloatGrid& grid(const DensityGrid& density);
    // Wraps a grid that satisfies the invariants above; its transform is not used.
    static DensityGrid wrap(FloatGrid::Ptr grid, Extent extent, const Placement& placement);
};

// Returns all blocks of the tree, ordered by z, y, x of their origins. A corner's block may have no value
// above 0.
std::vector<Block> blocks_of(const DensityGrid& density);
// Returns the sort key of a block in that order.
std::tuple<int, int, int> block_order(const openvdb::Coord& origin);

// The result of a parallel computation of one block: at most one of leaf and tile.
struct NewBlock {
    std::unique_ptr<FloatLeaf> leaf;
    float tile = 0;

    // Classifies a leaf whose values are set and whose mask is not: nothing when all are 0, a tile when all
    // are equal, else a leaf with its mask set.
    static NewBlock from(std::unique_ptr<FloatLeaf> leaf);
    void move_to(TreeBuilder& builder, const openvdb::Coord& origin);
};

// Returns a leaf at `origin` with uninitialised values, all inactive.
std::unique_ptr<FloatLeaf> uninitialised_leaf(const openvdb::Coord& origin);

// Wraps index i into 0..n-1 on a periodic axis of n voxels; returns i on an open one.
inline int repeated(int i, int n, Boundary boundary) {
    if (boundary == Boundary::open || (i >= 0 && i < n)) return i;
    const int rest = i % n;
    return rest < 0 ? rest + n : rest;
}

}  // namespace nephos
