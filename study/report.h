// SPDX-License-Identifier: Apache-2.0
#pragma once

// Shows a sweep as one HTML file that needs no network: what was run, what went wrong first, regimes, statistics along the
// axes, profiles, sizes of clouds, parallel coordinates, series, pictures of the last states, and for every run the command
// that repeats it. Figures are inline SVG and need no script; with scripts series zoom (uPlot, in the file). The policy in
// its head forbids browsers to load anything.

#include <filesystem>
#include <string>
#include <string_view>

#include "study/records.h"
#include "study/sweep_plan.h"

namespace nephos {

// Begins every page: what begins otherwise is no report.
inline constexpr std::string_view kReportBeginning =
    "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; "
    "style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\n"
    "<meta name=\"viewport\" content=\"width=device-width\">\n";

// Returns the page: a function of its arguments and of the version of nephos, so equal sweeps have equal bytes, whoever ran
// them, where and in which order. Large sweeps are drawn in part, and say so. Throws Error(io) when series cannot be read.
std::string report_page(const SweepPlan& plan, const Records& records);

// Writes report_page() atomically. Throws Error(io).
void write_report(const SweepPlan& plan, const Records& records, const std::filesystem::path& path);

}  // namespace nephos
