// SPDX-License-Identifier: Apache-2.0
#pragma once

// Statistics of one state from its bits alone: counts of cells, cloud cover, vertical profile, cloud base and cloud top
// of the columns, length of the cloud edge. With b the bit of cld, S(i, j) = OR of b over k the shadow of the cloud seen
// from above, and N = nx ny columns:
//
//     cover            C   = sum of S / N
//     profile          f_k = sum of b over level k / N      (cloud_area_fraction_in_atmosphere_layer of CF)
//     base, top            of a column: the lower face of its lowest, the upper face of its highest cloud cell
//     edge                 pairs of neighbouring columns, east or north, one of them covered and one clear
//
// All are sums of integers: they do not depend on threads or vector width.

#include <cstdint>
#include <vector>

#include "automaton/lattice.h"

namespace nephos {

// Counts of the cloud of one state. Counts of several states may be added up.
struct CloudCounts {
    Extent extent;
    std::uint64_t cells = 0;    // cloud cells
    std::uint64_t columns = 0;  // with a cloud cell
    // Edges of cells between a covered and a clear column. Periodic sides wrap around; at open sides the edge of the box
    // does not count.
    std::uint64_t edges = 0;
    // Of level k, bottom to top: cloud cells; columns whose lowest cloud cell is there; whose highest.
    std::vector<std::uint64_t> level_cells, bases, tops;
};

// Returns the counts of a plane of cloud; `boundaries` of x and y matter. Thread-safe.
CloudCounts count_cloud(const BitPlaneView& cld, const Boundaries& boundaries);

// Returns the number of bits that are 1.
std::uint64_t count_cells(const BitPlaneView& plane);

// Returns the number of cells that are 1 before and 0 after, and makes the first plane like the second: with one step
// between, the cells of cloud that died. The mean lifetime of a cell in steps is the sum of cloud cells over the sum of
// deaths (Little's law), without any tracking, where no cell enters or leaves: not across open sides, and without wind.
// Throws Error(usage) when the planes differ in extent.
std::uint64_t count_deaths_and_replace(BitPlane& before, const BitPlaneView& after);

// Returns the shadow of the cloud, one level of the same rows.
BitPlane shadow_of(const BitPlaneView& cld);

// Selects the columns whose heights a quantile is taken over.
enum class CloudLimit { base, top };

// Return the mean of base or top over the columns with cloud, and the height that the fraction q of them lies below or
// at, both in metres above ground; NaN without cloud.
double mean_height_m(const CloudCounts& counts, CloudLimit limit, const Placement& placement);
double height_quantile_m(const CloudCounts& counts, CloudLimit limit, double q, const Placement& placement);

// What a row of statistics.csv holds of a state.
struct CloudStatistics {
    std::uint64_t hum = 0, act = 0, cld = 0;  // cells that are 1
    double cover = 0;         // cloud cover seen from above, 0..1: fraction of the columns with a cloud cell
    double base_m = 0;        // world z of the lower face of the lowest cloud cell; NaN without cloud
    double top_m = 0;         // world z of the upper face of the highest cloud cell; NaN without cloud
    double base_mean_m = 0;   // mean of the cloud base over the columns with cloud; NaN without cloud
    double top_mean_m = 0;    // mean of the cloud top over the columns with cloud; NaN without cloud
    double perimeter_m = 0;   // length of the edge of the shadow
    double mean_density = 0;  // mean of cld over all cells of the box
    // Fraction of the columns whose optical depth is above 1, what an observer calls cover; 0 where it is not computed.
    double optical_cover = 0;
};

// Returns the statistics of counted cloud; hum and act are 0.
CloudStatistics cloud_statistics(const CloudCounts& counts, const Placement& placement);

// Returns the statistics of one state. Throws Error(usage) when the planes differ in extent. Thread-safe.
CloudStatistics cloud_statistics(const BitPlaneView& hum, const BitPlaneView& act, const BitPlaneView& cld,
                                 const Placement& placement, const Boundaries& boundaries = {});

}  // namespace nephos
