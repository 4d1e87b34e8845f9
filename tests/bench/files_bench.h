// SPDX-License-Identifier: Apache-2.0
#pragma once

// The 96 frames of cumulus.toml in the files of other programs, and their verification.

#include <filesystem>
#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// Writes a run of `source`/scenes/cumulus.toml and its exports below the folder for temporary files, and removes them.
std::vector<BenchRow> files_rows(const std::filesystem::path& source);

}  // namespace nephos::bench
