// SPDX-License-Identifier: Apache-2.0
#pragma once

// What procedural veils cost, against copying floats, an automaton of as many cells, and noise from a
// texture.

#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// On one thread; a few seconds. Throws std::runtime_error when a side has no result.
std::vector<BenchRow> veil_bench_rows();

}  // namespace nephos::bench
