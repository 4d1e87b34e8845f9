// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// Clouds with detail: preparation of a frame, and films as a run makes them but for their files.
std::vector<BenchRow> detail_rows(const std::filesystem::path& source);

}  // namespace nephos::bench
