// SPDX-License-Identifier: Apache-2.0
#include "core/text.h"

#include <charconv>
#include <cmath>
#include <iterator>

namespace nephos {

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

}  // namespace nephos
