// SPDX-License-Identifier: Apache-2.0
#pragma once

// The tables of a sweep: functions of its plan and its records alone, whatever made the records and in which order.

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "study/records.h"
#include "study/sweep_plan.h"

namespace nephos {

// A statistic of a point over its replicates.
struct PointMean {
    double mean, deviation;      // over the replicates; NaN unless every one of them has a value
    double error;                // between replicates: deviation / sqrt(n); NaN of one
    double low, high;            // 95 % interval by Student's t
    double error_within;         // what the errors within the runs make of the mean: sqrt(sum of squares) / n
    bool errors_differ = false;  // replicates in phase, or runs too short
};

// Returns whether the two errors of a mean differ 3-fold, and by more than the scatter of so few replicates explains: if the
// errors within the runs are right, (n - 1) (between / within)^2 is a chi-squared number of n - 1 degrees, and a value as
// far off has a probability below 1 %. Of three replicates alone, one in ten is 3-fold too small by chance.
bool errors_differ(double between, double within, int replicates);

struct PointSummary {
    std::uint64_t point = 0;
    std::vector<std::string> values;
    std::uint32_t runs = 0, missing = 0, failed = 0;
    std::array<std::uint32_t, 6> regimes{};  // runs of each Regime
    std::array<PointMean, kStatistics.size()> statistics;
};

// Returns the summary of a point. Of a point with a run that is missing, failed or not steady nothing is averaged.
PointSummary summarise(const SweepPlan& plan, const Records& records, std::uint64_t point);

// The runs that are done in a table, and that writing it again would lose.
struct LostRuns {
    std::uint64_t unreadable = 0;       // in no record, or in one of a failure
    std::uint64_t of_another_plan = 0;  // in a record, but of no run of the plan
};

// Compares DIR/runs.csv with a plan and its records; nothing is lost where it is not there. Throws Error(io) when the file is
// there and cannot be read.
LostRuns runs_lost(const SweepPlan& plan, const Records& records, const std::filesystem::path& folder);

// Writes DIR/runs.csv, points.csv, failures.csv, series.nc and manifest.json, of a plan with tracks also tracks.csv, each
// atomically; of another plan removes a tracks.csv that is there. Returns how many runs of the plan have no record. Throws Error(io).
std::uint64_t write_tables(const SweepPlan& plan, const Records& records,
                           const std::filesystem::path& folder);

}  // namespace nephos
