// SPDX-License-Identifier: Apache-2.0
#pragma once

// Items of arrays in a text: they come, go and change beside the comments and the lines of the others. Functions return changes, or
// the new text; `array` is the array's node in the tree of `text`. Pure.

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/format/toml_change.h"
#include "scenes/format/toml_edit.h"
#include "scenes/format/toml_tree.h"

namespace nephos {

// Replaces a value, of an array as long the items that differ.
std::vector<Change> replaced_value(std::string_view text, const TomlNode& node, std::string_view value,
                                   NumberForm form);

// Returns the text with items of an array more or less, and all else in it as it was, comments too; nothing where the array at
// `path` is to be as long as it was, where none of its items stays, or where it is so long that finding those takes too much time.
std::optional<std::string> with_items(std::string_view text, const TextPath& path, const TomlNode& array,
                                      std::string_view value, NumberForm form);

// Adds an item behind another one, in a line of its own where that one has one.
std::vector<Change> added_behind(std::string_view text, const TextRegion& other, const std::string& item);

// Removes an item with one comma; a comment between the two stays.
std::vector<Change> removed_element(std::string_view text, const TomlNode& array, std::size_t index);

// Returns where the comma after an item ends, without skipping a comment; the item's end where there is none.
std::size_t after_comma(std::string_view text, std::size_t end);

}  // namespace nephos
