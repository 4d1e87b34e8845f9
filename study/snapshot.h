// SPDX-License-Identifier: Apache-2.0
#pragma once

// Measures the clouds of one state: what the runs of a study and the masks of others have in common.

#include <array>
#include <string_view>

#include "statistics/cloud_sizes.h"
#include "statistics/cloud_statistics.h"
#include "statistics/series.h"

#include "automaton/lattice.h"

namespace nephos {

struct Snapshot {
    // clouds_per_km2, cloud_area_m2, correlation_length_m, overlap, as kStatistics has them; NaN without value.
    std::array<double, 4> values;
    CloudSizes sizes;
};

// `cell_size_m` is that of the columns. Thread-safe.
Snapshot take_snapshot(const BitPlaneView& cld, const Boundaries& boundaries, double cell_size_m,
                       const SizeRange& range);

// Returns the length of the cloud edge per area, km per km2.
double edge_per_km(double perimeter_m, const Extent& extent, double cell_size_m);

// Returns size_exponent, size_exponent_line or fractal_dimension of the clouds of all snapshots, with the error of the fit.
SeriesMean size_statistic(std::string_view name, const CloudSizes& sizes);

}  // namespace nephos
