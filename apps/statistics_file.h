// SPDX-License-Identifier: Apache-2.0
#pragma once

// statistics.csv: one row a step, in the order of steps, without gaps. Numbers are written so that they read
// back exactly; a field without a value (base and top of no cloud) is empty.

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "apps/pipeline.h"

namespace nephos {

inline constexpr std::string_view kStatisticsHeader =
    "step,time_s,hum,act,cld,cloud_cover,base_m,top_m,mean_density,hash\n";

// A row with its newline.
std::string statistics_row(const StepResult& result);

// The header and the rows of the first `steps` steps of a file, later ones left out.
// Throws Error(io) when the file does not begin with exactly these.
std::string read_statistics(const std::filesystem::path& path, std::uint64_t steps);

// The hash in a row, with or without its newline.
std::string_view hash_in_row(std::string_view row);

}  // namespace nephos
