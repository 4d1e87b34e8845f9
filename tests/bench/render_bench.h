// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// Pictures of clouds drawn as billboards; needs a Vulkan device.
std::vector<BenchRow> render_rows();

}  // namespace nephos::bench
