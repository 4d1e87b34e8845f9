// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// Speed of a step against memcpy, the NumPy twin, one thread, and itself without determinism. `source` is the
// root of the source tree (for the twin and the scenes), `programs` the folder of the benchmark's programs.
std::vector<BenchRow> automaton_rows(const std::filesystem::path& source,
                                     const std::filesystem::path& programs);

}  // namespace nephos::bench
