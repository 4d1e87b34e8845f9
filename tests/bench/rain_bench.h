// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// Particles of rain: their places, and a picture of them. Needs no Vulkan device.
std::vector<BenchRow> rain_rows();

}  // namespace nephos::bench
