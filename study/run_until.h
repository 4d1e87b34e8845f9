// SPDX-License-Identifier: Apache-2.0
#pragma once

// A run of statistics that goes on until a mean is exact enough.

#include <cstdint>
#include <filesystem>
#include <string>

#include "study/sweep_plan.h"

#include "simulation/run_folder.h"

namespace nephos {

// What the steps of a statistics.csv say so far.
struct SeriesReport {
    std::string regime;    // regime_name()
    double mean, error;    // NaN where the run is not steady
    bool reached = false;  // the error is small enough, or the run is dead
};

// Returns the mean of a statistic over the rows of a statistics.csv, and whether `stop` is reached. For cover, the
// fractions, base, top and edge; throws Error(usage) on one that needs clouds, Error(io) on a file without such rows.
SeriesReport series_report(const std::filesystem::path& statistics, const Scene& scene, const StopAt& stop);

struct UntilReport {
    RunReport run;  // of the last part
    SeriesReport series;
};

// Runs `settings` (statistics alone) for its scene's steps, and then half as many again and again, at most `max_steps`, until
// `stop` is reached. The steps of the scene grow with it; interrupted and called again with `resume`, it goes on with the same
// steps. Throws as run_scene().
UntilReport run_until(RunSettings settings, const StopAt& stop, std::uint64_t max_steps,
                      const RunObserver& observer);

}  // namespace nephos
