// SPDX-License-Identifier: Apache-2.0
#pragma once

// Stage 2 of D (docs/sources.md): the continuous density between cells. Every cell with q > 0 carries a
// metaball of effective radius R, whose field falls from 1 at the centre to 0 at R (Wyvill; Nishita):
//
//     f(a) = 1 - 22/9 a^2 + 17/9 a^4 - 4/9 a^6,   a = distance / R
//
// Two normalisations, for two uses:
// - resample() divides by the sum of f over all lattice points in reach, cloud or not:
//   D(x) = sum q f / sum f. Both sums run in the same order, so a saturated neighbourhood gives 1 exactly,
//   everywhere.
// - a renderer that adds up metaballs has no such sum at hand. It scales every metaball by
//   metaball_normalisation(R): then sum q f has the mean q in a uniform region, with a ripple around it of at
//   most 2.2 % at R = 2 voxel edges and 0.5 % at 3 (-59 % .. +23 % at 1, where metaballs hardly overlap).
//
// A periodic axis repeats the grid, as in smoothing: the same q near both of its faces, the same D at both.
// Beyond the faces of an open axis q is 0, and D falls towards them.
//
// Functions are pure and thread-safe.

#include <vector>

#include "automaton/lattice.h"
#include "density/density_grid.h"

namespace nephos {

// Range of the radius in voxel edges of the grid, for every function here: below 1 there would be points in
// no metaball.
inline constexpr double kMinMetaballRadius = 1.0;
inline constexpr double kMaxMetaballRadius = 8.0;
// Largest `refine` of resample(): voxels per cell and axis.
inline constexpr int kMaxRefine = 8;

// One metaball in world space: the splat that the renderer draws.
struct Metaball {
    float x, y, z;  // centre, world metres
    float radius;   // effective radius R, metres
    float density;  // q of its voxel, above 0
    bool operator==(const Metaball&) const = default;
};

// Returns f above for a >= 0; 0 from a = 1 on.
double metaball_field(double a);

// Returns the volume of one voxel divided by the volume integral of f: 2835 / (736 pi R^3), R in voxel edges.
// Then extinction_per_m * metaball_normalisation(R) * sum q f is extinction_per_m on average in a saturated
// region.
double metaball_normalisation(double radius_cells);

// Returns one metaball per voxel with q > 0, ordered by block of 8x8x8 voxels (by z, y, x) and inside a block
// x fastest, an order that depends on the voxels alone. Throws Error(usage) when the radius is out of range.
std::vector<Metaball> metaballs(const DensityGrid& grid, double radius_cells);

// Returns D sampled at the centres of voxels `refine` times smaller than the grid's, images of the grid along
// periodic axes included. Throws Error(usage) when
// refine is outside 1..8, the radius is out of range, or the result would have more than 2^31 - 1 voxels on
// an axis.
DensityGrid resample(const DensityGrid& grid, int refine, double radius_cells,
                     const Boundaries& boundaries = {});

}  // namespace nephos
