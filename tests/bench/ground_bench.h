// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// What wet ground costs a step and a picture of 640x480 that shows nothing else, each against copying the
// bytes that it reads and writes. On all threads.
std::vector<BenchRow> ground_rows();

}  // namespace nephos::bench
