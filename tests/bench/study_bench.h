// SPDX-License-Identifier: Apache-2.0
#pragma once

// What studies cost beside the steps that they need: statistics of a step, of clouds, and a whole run of a sweep.

#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// On one thread; some ten seconds in all.
std::vector<BenchRow> study_rows();

}  // namespace nephos::bench
