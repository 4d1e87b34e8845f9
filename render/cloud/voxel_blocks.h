// SPDX-License-Identifier: Apache-2.0
#pragma once

// Reconstructs the voxel lattice behind a cloud of metaballs and groups them by blocks of 8 x 8 x 8 voxels.
// The lattice of blocks is fixed in the world. Private to the module.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "render/cloud/cloud_preparation.h"

namespace nephos {

inline constexpr int kBlockSide = 8;  // voxels

// Voxels of one size; a metaball at x is in voxel floor(x per_edge - phase).
struct VoxelLattice {
    float radius = 0;  // of its metaballs, metres
    std::uint8_t detailed = 0;  // PreparedCloud::detailed
    double edge_m = 1, per_edge = 1;
    double phase[3] = {};
};

// Consecutive metaballs in one block.
struct BlockRun {
    std::uint64_t block = 0;           // number of the block: lattice_of() and place_of()
    std::uint32_t begin = 0, end = 0;  // of PreparedCloud::visible
};

inline constexpr int kBlockPlaceBits = 20;  // of a block's coordinate on each axis, x lowest

// Returns the index of a block's lattice.
inline std::size_t lattice_of(std::uint64_t block) { return std::size_t(block >> 3 * kBlockPlaceBits); }
// Returns the block's coordinates, in blocks from the world's origin.
std::array<int, 3> place_of(std::uint64_t block);

// The position of a metaball in its block.
struct VoxelPlace {
    float x, y, z;       // voxels from the block's corner
    std::uint32_t pair;  // index of its 2 x 2 x 2 voxels among the 4 x 4 x 4 of the block, x fastest
};

struct VoxelBlocks {
    std::vector<VoxelLattice> lattices;
    std::vector<BlockRun> runs;      // sorted by block
    std::vector<std::size_t> first;  // index of each block's first run, and at last runs.size()
    std::vector<VoxelPlace> places;  // one for each of PreparedCloud::visible
    std::size_t size() const { return first.size() - 1; }
    std::span<const BlockRun> of_block(std::size_t n) const {
        return std::span(runs).subspan(first[n], first[n + 1] - first[n]);
    }
};

// Groups the metaballs of a cloud, whose radius is given in voxels. Returns nullopt where they are no voxels:
// no metaballs, more than 16 different radii, a metaball farther than 2^22 voxels from the world's origin, or
// hardly any two successive ones in one block.
std::optional<VoxelBlocks> voxel_blocks(const PreparedCloud& cloud, double radius_voxels);

}  // namespace nephos
