// SPDX-License-Identifier: Apache-2.0
#pragma once

// Files of bricks: the levels of a volume cut into cubes of voxels, each with a border of its neighbours, so that a
// linear filter needs no other brick; where there is no density there are no data. Little-endian:
//
//     bytes 0..7    "NPHBRIC1"
//     u32           type of voxels: 0 r8, 1 r16, 2 r16f, 3 r32f
//     u32           edge N of a brick without its border
//     u32           border B, 1
//     u32           number of levels L
//     u64           number of bricks C
//     L times       u32 x 3: voxels of the level on each axis
//     C times       u32 level, i, j, k;  u64 offset, bytes;  f32 min, max
//     data          (N + 2 B)^3 voxels a brick, x fastest; voxel (B, B, B) is voxel (i N, j N, k N) of the level
//
// Bricks are in the order of levels, then k, j, i. `offset` counts from the beginning of the file; an empty brick has 0
// bytes. min and max are those of the values with their border. Beyond the sides of a level the border is 0, or the
// opposite side on axes that repeat. Files are complete or absent; functions throw Error(io) naming the file.

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "density/export/containers.h"
#include "density/export/volume.h"

namespace nephos {

struct BrickOptions {
    int edge = 32;                   // 8..256
    VoxelType type = VoxelType::r8;  // not bc4, whose blocks would not fit: Error(usage)
    float scale = 1;                 // as in encode()
    std::array<bool, 3> periodic{};  // the file's axes; of level 0 and, where the sides divide, of all
};

// Writes the levels of a volume, level 0 first.
void write_bricks(const std::filesystem::path& path, const std::vector<Volume>& levels,
                  const BrickOptions& options);

// Returns the levels put together from the bricks. A file whose levels take more than 256 MiB and 2,000 times its own bytes
// is refused before memory is taken, unless they take no more than it is known to hold.
EncodedVolume read_bricks(const std::filesystem::path& path, std::uint64_t known_bytes = 0);

// Throws Error(io) naming the file unless each brick that read_bricks() takes has, with its border, the voxels of these levels and
// their range. `allowed` gives what a voxel may differ by in the file; greater values than `most` are it there.
void check_bricks(const std::filesystem::path& path, const std::vector<Volume>& levels,
                  const BrickOptions& options, float most, const std::function<double(float)>& allowed);

// Returns the most bytes that a file of these levels takes.
std::uint64_t most_brick_bytes(const std::vector<std::array<int, 3>>& sizes, int edge, VoxelType type);

// Returns the most memory that write_bricks() takes beside the levels.
std::uint64_t brick_work_bytes(const std::vector<std::array<int, 3>>& sizes, int edge, VoxelType type);

}  // namespace nephos
