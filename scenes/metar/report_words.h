// SPDX-License-Identifier: Apache-2.0
#pragma once

// The words of a report or forecast with their places, and errors that point at one of them. Pure and thread-safe.

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/metar/metar.h"

namespace nephos {

struct ReportWord {
    std::string text;
    std::size_t column = 0;  // of its first character in ReportWords::text, from 0
};

struct ReportWords {
    std::string text;  // blanks joined, without the `=` at the end
    std::vector<ReportWord> words;
};

// Splits a text at blanks and ends of lines. Throws Error(usage) on characters that reports do not have, and on words behind
// the `=` that ends a report.
ReportWords words_of(std::string_view text);

// Throws Error(usage): the word `at`, or that the text ends early where it has so many words only; what was expected; and, if
// it is not far longer than reports are, the text with a caret.
[[noreturn]] void fail_at(const ReportWords& words, std::size_t at, const std::string& expected);

// Returns the words from `first` on and before `end`, with blanks between them.
std::string joined(const ReportWords& words, std::size_t first, std::size_t end);

bool all_digits(std::string_view text);  // false of an empty one
int number(std::string_view text);       // of at most nine digits
std::string padded(int value, std::size_t width);  // with zeros in front: "07"

bool is_aerodrome(std::string_view word);  // four capital letters or digits
bool is_interval(std::string_view word);  // "2112/2218": days and hours

// Reads the groups of one period of a forecast, the words from `first` on and before `end`: wind, visibility, weather and
// clouds as in a report, and those that only forecasts have. Throws and warns as parse_metar().
Metar parse_groups(const ReportWords& words, std::size_t first, std::size_t end, bool lenient);

}  // namespace nephos
