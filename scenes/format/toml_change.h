// SPDX-License-Identifier: Apache-2.0
#pragma once

// Changes of a text by bytes, and the places around them: what the edits of TOML (toml_edit.h, toml_items.h) are made of. Pure.

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/format/toml_tree.h"

namespace nephos {

// Replaces a region of a text.
struct Change {
    TextRegion region;
    std::string by;
};

// Returns the text with all changes made; of regions that overlap the first one counts.
std::string applied(std::string_view text, std::vector<Change> changes);

// Returns "\r\n" or "\n", as the first line of the text ends.
std::string newline_of(std::string_view text);

// Returns the blanks at the start of the line of `at`.
std::string indent_at(std::string_view text, std::size_t at);

// Returns where the comma after an item ends, without skipping a comment; the item's end where there is none.
std::size_t after_comma(std::string_view text, std::size_t end);

}  // namespace nephos
