// SPDX-License-Identifier: Apache-2.0
#pragma once

// What a researcher waits for at the command line: its start, sweeps, tables and reports of many runs.

#include <filesystem>
#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// Runs `command`, the program `nephos`, on docs/research/fair.toml of `source` and on a small lattice; some two minutes on two
// free cores, most of them for 10,000 runs. Throws std::runtime_error where it fails.
std::vector<BenchRow> study_command_rows(const std::filesystem::path& source,
                                         const std::filesystem::path& command);

}  // namespace nephos::bench
