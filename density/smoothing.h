// SPDX-License-Identifier: Apache-2.0
#pragma once

// Stage 1 of D (docs/sources.md): bits to density, the weighted space-time mean
//
//     q(i,j,k,t) = 1/W  sum w(i',j',k',t') cld(i+i', j+j', k+k', t+t')
//
// over |i'| <= i0, |j'| <= j0, |k'| <= k0, |t'| <= t0,
//
// with W the sum of the weights of all cells of the window, at every step that was given. Weights are a
// product of one integer kernel per axis (kernel_weights), so sums are exact whatever the order, and
//
//     q = min(1, float(sum) * r),   r = 1 / float(W) rounded towards 1 or above
//
// is 1 exactly where every cell of the window is cloud (for W > 2^24: all but a fraction of 2^-24), and above
// 0 exactly where at least one is. Beyond an open boundary cells are 0, so density falls towards it; a
// periodic axis wraps.
//
// The result does not depend on the number of threads or the instruction set. Functions are thread-safe and
// use the oneTBB arena that they are called in.

#include <cstdint>
#include <span>
#include <vector>

#include "automaton/lattice.h"
#include "density/density_grid.h"
#include "density/options.h"

namespace nephos {

// One step of the automaton inside the time window. All planes of a call have the same extent.
struct TimedPlane {
    BitPlaneView cld;
    int step_offset = 0;  // t', -t0..t0; each value at most once
};

// Returns the weights w(-radius) .. w(radius) of one axis, 2 * radius + 1 integers above 0:
// box 1; tent radius + 1 - |n|; gaussian max(1, round(64 exp(-(n/s)^2 / 2))), s = (radius + 0.5) / 2.
// Throws Error(usage) when radius is outside 0..16.
std::vector<std::uint32_t> kernel_weights(SmoothingKernel kernel, int radius);

// Returns q as a sparse grid; placement.cell_size_m is the cell's edge.
// Throws Error(usage) when a radius is outside 0..16, when there is no plane, when planes differ in extent,
// or when an offset is outside the window or given twice.
DensityGrid smooth(std::span<const TimedPlane> planes, const SmoothingOptions& options,
                   const Placement& placement, const Boundaries& boundaries);

// Interpolates linearly in time: each voxel is a + (b - a) * fraction (D: frames between steps). Throws
// Error(usage) when extents or placements differ, or when fraction is outside 0..1.
DensityGrid mix(const DensityGrid& a, const DensityGrid& b, double fraction);

}  // namespace nephos
