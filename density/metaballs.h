// SPDX-License-Identifier: Apache-2.0
#pragma once

// Stage 2 of D: the continuous density between cells. Every cell with q > 0 carries a metaball of effective
// radius R, whose field falls from 1 at the centre to 0 at R (Wyvill; Nishita):
//
//     f(a) = 1 - 22/9 a^2 + 17/9 a^4 - 4/9 a^6,   a = distance / R
//
// Two normalisations, for two uses:
// - density_at() and resample() divide by the sum of f over all lattice points in reach, cloud or not:
//   D(x) = sum q f / sum f. Both sums run in the same order, so a saturated neighbourhood gives 1 exactly,
//   everywhere.
// - a renderer that adds up metaballs has no such sum at hand. It scales every metaball by
//   metaball_normalisation(R): then sum q f has the mean q in a uniform region, with a ripple around it that
//   is at most 2.2 % at R = 2 voxel edges, 0.5 % at 3 (and -59 % .. +23 % at 1, where metaballs hardly
//   overlap).
//
// A periodic axis repeats the grid, as in smoothing: the same q near both of its faces, the same D at both.
// Beyond the faces of an open axis q is 0, and D falls towards them.
//
// Functions are pure and thread-safe.

#include <vector>

#include "automaton/lattice.h"
#include "density/density_grid.h"

namespace nephos {

// Radii that every function here takes, in voxel edges of the grid: below 1 a point could lie in no metaball.
inline constexpr double kMinMetaballRadius = 1.0;
inline constexpr double kMaxMetaballRadius = 8.0;
// Voxels per cell and axis that resample() makes at most.
inline constexpr int kMaxRefine = 8;

struct Metaball {
    float x, y, z;  // centre, world metres
    float radius;   // effective radius R, metres
    float density;  // q of its voxel, above 0
    bool operator==(const Metaball&) const = default;
};

// f above; a >= 0. 0 from a = 1 on.
double metaball_field(double a);

// The integral of f along the straight line that passes the centre at distance b R, in units of R; 0 from b =
// 1 on. Closed form with h = sqrt(1 - b^2) (half the chord).
double metaball_line_integral(double b);

// One cell's volume over the integral of f over its ball: 2835 / (736 pi R^3), R in voxel edges. With it, the
// extinction extinction_per_m * metaball_normalisation(R) * sum q f along a ray through a saturated region is
// extinction_per_m on average.
double metaball_normalisation(double radius_cells);

// One metaball per voxel with q > 0: blocks of 8x8x8 voxels by z, y, x, and inside a block x fastest.
// The same order for the same voxels, however the grid came about.
// Throws Error(usage) when the radius is out of range.
std::vector<Metaball> metaballs(const DensityGrid& grid, double radius_cells);

// D at any point of the world, images of the grid along periodic axes included; 0 far from all cloud. Throws
// as metaballs().
double density_at(const DensityGrid& grid, const Vec3& position_m, double radius_cells,
                  const Boundaries& boundaries = {});

// D sampled at the centres of voxels `refine` times smaller than the grid's. Throws Error(usage) when
// refine is outside 1..8, the radius is out of range, or the result would have more than 2^31 - 1 voxels on
// an axis.
DensityGrid resample(const DensityGrid& grid, int refine, double radius_cells,
                     const Boundaries& boundaries = {});

}  // namespace nephos
