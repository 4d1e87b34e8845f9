// SPDX-License-Identifier: Apache-2.0
#pragma once

// Whether the runs of a plan fit into memory, asked before the first of them.

#include "study/sweep_plan.h"

namespace nephos {

// Throws Error(usage) that names both figures, and the values of the run that takes most, unless so many workers have memory
// for a run each. Precondition: workers >= 1.
void require_memory_for(const SweepPlan& plan, int workers);

}  // namespace nephos
