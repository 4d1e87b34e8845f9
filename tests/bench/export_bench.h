// SPDX-License-Identifier: Apache-2.0
#pragma once

// Encoding of dense voxels, checksums, and reports.

#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

std::vector<BenchRow> export_bench_rows();

}  // namespace nephos::bench
