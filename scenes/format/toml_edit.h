// SPDX-License-Identifier: Apache-2.0
#pragma once

// Changes of a scene's text that leave everything else of it as it stands: comments, order, blanks, line ends, the form
// of numbers. A text goes in, a text comes out; both are TOML.
//
//     std::string text = ...;
//     text = with_value(text, text_path("sun.elevation_deg"), "12.5");
//     text = with_new_element(text, text_path("layer[0].rain.placed"), {{"x_m", "0"}, {"y_m", "500"}});
//
// Functions throw Error(usage) when the path leads through something that is neither table nor array, or to an element
// that is not there. Pure.

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "scenes/format/toml_items.h"
#include "scenes/format/toml_tree.h"

namespace nephos {

// One step down: by name, or into an array by an index from 0.
struct TextStep {
    std::string name;  // empty: by index
    std::size_t index = 0;
    bool operator==(const TextStep&) const = default;
};
using TextPath = std::vector<TextStep>;

// Reads a path such as "wind[0].levels[1].height_m"; throws Error(usage) when it is none.
TextPath text_path(std::string_view path);
std::string path_text(const TextPath& path);

// Returns the node at a path; null when it is not there.
const TomlNode* find_node(const TomlNode& root, const TextPath& path);

// Sets a key to a value, which is TOML on one line. A key that is not there is added: to its table after the last key,
// or in a new section at the end. Of an array only the items change that differ, come or go: comments between the others stay. Those of
// one as long are taken by their place.
std::string with_value(std::string_view text, const TextPath& path, std::string_view value,
                       NumberForm form = NumberForm::any);

// Removes a key with its line, a table with all of its sections, or an element of an array; of a section also the
// comment directly above it. Returns the text as it is when there is nothing at the path.
std::string without(std::string_view text, const TextPath& path);

// A key and its value as TOML.
using TextEntry = std::pair<std::string, std::string>;

// Adds an element to an array of tables, which is made when it is not there; behind all others, or before element
// `before` and the comment directly above that. It has the form of the others: [[name]], or within the array's brackets.
std::string with_new_element(std::string_view text, const TextPath& array, std::span<const TextEntry> entries,
                             std::optional<std::size_t> before = {});

// Adds a copy of an element after it.
std::string with_copied_element(std::string_view text, const TextPath& array, std::size_t index);

}  // namespace nephos
