// SPDX-License-Identifier: Apache-2.0
#pragma once

// Carries density with the wind by fractions of a voxel: levels of a grid are shifted horizontally, each by its own
// displacement, and two states that were carried to one moment are mixed. Without this a frame between two steps shows
// two copies of each cloud, which fade out here and in there.
//
// A level is interpolated along x and then along y by Lagrange's polynomial through six voxels (degree 5), which keeps
// features of three voxels and more within 3 % at any fraction, where linear interpolation softens them by a seventh. Each
// value is limited to the range of the two voxels that it lies between, so that nothing overshoots, nothing falls below 0
// and no voxel without cloud on either side gets any.
//
// The result does not depend on the number of threads. Functions are pure and thread-safe.

#include <span>
#include <vector>

#include "core/vec.h"
#include "density/density_grid.h"

namespace nephos {

// A state and the displacement of each of its levels, in voxels towards east and north; one for each level.
struct CarriedGrid {
    const DensityGrid* grid = nullptr;  // never null
    std::span<const Vec2> shift;
};

// Returns the state with level k moved by shift[k]. Beyond open sides there is no density, but the outermost voxels
// extend by one voxel, as nothing else is known of what flows in; periodic sides wrap. Without any shift returns the
// grid itself. Throws Error(usage) when the number of shifts is not that of levels, or a shift is not within 2^30.
DensityGrid carried(const CarriedGrid& state, const Boundaries& boundaries);

// Returns before + (after - before) * fraction of both states carried; where only one of them reaches, because the other
// flowed in or out through an open side, that one alone. Throws as carried() and mix().
DensityGrid carried_mix(const CarriedGrid& before, const CarriedGrid& after, double fraction,
                        const Boundaries& boundaries);

}  // namespace nephos
