// SPDX-License-Identifier: Apache-2.0
#pragma once

// What it costs to make density out of bits, against copying floats and against OpenVDB's own tools.

#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// On one thread; a few seconds. Throws std::runtime_error when the two sides of a row do not agree on the
// result.
std::vector<BenchRow> density_bench_rows();

}  // namespace nephos::bench
