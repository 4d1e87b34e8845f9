// SPDX-License-Identifier: Apache-2.0
#pragma once

// Statistics of one step, for plots over time: numbers of humid, active and cloud cells, cloud cover, base
// and top.

#include <cstdint>

#include "automaton/lattice.h"
#include "density/density_grid.h"

namespace nephos {

struct CloudStatistics {
    std::uint64_t hum = 0, act = 0, cld = 0;  // cells that are 1
    double cover = 0;         // cloud cover seen from above, 0..1: fraction of the columns with a cloud cell
    double base_m = 0;        // world z of the lower face of the lowest cloud cell; NaN without cloud
    double top_m = 0;         // world z of the upper face of the highest cloud cell; NaN without cloud
    double mean_density = 0;  // mean of cld over all cells of the box
    // Fraction of the columns whose optical depth is above 1, what an observer calls cover; 0 where it is not computed.
    double optical_cover = 0;
};

// Returns the statistics of one state. Throws Error(usage) when the planes differ in extent. Thread-safe; the
// result does not depend on the number of threads.
CloudStatistics cloud_statistics(const BitPlaneView& hum, const BitPlaneView& act, const BitPlaneView& cld,
                                 const Placement& placement);

// Returns the statistics of a density grid that no automaton produced: voxels above 0 count as cloud, none as
// humid or active, and mean_density is the mean of the density. Thread-safe; the result does not depend on
// the number of threads.
CloudStatistics cloud_statistics(const DensityGrid& density);

}  // namespace nephos
