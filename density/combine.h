// SPDX-License-Identifier: Apache-2.0
#pragma once

// Several density grids of different places and voxel sizes as one: the layers of a sky in one file.
//
// The common box has the smallest voxel size of all (of equal ones, the first grid's), lies in whole voxels
// from that grid's origin, and is the smallest such box around all grids. A grid whose voxels are those of
// the common box is copied bit by bit; any other is interpolated linearly between its voxels' centres. Beyond
// the sides of an open axis its voxels are 0; along a periodic axis the voxels at one side lie next to those
// at the other, and the grid ends sharply at its sides. Where grids overlap their densities add up, to 1 at
// most: extinction adds, and 1 is saturated.
//
// The results do not depend on the number of threads. Functions are pure and thread-safe.

#include <span>

#include "density/density_grid.h"

namespace nephos {

// Where a grid lies; its voxels need not exist yet.
struct GridBox {
    Extent extent;
    Placement placement;
    bool operator==(const GridBox&) const = default;
};

// The common box. Throws Error(usage) when there is no box, or when it would have more than 2^31 - 1 voxels
// on an axis.
GridBox common_box(std::span<const GridBox> boxes);

// All grids in their common box; a single one as it is. `boundaries` has one for each grid, or none where all
// are open. Throws as common_box(), and Error(usage) on another number of boundaries.
DensityGrid combine(std::span<const DensityGrid> grids, std::span<const Boundaries> boundaries = {});

// Every value times `factor`, which must be above 0 and at most 1.
DensityGrid scaled(const DensityGrid& grid, double factor);

}  // namespace nephos
