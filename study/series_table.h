// SPDX-License-Identifier: Apache-2.0
#pragma once

// series.nc of a sweep (docs/adr/0012-study-files.md): the series of every step of the runs that are done, in
// the order of the plan, with what the runs are.

#include <filesystem>

#include "study/records.h"
#include "study/sweep_plan.h"

namespace nephos {

// Writes the file atomically; its bytes are a function of plan and records alone. Returns false, and writes
// nothing, where no run is done. Throws Error(io), also of a series that cannot be read.
bool write_series_table(const SweepPlan& plan, const Records& records, const std::filesystem::path& path);

}  // namespace nephos
