// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "tests/bench/bench_row.h"

namespace nephos::bench {

// Pictures of `source`/scenes/cumulus.toml by a Vulkan device, the first that the loader finds or that
// NEPHOS_DEVICE names, beside those of the processor. Empty where there is none.
std::vector<BenchRow> card_rows(const std::filesystem::path& source);

}  // namespace nephos::bench
