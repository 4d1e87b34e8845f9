// SPDX-License-Identifier: Apache-2.0
#pragma once

// Merges density grids of different placements and voxel sizes into one: the layers of a sky in one file.
//
// The common box has the smallest voxel size of all (of equal ones, the first grid's), lies in whole voxels
// from that grid's origin, and is the smallest such box around all grids. A grid whose voxels coincide with
// those of the common box is copied bit by bit; any other is resampled by trilinear interpolation between its
// voxels' centres. Beyond an open boundary voxels count as 0; along a periodic axis interpolation wraps
// around, and the grid ends sharply at its sides. Where grids overlap their densities add up, as extinction
// does, clamped to 1.
//
// The results do not depend on the number of threads. Functions are pure and thread-safe.

#include <span>

#include "density/density_grid.h"

namespace nephos {

// Extent and placement of a grid whose voxels need not exist yet.
struct GridBox {
    Extent extent;
    Placement placement;
    bool operator==(const GridBox&) const = default;
};

// Returns the common box. Throws Error(usage) when `boxes` is empty, or when the result would have more than
// 2^31 - 1 voxels on an axis.
GridBox common_box(std::span<const GridBox> boxes);

// Returns the sum of all grids in their common box; a single grid unchanged. `boundaries` has one element per
// grid, or none where all are open. Throws as common_box(), and Error(usage) on another number of boundaries.
DensityGrid combine(std::span<const DensityGrid> grids, std::span<const Boundaries> boundaries = {});

// Returns the grid with every value multiplied by `factor`, above 0 and at most 1; Error(usage) otherwise.
DensityGrid scaled(const DensityGrid& grid, double factor);

}  // namespace nephos
