// SPDX-License-Identifier: Apache-2.0
#include "scenes/metar/report_words.h"

#include <algorithm>
#include <charconv>

#include "core/error.h"

namespace nephos {

bool all_digits(std::string_view text) {
    return !text.empty() && std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
}

int number(std::string_view text) {
    int value = 0;
    std::from_chars(text.data(), text.data() + text.size(), value);
    return value;
}

std::string padded(int value, std::size_t width) {
    const std::string text = std::to_string(value);
    return std::string(width - std::min(width, text.size()), '0') + text;
}

bool is_aerodrome(std::string_view word) {
    return word.size() == 4 &&
           std::ranges::all_of(word, [](char c) { return (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9'); });
}

bool is_interval(std::string_view word) {
    return word.size() == 9 && word[4] == '/' && all_digits(word.substr(0, 4)) && all_digits(word.substr(5));
}

ReportWords words_of(std::string_view text) {
    ReportWords found;
    std::size_t ended = std::string_view::npos;  // words in front of the first `=`
    for (std::size_t at = text.find_first_not_of(" \t\r\n"); at != text.npos;) {
        const std::size_t end = std::min(text.find_first_of(" \t\r\n", at), text.size());
        std::string_view word = text.substr(at, end - at);
        const bool last = word.ends_with('=');
        if (last) word.remove_suffix(1);
        if (!word.empty()) {
            if (!found.text.empty()) found.text += ' ';
            found.words.push_back({std::string(word), found.text.size()});
            found.text += word;
        }
        if (last) ended = std::min(ended, found.words.size());
        at = text.find_first_not_of(" \t\r\n", end);
    }
    for (std::size_t n = 0; n < found.words.size(); ++n)
        if (!std::ranges::all_of(found.words[n].text, [](char c) { return c > ' ' && c <= '~'; }))
            fail_at(found, n, "expected letters, digits and signs that a report has");
    if (ended < found.words.size()) fail_at(found, ended, "expected one report, which ends with `=`");
    return found;
}

void fail_at(const ReportWords& words, std::size_t at, const std::string& expected) {
    constexpr std::size_t kLongestWord = 60, kLongest = 1000;  // far longer than those of reports
    const bool done = at >= words.words.size();
    const std::size_t column =
        done ? words.text.size() + (words.text.empty() ? 0 : 1) : words.words[at].column;
    const std::size_t length = done ? 1 : words.words[at].text.size();
    std::string shown = done ? "" : words.words[at].text;
    if (shown.size() > kLongestWord) {
        std::size_t end = kLongestWord;
        while (end > 0 && (shown[end] & 0xC0) == 0x80) --end;  // within a character
        shown = shown.substr(0, end) + "...";
    }
    const std::string what = (done ? "the report ends early" : "`" + shown + "`") + ": " + expected;
    if (words.text.size() > kLongest) throw Error(ErrorCode::usage, what);
    throw Error(ErrorCode::usage,
                what + "\n  " + words.text + "\n  " + std::string(column, ' ') + std::string(length, '^'));
}

std::string joined(const ReportWords& words, std::size_t first, std::size_t end) {
    std::string text;
    for (std::size_t n = first; n < end; ++n) text += (text.empty() ? "" : " ") + words.words[n].text;
    return text;
}

}  // namespace nephos
