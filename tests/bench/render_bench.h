// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// Pictures of clouds drawn as billboards and as metaballs; needs a Vulkan device. `data`: folder of the large
// test files, may be empty.
std::vector<BenchRow> render_rows(const std::filesystem::path& source, const std::filesystem::path& data);

}  // namespace nephos::bench
