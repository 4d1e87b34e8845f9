// SPDX-License-Identifier: Apache-2.0
#pragma once

// Conversion from the index space of any OpenVDB file to that of a DensityGrid (not installed; runs inside
// the sandbox): axes are permuted and mirrored so that x is east, y north and z up, and bounds moved to begin
// at voxel 0. Voxels that are not cubes, or not along the axes, are resampled.

#include <cstdint>
#include <functional>

#include "automaton/lattice.h"
#include "density/openvdb_grids.h"

namespace nephos {

// Receives the result: the geometry first, then the blocks, each once, in any order.
struct DensityReceiver {
    std::function<void(const Extent&, const Placement&)> begin;
    std::function<void(const openvdb::Coord& origin, const float* values)>
        leaf;                                                             // 512 values, OpenVDB's order
    std::function<void(const openvdb::Coord& origin, float value)> tile;  // an 8x8x8 block of one value
};

struct ForeignGrid {
    const FloatGrid* grid = nullptr;
    openvdb::CoordBBox bounds;  // of the voxels to take, in the file's index space
    bool y_up = false;
    double metres_per_unit = 1;
    std::size_t memory_bytes = 0;  // no result larger than this
    // Voxels are cloud or not: those along the axes that are as long as they are wide are taken as they are, of whatever height, and
    // where voxels are resampled, each takes the nearest one's value.
    bool is_mask = false;
};

struct ForeignResult {
    bool resampled = false;
    std::uint64_t negative = 0;  // voxels below 0 that became 0
    double level_height_m = 0;   // of a voxel; its edge but for masks
};

// Converts a grid and passes it to `receiver`. Throws std::runtime_error when it cannot be represented: a
// transform that is not linear, too many voxels, values that are not finite.
ForeignResult convert_foreign(const ForeignGrid& foreign, const DensityReceiver& receiver);

}  // namespace nephos
