// SPDX-License-Identifier: Apache-2.0
#pragma once

// Statistics of a density grid that no automaton produced (a veil), in the terms of those of bit planes.

#include "statistics/cloud_statistics.h"

#include "density/density_grid.h"

namespace nephos {

// Returns the statistics of a density grid: voxels above 0 count as cloud, none as humid or active, and mean_density
// is the mean of the density. Its sides are open. Thread-safe; the result does not depend on the number of threads.
CloudStatistics cloud_statistics(const DensityGrid& density);

}  // namespace nephos
