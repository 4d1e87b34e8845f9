// SPDX-License-Identifier: Apache-2.0
#pragma once

// From a node of the document to the value of a key, with its checks. Internal to scenes/.

#include <string>

#include "scenes/format/schema.h"

namespace nephos {

// Reads `node` into `value` as `key` says; `path` names the key in messages. On a problem, which is reported,
// the value stays as it was. For every kind but table and tables.
void read_value(Document& document, const Key& key, const Node& node, const std::string& path, void* value);

// The number of the text form of a seed: decimal, or hexadecimal after "0x"; false when it is neither or too
// large.
bool parse_seed(std::string_view text, std::uint64_t& seed);

}  // namespace nephos
