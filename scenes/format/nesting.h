// SPDX-License-Identifier: Apache-2.0
#pragma once

// A look at TOML text before the parser sees it. The parser and the destructors of its tree are recursive,
// and a dotted key makes a table for each dot, so that a small hostile file could exhaust the stack or the
// time.

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

// The first place where one of the limits is passed. Follows the grammar only as far as valid TOML goes; what
// comes after the first syntax error does not matter, because the parser never gets there. Linear in the
// text's length.
std::optional<NestingProblem> find_excessive_nesting(std::string_view text);

}  // namespace nephos
