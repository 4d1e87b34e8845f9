// SPDX-License-Identifier: Apache-2.0
#pragma once

// Small helpers for text: UTF-8, numbers and quoting in messages, files of a user. Independent of the locale.

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/text.h"

namespace nephos {

// Returns the offset of the first byte that is not valid UTF-8; text.size() if there is none.
std::size_t find_invalid_utf8(std::string_view text);

// Returns the width of a character in columns of a terminal: 0 (combining), 1 or 2 (East Asian wide, emoji).
int display_width(char32_t code);

// Replaces control characters but tabs, and invalid bytes, by U+FFFD.
std::string printable(std::string_view text);

// Returns printable(text), cut to `limit` characters with an ellipsis.
std::string shortened(std::string_view text, std::size_t limit = 60);

// Returns the shortest decimal of number_text() (core/text.h) as a TOML float: always with a point, an
// exponent or a word.
std::string toml_number(double value);

// Returns a TOML basic string with its quotes.
std::string toml_string(std::string_view text);

// Returns a name as a key of TOML: as it is where it may be bare, as toml_string() otherwise.
std::string toml_key(std::string_view name);

// Returns the text between two marks: enclosed("cells", '`') is "`cells`".
std::string enclosed(std::string_view text, char mark);

// Returns the path of an item: indexed("wind", 2) is "wind[2]".
std::string indexed(std::string_view path, std::size_t index);

// Returns the items as a list: "a, b or c".
std::string joined(const std::vector<std::string>& items, std::string_view last_separator = " or ");

// Returns at most the first `most_bytes` + 1 bytes of a file, so that the caller can detect a larger one.
// Throws Error(io) naming the path, and the kind of file that it should be, when it is a folder or cannot be read.
std::string read_text_file(const std::filesystem::path& path, std::size_t most_bytes,
                           std::string_view kind = "scene");

}  // namespace nephos
