// SPDX-License-Identifier: Apache-2.0
#pragma once

// A fit on disk. Its runs are those of sweeps, so that it goes on where it was stopped, and the same call again computes
// nothing:
//
//     DIR/wave-1 .. wave-3, proof   sweeps (sweep.h)
//     DIR/posterior.csv             1,000 equally likely points: a column a key
//     DIR/fit.json                  estimates, targets, directions
//     DIR/fitted (TOML)             the scene with the best parameters

#include <functional>
#include <optional>

#include "study/fit.h"
#include "study/sweep.h"

namespace nephos {

// Returns nothing when it was stopped. `progress` also tells the wave, 1 to 4. Throws as fit() and run_sweep().
std::optional<FitResult> run_fit(const FitOptions& options, const SweepJob& job,
                                 const std::function<void(int wave, const SweepProgress&)>& progress,
                                 const std::function<bool()>& stop);

// Returns how many runs failed, and where they are.
std::string failed_runs_text(const FitResult& result);

// Returns the result as text: a table of parameters, one of targets, and what the targets leave free.
std::string fit_text(const FitOptions& options, const FitResult& result);

}  // namespace nephos
