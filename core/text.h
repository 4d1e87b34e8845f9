// SPDX-License-Identifier: Apache-2.0
#pragma once

// Numbers as text, UTF-8, and text that is safe to show; independent of the locale of the program.

#include <cstddef>
#include <string>
#include <string_view>

namespace nephos {

// Formats a number with at most `digits` significant digits (1..17; 17 read back exactly): "0.25", "1e+20",
// "inf".
std::string number_text(double value, int digits);

// Returns the shortest decimal that reads back as the same double: "0.1", "40", "1e-07", "inf".
std::string number_text(double value);

// Formats an amount of memory with binary units and about three digits: "12 bytes", "3.2 GiB", "300 MiB".
std::string bytes_text(std::size_t bytes);

// One character of a text.
struct Character {
    char32_t code = 0;
    std::string_view bytes;  // its bytes in the text
    bool valid = true;       // false: a byte that is not UTF-8; code is then U+FFFD
};

// Decodes the character at byte `offset`, which must be inside the text.
Character character_at(std::string_view text, std::size_t offset);

// Returns true for the controls U+0000..1F and U+007F..9F, and for the characters that reorder or break the text around
// them (bidirectional overrides and isolates, line and paragraph separators).
bool is_terminal_control(char32_t code);

// Returns text that a terminal shows and never obeys: each character of is_terminal_control() becomes "\\u001b", its
// code in hexadecimal, as JSON and TOML have it; each byte that is no UTF-8 becomes "\\x9b". All else stays as it is,
// backslashes too. `kept` are control characters to leave alone.
std::string escaped(std::string_view text, std::string_view kept = {});

// Returns the text as one word of a POSIX shell: in quotes where it needs them.
std::string shell_word(const std::string& text);

}  // namespace nephos
