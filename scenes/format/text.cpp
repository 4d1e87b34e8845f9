// SPDX-License-Identifier: Apache-2.0
#include "scenes/format/text.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

#include "core/descriptor.h"
#include "core/error.h"

namespace nephos {
std::size_t find_invalid_utf8(std::string_view text) {
    std::size_t offset = 0;
    while (offset < text.size()) {
        const Character character = character_at(text, offset);
        if (!character.valid) return offset;
        offset += character.bytes.size();
    }
    return text.size();
}

int display_width(char32_t code) {
    const auto in = [code](char32_t low, char32_t high) { return code >= low && code <= high; };
    if (in(0x300, 0x36F) || in(0x200B, 0x200F) || in(0x20D0, 0x20FF) || in(0xFE00, 0xFE0F)) return 0;
    if (in(0x1100, 0x115F) || in(0x2E80, 0xA4CF) || in(0xAC00, 0xD7A3) || in(0xF900, 0xFAFF)) return 2;
    if (in(0xFE30, 0xFE6F) || in(0xFF00, 0xFF60) || in(0x1F300, 0x1FAFF) || in(0x20000, 0x3FFFD)) return 2;
    return 1;
}

std::string printable(std::string_view text) {
    std::string out;
    for (std::size_t offset = 0; offset < text.size();) {
        const Character character = character_at(text, offset);
        const bool shown =
            character.valid && (character.code == '\t' || !is_terminal_control(character.code));
        out += shown ? character.bytes : std::string_view("\xEF\xBF\xBD");
        offset += character.bytes.size();
    }
    return out;
}

std::string shortened(std::string_view text, std::size_t limit) {
    std::size_t offset = 0;
    for (std::size_t n = 0; n < limit && offset < text.size(); ++n)
        offset += character_at(text, offset).bytes.size();
    std::string out = printable(text.substr(0, offset));
    if (offset < text.size()) out += "...";
    return out;
}

std::string toml_number(double value) {
    std::string text = number_text(value);
    if (text.find_first_of(".en") == std::string::npos) text += ".0";
    return text;
}

std::string toml_string(std::string_view text) {
    constexpr char kHex[] = "0123456789ABCDEF";
    std::string out = "\"";
    for (const char c : text) {
        const auto byte = static_cast<unsigned char>(c);
        if (c == '"' || c == '\\') {
            out += '\\';
            out += c;
        } else if (byte < 0x20 || byte == 0x7F) {
            out += "\\u00";
            out += kHex[byte >> 4];
            out += kHex[byte & 15];
        } else {
            out += c;
        }
    }
    return out + '"';
}

std::string toml_key(std::string_view name) {
    constexpr std::string_view kBare = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-";
    const bool bare = !name.empty() && name.find_first_not_of(kBare) == name.npos;
    return bare ? std::string(name) : toml_string(name);
}

std::string enclosed(std::string_view text, char mark) {
    std::string out(1, mark);
    out += text;
    out += mark;
    return out;
}

std::string indexed(std::string_view path, std::size_t index) {
    std::string out(path);
    out += '[';
    out += std::to_string(index);
    out += ']';
    return out;
}

std::string joined(const std::vector<std::string>& items, std::string_view last_separator) {
    std::string out;
    for (std::size_t n = 0; n < items.size(); ++n) {
        if (n > 0) out += n + 1 == items.size() ? last_separator : std::string_view(", ");
        out += items[n];
    }
    return out;
}

std::string read_text_file(const std::filesystem::path& path, std::size_t most_bytes, std::string_view kind) {
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored)) {
        throw Error(ErrorCode::io,
                    path.string() + ": is a folder, expected a " + std::string(kind) + " in TOML");
    }
    if (is_named_pipe(path)) {
        throw Error(ErrorCode::io,
                    path.string() + ": is a named pipe, expected a " + std::string(kind) + " in TOML");
    }
    errno = 0;
    std::ifstream file(path, std::ios::binary);
    const auto failed = [&] {
        const std::string reason = errno != 0 ? std::strerror(errno) : "unknown error";
        return Error(ErrorCode::io, path.string() + ": cannot read the " + std::string(kind) + ": " + reason);
    };
    if (!file) throw failed();
    // In parts: zeros for the largest scene took longer than all else of reading one, for each file of models.
    std::string text;
    std::array<char, 16384> part{};
    while (file && text.size() <= most_bytes) {
        file.read(part.data(), std::streamsize(std::min(part.size(), most_bytes + 1 - text.size())));
        text.append(part.data(), std::size_t(file.gcount()));
    }
    if (file.bad()) throw failed();
    return text;
}

}  // namespace nephos
