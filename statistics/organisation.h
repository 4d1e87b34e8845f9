// SPDX-License-Identifier: Apache-2.0
#pragma once

// Whether clouds stand at random, in clusters or in rows: indices of organisation, each beside its value for shadows of
// the same cover without any organisation. That null value is needed: of a random shadow with C = 0.3 Iorg is 0.24, not
// the 0.5 of random points, as clouds have a size and cannot stand inside each other; and 30 clouds scatter by 0.06.
//
//     Iorg  integral of F dG: F(r) the distribution of distances to the nearest neighbour, G(r) = 1 - exp(-n pi r^2)
//           that of n random points per area (Weger et al. 1992; Tompkins and Semie 2017); 0.5 random, above clustered
//     SCAI  1000 n D0 / (n_max L), n clouds, D0 the geometric mean of all distances, n_max half the columns, L the
//           diagonal of the box (Tobin, Bony and Roca 2012); low is organised; depends on the resolution
//     COP   mean over pairs of (sqrt(a) + sqrt(a')) / (d sqrt(pi)) (White et al. 2018); high is organised
//
// Distances are between centroids, along periodic axes to the nearest image.

#include <cstddef>
#include <cstdint>
#include <span>

#include "statistics/clouds.h"

namespace nephos {

struct Organisation {
    double iorg, scai, cop;  // NaN with fewer than two clouds
};

// SCAI and COP are means over all pairs up to this number of clouds, 5 * 10^7 of them; of more clouds they are means over
// as many pairs as kSampledPairs, drawn from Philox, the same for the same number of clouds: within 0.1 % of those over all.
inline constexpr std::size_t kMaxCloudsOfAllPairs = 10'000;
inline constexpr std::uint32_t kSampledPairs = 10'000'000;

// Returns the indices of 2-D clouds of a lattice; equal clouds give equal bits. Thread-safe.
Organisation organisation(std::span<const ConnectedCloud> clouds, const Extent& extent,
                          const Boundaries& boundaries);

// Returns a shadow whose columns are covered independently with the probability `cover`, from Philox: the null model.
// Equal arguments give equal bits.
BitPlane random_shadow(const Extent& extent, double cover, std::uint64_t seed, std::uint32_t number);

// The mean and the standard deviation of each index over those of `draws` random shadows of that cover that have two clouds
// or more; NaN where none has.
struct NullOrganisation {
    Organisation mean, deviation;
};
NullOrganisation null_organisation(const Extent& extent, const Boundaries& boundaries, double cover,
                                   int draws, std::uint64_t seed);

}  // namespace nephos
