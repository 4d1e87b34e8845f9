// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// Pictures of `source`/scenes/cumulus.toml by the graphics card that is best, or the device that NEPHOS_DEVICE names, beside
// those of the processor. Empty where there is no card and none is named.
std::vector<BenchRow> card_rows(const std::filesystem::path& source);

}  // namespace nephos::bench
