// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// The physical sky: tables, and the whole picture without clouds.
std::vector<BenchRow> atmosphere_rows();

}  // namespace nephos::bench
