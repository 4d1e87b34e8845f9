// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// Particles of rain: their places, and pictures of them; one more on a Vulkan device where there is one.
std::vector<BenchRow> rain_rows();

}  // namespace nephos::bench
