// SPDX-License-Identifier: Apache-2.0
#pragma once

// Reads cloud masks of other programs: like densities (vdb_file.h), and bool and mask grids besides.

#include "density/vdb/vdb_file.h"

namespace nephos {

// Returns 1 where a voxel is cloud and 0 elsewhere: in a bool grid where it is active and true, in a mask grid where it is active, in a
// fog volume where its value, of the file's own type, is above the threshold. Of a threshold below 0, which inactive voxels are above,
// a fog volume is returned as it is. Without options.grid it is `cld` if that is a mask, else `density`, else the first fog volume, else the first mask.
// Voxels along the axes that are as long as they are wide are those of the file, whatever their height (level_height_m). Others
// that are no cubes have the value of the nearest one, with a note: means of neighbours would be cloud beside a cloud. All else
// is that of load_density().
LoadedDensity load_mask(const std::filesystem::path& path, double threshold = 0,
                        const VdbReadOptions& options = {});

}  // namespace nephos
