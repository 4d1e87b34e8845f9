// SPDX-License-Identifier: Apache-2.0
#pragma once

// Finds the voxels in a cloud of metaballs: which metaballs stand for the voxels of one block of 8 x 8 x 8.
// Blocks lie on a lattice that the world fixes. No Vulkan here. Private to the module.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "render/cloud/cloud_preparation.h"

namespace nephos {

inline constexpr int kBlockSide = 8;  // voxels

// Voxels of one size; a metaball at x lies in voxel floor(x per_edge - phase).
struct VoxelLattice {
    float radius = 0;  // of its metaballs, metres
    double edge_m = 1, per_edge = 1;
    double phase[3] = {};
};

// Consecutive metaballs in one block.
struct BlockRun {
    std::uint64_t block = 0;           // its place, lattice_of() and place_of()
    std::uint32_t begin = 0, end = 0;  // of PreparedCloud::visible
};

inline constexpr int kBlockPlaceBits = 20;  // of a block on each axis, x in the lowest

// Index of a block's lattice.
inline std::size_t lattice_of(std::uint64_t block) { return std::size_t(block >> 3 * kBlockPlaceBits); }
// Number of the block on each axis, 0 at the world's origin.
std::array<int, 3> place_of(std::uint64_t block);

// Where a metaball is in its block.
struct VoxelPlace {
    float x, y, z;       // voxels from the block's corner
    std::uint32_t pair;  // which of the 4 x 4 x 4 blocks of 2 x 2 x 2 voxels in it, x fastest
};

struct VoxelBlocks {
    std::vector<VoxelLattice> lattices;
    std::vector<BlockRun> runs;      // those of one block behind each other, blocks by number
    std::vector<std::size_t> first;  // where each block's runs begin, and their end
    std::vector<VoxelPlace> places;  // one for each of PreparedCloud::visible
    std::size_t size() const { return first.size() - 1; }
    std::span<const BlockRun> of_block(std::size_t n) const {
        return std::span(runs).subspan(first[n], first[n + 1] - first[n]);
    }
};

// Of a cloud whose metaballs have this radius in voxels. Nothing where there are no voxels: no metaballs,
// more than 16 different radii, a metaball farther than 2^22 voxels from the world's origin, or hardly any
// two of a block following each other.
std::optional<VoxelBlocks> voxel_blocks(const PreparedCloud& cloud, double radius_voxels);

}  // namespace nephos
