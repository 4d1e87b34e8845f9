// SPDX-License-Identifier: Apache-2.0
#pragma once

// Draws all points of a sweep at once. Each function returns HTML, empty where there is nothing to draw.

#include <string>

#include "study/report/report_data.h"

namespace nephos::report {

// Draws a cell for each point of a grid, colour by regime, hatched where the mean needs care; of other designs a dot for
// each point, over each pair of axes.
std::string regime_map(const ReportData& data);
std::string regime_legend();

// Draws a line a point through its values on all axes and its most telling statistics.
std::string parallel_coordinates(const ReportData& data);

// Shows the last state of a run of each point, from above.
std::string thumbnails(const ReportData& data);

}  // namespace nephos::report
