// SPDX-License-Identifier: Apache-2.0
#pragma once

// Voxels of a grid between the process that parses a file and the one that asked for it (not installed): blocks of 8x8x8
// voxels, each after a mark, in any order.

#include <cstdint>

#include "density/openvdb_access.h"
#include "density/vdb/sandbox.h"

namespace nephos {

// The type of the next record in the stream of blocks.
enum class Record : std::uint8_t { end, leaf, tile };

// The child's part.
void send_leaf(SandboxWriter& writer, const openvdb::Coord& origin, const float* values);
void send_tile(SandboxWriter& writer, const openvdb::Coord& origin, float value);
inline void send_end(SandboxWriter& writer) { writer.value(Record::end); }

// The parent's part. Return the lowest corner of a block, and the grid of all blocks up to the end; throw
// std::runtime_error when a block lies beside the extent, a value is negative or not finite, or the nodes of the tree
// take more than reader.memory_bytes().
openvdb::Coord receive_origin(SandboxReader& reader, const Extent& extent);
DensityGrid receive_blocks(SandboxReader& reader, const Extent& extent, const Placement& placement);

}  // namespace nephos
