// SPDX-License-Identifier: Apache-2.0
#pragma once

// Keys and values of axes as text: one text for all ways of writing the same. Private to study/.

#include <string>
#include <string_view>
#include <vector>

namespace nephos {

// Returns a key as all ways of writing it have in common: " a[00] " is "a[0]".
std::string canonical_key(std::string_view key);

// Returns the paths of the tables and arrays that a canonical key is in, outermost first: of "a.b[0].c" these are "a", "a.b"
// and "a.b[0]". Where one of them has a value, too, their order decides.
std::vector<std::string> outer_keys(std::string_view key);

// Returns "`KEY` is no key of a scene: WHY" of a canonical key that --set would not take as one; empty where it would.
std::string no_key_text(std::string_view key);
inline constexpr std::string_view kExpectedKey =
    "expected such as field.background.ext or wind[0].levels[1].height_m";

// Returns one text for one value: "0.10" is 0.1, a word without quotes gets them, "[1,2]" is "[1, 2]". What is no value
// stays as it is, and whoever reads the scene with it says why. `of_text`: of keys that take text, as the name of a file:
// "007" is a text then, and not 7.
std::string canonical_value(const std::string& value, bool of_text = false);

// Returns whether all keys of an axis take text.
bool take_text(const std::vector<std::string>& keys);

// Returns whether a value is an array or a table.
bool is_compound(std::string_view value);

}  // namespace nephos
