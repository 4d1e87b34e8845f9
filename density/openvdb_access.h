// SPDX-License-Identifier: Apache-2.0
#pragma once

// The OpenVDB tree behind a DensityGrid, for the .cpp files of this module (not installed).
//
// Invariants of a wrapped tree: background 0; a value is active exactly when it is above 0; inactive values are 0; nothing
// active outside 0 .. extent-1; tiles are never larger than one leaf (8x8x8), so that a tree is a set of blocks.

#include <openvdb/openvdb.h>

#include <memory>
#include <vector>

#include "density/density_grid.h"

namespace nephos {

using FloatLeaf = openvdb::FloatTree::LeafNodeType;

inline constexpr int kBlock = 8;                 // voxels along the edge of a leaf
inline constexpr int kBlockVoxels = 512;

// Offset of voxel (x, y, z) in a leaf's arrays: z runs fastest in OpenVDB.
inline constexpr int leaf_offset(int x, int y, int z) { return x << 6 | y << 3 | z; }

// One 8x8x8 block of a tree: a leaf, or a tile of one value.
struct Block {
    openvdb::Coord origin;
    const FloatLeaf* leaf = nullptr;  // null for a tile
    float tile = 0;

    float value(int offset) const { return leaf ? leaf->buffer().data()[offset] : tile; }
    bool active(int offset) const { return !leaf || leaf->valueMask().isOn(openvdb::Index(offset)); }
};

// Takes finished blocks one by one and hangs them into a new tree. Not thread-safe: blocks are made in parallel
// and handed over in a fixed order.
class TreeBuilder {
  public:
    TreeBuilder();
    void add(std::unique_ptr<FloatLeaf> leaf);
    void add_tile(const openvdb::Coord& origin, float value);
    openvdb::FloatGrid::Ptr finish() { return std::move(grid_); }

  private:
    openvdb::FloatGrid::Ptr grid_;
    openvdb::tree::ValueAccessor<openvdb::FloatTree> accessor_;
};

struct OpenvdbAccess {
    static const openvdb::FloatGrid& grid(const DensityGrid& density);
    // The grid must keep the invariants above; its transform is not used.
    static DensityGrid wrap(openvdb::FloatGrid::Ptr grid, Extent extent, const Placement& placement);
};

// All blocks with an active value, ordered by z, y, x of their origins.
std::vector<Block> blocks_of(const DensityGrid& density);

// A leaf at `origin` whose values are not yet set and whose voxels are all inactive.
std::unique_ptr<FloatLeaf> uninitialised_leaf(const openvdb::Coord& origin);

// Sets the value mask to the values above 0. Returns whether there is any.
bool activate_positive(FloatLeaf& leaf);

}  // namespace nephos
