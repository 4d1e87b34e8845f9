// SPDX-License-Identifier: Apache-2.0
#pragma once

// Draws statistics of the points of a sweep as curves. Each function returns HTML, empty where there is nothing to draw.

#include <string>

#include "study/report/report_data.h"

namespace nephos::report {

// Draws the statistics along an axis of the sweep, with 95 % intervals.
std::string along_axis(const ReportData& data, std::size_t axis);

// Draws the mean cloud fraction of each level, against height.
std::string profiles(const ReportData& data);

// Draws the distribution of cloud sizes, with the range of the exponents and a table of both.
std::string sizes(const ReportData& data);

// Draws cover over time: the mean of the replicates, within their envelope. Its data stand beside each figure as JSON, for
// the script that makes them zoom.
std::string series(const ReportData& data);

}  // namespace nephos::report
