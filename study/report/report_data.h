// SPDX-License-Identifier: Apache-2.0
#pragma once

// Gathers what the parts of a report draw: the points of a sweep with their summaries and runs.

#include <cstddef>
#include <string>
#include <vector>

#include "study/records.h"
#include "study/report/svg.h"
#include "study/sweep_plan.h"
#include "study/tables.h"

#include "simulation/layer_simulation.h"

namespace nephos::report {

struct ReportPoint {
    PointSummary summary;
    std::vector<PlannedRun> runs;           // of each replicate
    std::vector<const RunRecord*> records;  // of the same runs; null where one is missing
    std::vector<std::string> labels;        // the values as figures show them (axis_labels())
    const PointMean& mean(std::string_view statistic) const;
    // Returns "field.background.ext=0.1", with a comma between axes; "the scene" of a sweep without axes.
    std::string name(const SweepPlan& plan) const;
    // Returns the same with the labels instead of the values.
    std::string short_name(const SweepPlan& plan) const;
};

struct ReportData {
    const SweepPlan& plan;
    const Records& records;
    AutomatonOptions lattice;  // that is measured, of the scene without values of axes
    std::vector<ReportPoint> points;
};

ReportData gather(const SweepPlan& plan, const Records& records);

// Returns the lattice that is measured at a point.
AutomatonOptions lattice_of(const ReportData& data, const ReportPoint& point);

// Returns labels of the values of an axis: numbers with as few digits as tell them apart, at least 3 and at most `most`; words
// without quotes.
std::vector<std::string> axis_labels(const std::vector<std::string>& values, int most = 17);

// Returns the keys of an axis as the title of a figure's axis: "field.background.{act,hum}" of two that move together.
std::string axis_title(const Axis& axis);

// An axis of the sweep as one of figures, with the value of each point on it.
struct SweepAxis {
    PlotAxis plot;
    std::vector<double> values;
};
SweepAxis sweep_axis(const ReportData& data, std::size_t axis);

// Returns the number of a point's value on each axis of a grid.
std::vector<std::size_t> grid_place(const SweepPlan& plan, std::uint64_t point);

// Returns at most `most` of the numbers below `count`, evenly apart, the first and the last among them.
std::vector<std::size_t> evenly(std::size_t count, std::size_t most);

// Returns "12 of 400 points, evenly apart", or nothing where all are drawn.
std::string choice_text(std::size_t drawn, std::size_t of);

// Returns a value and half its 95 % interval, "0.302 +- 0.004"; a dash without a mean.
std::string value_text(const PointMean& mean);

std::string_view colour_of(Regime regime);
// Returns the regime of most of the runs; of equals the first of the list.
Regime main_regime(const PointSummary& summary);
// Returns true where the mean needs care: none, an interval wider than a tenth of it to either side, or errors that differ.
bool is_doubtful(const PointSummary& summary);

// Returns whether the 95 % interval of cover is wider than a tenth of its mean to each side.
bool has_wide_interval(const PointSummary& summary);

// Wraps a drawing: <figure> with a caption, both HTML.
std::string figure(std::string_view drawing, std::string_view caption, std::string_view kind = {});

}  // namespace nephos::report
