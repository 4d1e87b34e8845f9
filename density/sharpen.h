// SPDX-License-Identifier: Apache-2.0
#pragma once

// Keeps the sharpness of density between steps of a simulation. The mean of two states is softer than either: clouds
// that differ are averaged, and each was interpolated (density/carry.h). Without this a sequence of frames breathes with
// the steps.
//
// Sharpness is the sum of the absolute differences of neighbours along x and along y, of each level (its total variation).
// A level m gets back what it has lost by unsharp masking with a gain of its own for each axis,
//
//     m + a (m - blur_x m) + b (m - blur_y m)      blur: means of three voxels with weights 1/4, 1/2, 1/4
//
// with a, b from one step of Newton's method for the sums that are wanted (within 0.3 % on clouds of the automaton),
// limited to 0..1. Values are cut at 0 and 1, and the level is scaled to the mass it had: nothing moves, and where there
// was nothing there is nothing.
//
// Results do not depend on the number of threads. Functions are pure and thread-safe.

#include <vector>

#include "core/vec.h"
#include "density/density_grid.h"

namespace nephos {

// Returns for each level the sums of the absolute differences of neighbours along x and along y. Periodic sides are
// neighbours of each other.
std::vector<Vec2> gradients_of(const DensityGrid& density, const Boundaries& boundaries);

// Returns the density with the sums `gradients` of each level, as near as the gains allow; levels that have them already
// stay as they are. Throws Error(usage) when the number of sums is not that of levels.
DensityGrid sharpened(const DensityGrid& density, const std::vector<Vec2>& gradients,
                      const Boundaries& boundaries);

}  // namespace nephos
