// SPDX-License-Identifier: Apache-2.0
#include "core/text.h"

#include <charconv>
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

}  // namespace nephos
