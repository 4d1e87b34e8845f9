// SPDX-License-Identifier: Apache-2.0
#pragma once

// What clouds cost: reproduction, light absorption, and a step of the two-layer sky of T's climate variation.

#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// Best of several runs each, on the calling thread; a few seconds in all.
std::vector<BenchRow> seeds_rows();

}  // namespace nephos::bench
