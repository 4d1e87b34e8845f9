// SPDX-License-Identifier: Apache-2.0
#pragma once

// Limits on TOML text, checked before it is parsed. The parser and the destructors of its tree are recursive,
// and a dotted key makes a table for each dot, so that a small hostile file could exhaust the stack or take
// hours (not installed).

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace nephos {

inline constexpr int kMaxBracketDepth = 32;            // arrays and inline tables within each other
inline constexpr int kMaxKeyParts = 32;                // a.b.c has three
inline constexpr std::size_t kMaxDottedKeys = 20'000;  // the parser's time grows with their square
inline constexpr std::size_t kMaxValues = 1'000'000;   // some hundred bytes of memory each

struct NestingProblem {
    std::size_t offset = 0;  // byte in the text
    std::string message;
};

// Returns the first violation of one of the limits. Follows the grammar of valid TOML up to the first syntax
// error, where the parser stops, too. Time is linear in the text's length. Pure.
std::optional<NestingProblem> find_excessive_nesting(std::string_view text);

}  // namespace nephos
