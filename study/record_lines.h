// SPDX-License-Identifier: Apache-2.0
#pragma once

// The lines of a shard: a run as an object of JSON that ends with the XXH3-128 of what stands before it. Private to study/.

#include <cstdint>
#include <string>
#include <string_view>

#include "study/records.h"
#include <nlohmann/json.hpp>

namespace nephos {

// Returns whether a line, without its newline, is a record that is as it was written.
bool is_whole_record(std::string_view line);

// Returns whether a line ends as records do, whatever its hash is.
bool ends_as_record(std::string_view line);

// Returns the record of a whole line. Throws nlohmann::json::exception where it is not of a run, Error(io) on an unknown
// regime.
RunRecord record_of(const nlohmann::ordered_json& json);

// Returns the XXH3-128 of a text, 32 hexadecimal digits.
std::string hash_text(std::string_view text);

}  // namespace nephos
