// SPDX-License-Identifier: Apache-2.0
#pragma once

// Conversion of a node of the document to the value of a key, with its checks (not installed).

#include <string>

#include "scenes/format/schema.h"

namespace nephos {

// Reads `node` into `value` by the description `key`; `path` names the key in messages. Reports problems, and
// then leaves the value unchanged. For every kind but table and tables.
void read_value(Document& document, const Key& key, const Node& node, const std::string& path, void* value);

// Parses the text form of a seed, decimal or hexadecimal after "0x". Returns false when it is neither, or too
// large.
bool parse_seed(std::string_view text, std::uint64_t& seed);

}  // namespace nephos
