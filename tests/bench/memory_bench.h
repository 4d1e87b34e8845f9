// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// Peak memory of `nephos run large.toml --no-render` for its first three frames, against three times its bit planes
// plus the leaves of its density; and of `nephos export` of one of them. The columns are MiB, not ms. `command` is the nephos
// program.
std::vector<BenchRow> memory_rows(const std::filesystem::path& source, const std::filesystem::path& command);

}  // namespace nephos::bench
