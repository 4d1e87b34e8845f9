// SPDX-License-Identifier: Apache-2.0
#pragma once

// A NanoVDB file between the process that parses it and the one that asked for it (not installed): its place, then the blocks of
// density/vdb/block_stream.h.

#include "density/density_grid.h"
#include "density/vdb/sandbox.h"

namespace nephos {

// The child's part: parses an open file from its beginning. Throws what says why it is no whole file of one float grid, quantised or
// not, within the extent: std::ios_base::failure, std::bad_alloc or std::runtime_error; what the library throws for a lack of memory
// is one of the last.
void send_nanovdb(int file, const Extent& extent, SandboxWriter& writer);

// The parent's part. Throws std::runtime_error when the voxels are no cubes along the axes, and as receive_blocks() does.
DensityGrid receive_nanovdb(SandboxReader& reader, const Extent& extent);

}  // namespace nephos
