// SPDX-License-Identifier: Apache-2.0
#pragma once

// Items of arrays in a text: they come, go and change beside the comments and the lines of the others. `array` is the array's node
// in the tree of `text`. Pure.

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/format/toml_change.h"
#include "scenes/format/toml_tree.h"

namespace nephos {

// The numbers that a key takes. One that is set to itself keeps its form: `1.0e3` where 1000 is set, but for integers, where
// 1 mends a `1.0`.
enum class NumberForm { any, integer };

// Replaces a value, of an array as long the items that differ.
std::vector<Change> replaced_value(std::string_view text, const TomlNode& node, std::string_view value,
                                   NumberForm form);

// Returns, for each item of an array, the place among `now` of the one that it is, or npos: the longest common sequence.
// Nothing for arrays that are so long that it takes too much time.
std::optional<std::vector<std::size_t>> common_items(const std::vector<std::string_view>& was,
                                                     const std::vector<std::string_view>& now,
                                                     NumberForm form);

// Add an item behind or before another one, in a line of its own where that one has one.
std::vector<Change> added_behind(std::string_view text, const TextRegion& other, const std::string& item);
Change added_before(std::string_view text, const TextRegion& other, const std::string& item);

// Removes an item with one comma; a comment between the two stays.
std::vector<Change> removed_element(std::string_view text, const TomlNode& array, std::size_t index);

}  // namespace nephos
