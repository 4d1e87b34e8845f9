// SPDX-License-Identifier: Apache-2.0
#pragma once

// What an observer sees of a layer of clouds: its cover by optical depth along vertical columns, and where its mass lies.
// `cloud_cover` of the statistics counts columns with any cloud cell; this counts those that hide the sky behind them.

#include "density/density_grid.h"

namespace nephos {

struct OpticalColumns {
    double cover = 0;  // fraction of columns whose optical depth is above 1, 0..1
    // Optical depth of the median column among these; 0 without any.
    double median_depth = 0;
    // Median over these columns of the lowest height where density is above a tenth of the column's largest: what a
    // ceilometer reports. World z; NaN without any.
    double cloud_base_m = 0;
    double base_m = 0, top_m = 0;  // heights below which 5 and 95 % of all mass lie; NaN without any mass
    double mean_transmittance = 1;
};

// Returns the cover alone, without a dense copy of the grid. Extinction in 1/m where density is 1. Thread-safe; pure.
double optical_cover(const DensityGrid& density, double extinction_per_m);

// The same of all. Memory: a dense copy of the grid. Thread-safe; pure.
OpticalColumns optical_columns(const DensityGrid& density, double extinction_per_m);

}  // namespace nephos
