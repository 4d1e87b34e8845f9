// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// Light shafts and fog. `source`: root of the source tree, for its scenes.
std::vector<BenchRow> air_rows(const std::filesystem::path& source);

}  // namespace nephos::bench
