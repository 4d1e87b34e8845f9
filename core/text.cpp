// SPDX-License-Identifier: Apache-2.0
#include "core/text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>

namespace nephos {
namespace {

constexpr char32_t kReplacement = 0xFFFD;

void append_hex(std::string& out, std::string_view prefix, char32_t code, int digits) {
    out += prefix;
    for (int shift = 4 * (digits - 1); shift >= 0; shift -= 4) out += "0123456789abcdef"[code >> shift & 15];
}

}  // namespace

std::string number_text(double value, int digits) {
    char text[40];
    const auto end = std::to_chars(text, text + sizeof text, value, std::chars_format::general, digits);
    return std::string(text, end.ptr);
}

std::string bytes_text(std::size_t bytes) {
    constexpr const char* kUnits[] = {"bytes", "KiB", "MiB", "GiB", "TiB", "PiB", "EiB"};
    double amount = double(bytes);
    std::size_t unit = 0;
    while (amount >= 1024 && unit + 1 < std::size(kUnits)) {
        amount /= 1024;
        ++unit;
    }
    char text[40];
    const int decimals = unit > 0 && amount < 99.95 ? 1 : 0;
    const auto end = std::to_chars(text, text + sizeof text, amount, std::chars_format::fixed, decimals);
    return std::string(text, end.ptr) + " " + kUnits[unit];
}

std::string number_text(double value) {
    if (std::isnan(value)) return "nan";
    if (std::isinf(value)) return value > 0 ? "inf" : "-inf";
    constexpr double kLargestPlain = 1e15, kSmallestPlain = 1e-4;  // beyond, an exponent reads better
    const double size = std::abs(value);
    const bool plain = size < kLargestPlain && (size >= kSmallestPlain || size == 0);
    char buffer[32];
    char* const limit = buffer + sizeof buffer;
    const auto end = plain ? std::to_chars(buffer, limit, value, std::chars_format::fixed)
                           : std::to_chars(buffer, limit, value);
    return std::string(buffer, end.ptr);
}

Character character_at(std::string_view text, std::size_t offset) {
    const auto byte = [&](std::size_t n) { return static_cast<unsigned char>(text[offset + n]); };
    const Character invalid{kReplacement, text.substr(offset, 1), false};
    const unsigned first = byte(0);
    if (first < 0x80) return {first, text.substr(offset, 1), true};
    const int length = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
    if (first < 0xC2 || first > 0xF4 || text.size() - offset < std::size_t(length)) return invalid;
    char32_t code = first & (0xFFu >> (length + 1));
    for (int n = 1; n < length; ++n) {
        if ((byte(std::size_t(n)) & 0xC0) != 0x80) return invalid;
        code = (code << 6) | (byte(std::size_t(n)) & 0x3F);
    }
    constexpr char32_t kSmallest[] = {0, 0, 0x80, 0x800, 0x10000};
    const bool surrogate = code >= 0xD800 && code <= 0xDFFF;
    if (code < kSmallest[length] || code > 0x10FFFF || surrogate) return invalid;
    return {code, text.substr(offset, std::size_t(length)), true};
}

bool is_terminal_control(char32_t code) {
    const bool c0_or_c1 = code < 0x20 || (code >= 0x7F && code < 0xA0);
    const bool reorders_text = (code >= 0x202A && code <= 0x202E) || (code >= 0x2066 && code <= 0x2069);
    return c0_or_c1 || reorders_text || code == 0x2028 || code == 0x2029;
}

std::string escaped(std::string_view text, std::string_view kept) {
    std::string out;
    out.reserve(text.size());
    for (std::size_t offset = 0; offset < text.size();) {
        const Character character = character_at(text, offset);
        offset += character.bytes.size();
        if (!character.valid) {
            append_hex(out, "\\x", static_cast<unsigned char>(character.bytes.front()), 2);
        } else if (is_terminal_control(character.code) && kept.find(character.bytes) == kept.npos) {
            append_hex(out, "\\u", character.code, 4);
        } else {
            out += character.bytes;
        }
    }
    return out;
}

std::string shell_word(const std::string& text) {
    const bool plain = std::ranges::all_of(text, [](char c) {
        return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
               std::string_view("._-+=:/,").find(c) != std::string_view::npos;
    });
    if (plain && !text.empty()) return text;
    std::string word = "'";
    for (const char c : text) {
        if (c == '\'')
            word += "'\\''";
        else
            word += c;
    }
    return word + "'";
}

}  // namespace nephos
