// SPDX-License-Identifier: Apache-2.0
#pragma once

// A checksum of the voxels of a grid as a reader decodes them, whatever compression, library or metadata the file has.

#include <string>

#include "density/density_grid.h"

namespace nephos {

// Returns the XXH3-128 (core/digest.h) of: the extent as three 32-bit integers; then, for each block of 8 x 8 x 8 voxels
// with a value above 0, ordered by z, y, x of its origin, that origin as three 32-bit integers and its 512 values as
// 32-bit floats, z fastest, then y, then x; voxels outside of the extent are 0. All little-endian. `half`: of the
// values rounded to 16 bits, as a file of 16-bit floats holds them. Thread-safe; pure.
std::string voxel_digest(const DensityGrid& density, bool half = false);

}  // namespace nephos
