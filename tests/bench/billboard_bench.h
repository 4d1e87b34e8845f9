// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// T's clouds drawn directly as billboards.
std::vector<BenchRow> billboard_rows();

}  // namespace nephos::bench
