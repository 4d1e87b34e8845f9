// SPDX-License-Identifier: Apache-2.0
#pragma once

// How cloud lies in space: vertical overlap of levels, and 2-point correlation of the shadow.

#include <vector>

#include "statistics/cloud_statistics.h"

#include "automaton/lattice.h"

namespace nephos {

// Overlap of levels that are `distance` levels apart (Hogan and Illingworth, Q. J. R. Meteorol. Soc. 126, 2000): with f, g
// the covers of two levels and C that of both together,
//
//     a = (C - C_random) / (C_max - C_random),   C_max = max(f, g),   C_random = f + g - f g
//
// 1 is maximum, 0 random overlap; negative is less overlap than at random. Pairs with a clear or overcast level, where a is
// not defined, are left out.
struct LevelOverlap {
    int distance = 1;  // in levels
    double mean = 0;   // of a over the pairs of this distance
    int pairs = 0;     // that have a value; mean is NaN without any
};

// Returns the overlap for the distances 1 to nz - 1. Thread-safe.
std::vector<LevelOverlap> level_overlaps(const BitPlaneView& cld);

// Returns the mean overlap of neighbouring levels, level_overlaps() at distance 1 alone; NaN where no pair has a value.
double mean_overlap_of_neighbours(const BitPlaneView& cld);

// Returns the decorrelation length z0 of mean(dz) = exp(-dz / z0), least squares through the logarithm of the means above
// 0.05, weighted by their pairs, in metres; NaN with fewer than two such means or where the overlap does not fall.
double overlap_length_m(const std::vector<LevelOverlap>& overlaps, double cell_size_m);

// 2-point correlation of the shadow S: covariance at a distance of r columns over the variance,
//
//     rho(r) = (mean of S(i, j) S(i + r, j) and of S(i, j) S(i, j + r) - C^2) / (C - C^2)
//
// Periodic sides wrap around; at open ones the mean is over the pairs inside, with C that of the whole shadow.
struct Correlation {
    int distance = 1;  // columns
    double value = 0;  // rho; NaN where the shadow is clear or overcast
};

// Returns rho at r = 1, 2, 3, 4, 6, 8, 12, 16 ... up to half the shorter side. Thread-safe.
std::vector<Correlation> shadow_correlation(const BitPlaneView& shadow, const Boundaries& boundaries);

// Return the distance in metres at which rho falls below 1/e, linear between the distances; NaN where it never does. Of a
// shadow rho is computed no farther than that.
double correlation_length_m(const std::vector<Correlation>& correlation, double cell_size_m);
double correlation_length_m(const BitPlaneView& shadow, const Boundaries& boundaries, double cell_size_m);

}  // namespace nephos
