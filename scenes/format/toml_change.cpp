// SPDX-License-Identifier: Apache-2.0
#include "scenes/format/toml_change.h"

#include <algorithm>

namespace nephos {
namespace {

constexpr std::size_t kNone = std::string_view::npos;

}  // namespace

std::string applied(std::string_view text, std::vector<Change> changes) {
    std::ranges::stable_sort(changes, {}, [](const Change& change) { return change.region.begin; });
    std::string out;
    std::size_t at = 0;
    for (const Change& change : changes) {
        out += text.substr(at, std::max(at, change.region.begin) - at);
        out += change.by;
        at = std::max(at, change.region.end);
    }
    return out += text.substr(at);
}

std::string newline_of(std::string_view text) {
    const std::size_t newline = text.find('\n');
    return newline != kNone && newline > 0 && text[newline - 1] == '\r' ? "\r\n" : "\n";
}

std::string indent_at(std::string_view text, std::size_t at) {
    const std::size_t newline = at == 0 ? kNone : text.rfind('\n', at - 1);
    const std::size_t begin = newline == kNone ? 0 : newline + 1;
    const std::size_t first = std::min(text.find_first_not_of(" \t", begin), text.size());
    return std::string(text.substr(begin, std::min(first, at) - begin));
}

std::size_t after_comma(std::string_view text, std::size_t end) {
    const std::size_t next = text.find_first_not_of(" \t\r\n", end);
    return next != kNone && text[next] == ',' ? next + 1 : end;
}

}  // namespace nephos
