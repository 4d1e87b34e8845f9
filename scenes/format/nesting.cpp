// SPDX-License-Identifier: Apache-2.0
#include "scenes/format/nesting.h"

#include <algorithm>

namespace nephos {
namespace {

// Offset after the string that starts at `offset` with a quote.
std::size_t after_string(std::string_view text, std::size_t offset) {
    const char quote = text[offset];
    const std::string_view triple = quote == '"' ? "\"\"\"" : "'''";
    const bool multi_line = text.substr(offset, 3) == triple;
    std::size_t at = offset + (multi_line ? 3 : 1);
    while (at < text.size()) {
        const char c = text[at];
        if (c == '\\' && quote == '"') {
            at += 2;
        } else if (multi_line && text.substr(at, 3) == triple) {
            at += 3;
            // Up to two quotes may stand directly before the closing three.
            for (int n = 0; n < 2 && at < text.size() && text[at] == quote; ++n) ++at;
            return at;
        } else if (!multi_line && c == quote) {
            return at + 1;
        } else if (!multi_line && c == '\n') {
            return at;
        } else {
            ++at;
        }
    }
    return text.size();
}

bool continues_key(char c) {
    const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
    return letter || (c >= '0' && c <= '9') || c == '_' || c == '-' || c == ' ' || c == '\t';
}

}  // namespace

std::optional<NestingProblem> find_excessive_nesting(std::string_view text) {
    int depth = 0, dots = 0;
    std::size_t dotted_keys = 0, values = 0;
    for (std::size_t at = 0; at < text.size();) {
        const char c = text[at];
        if (c == '"' || c == '\'') {
            at = after_string(text, at);
            continue;
        }
        if (c == '#') {
            at = std::min(text.find('\n', at), text.size());
            continue;
        }
        if (c == '.' && ++dots >= kMaxKeyParts) {
            return NestingProblem{at, "a key with more than " + std::to_string(kMaxKeyParts) + " parts"};
        }
        if (c == '=' && dots > 0 && ++dotted_keys > kMaxDottedKeys) {
            return NestingProblem{at, "more than " + std::to_string(kMaxDottedKeys) + " dotted keys"};
        }
        const bool opens = c == '[' || c == '{';
        if ((opens || c == ',' || c == '=') && ++values > kMaxValues) {
            return NestingProblem{at, "more than " + std::to_string(kMaxValues) + " values"};
        }
        if (opens) ++depth;
        if ((c == ']' || c == '}') && depth > 0) --depth;
        if (depth > kMaxBracketDepth) {
            return NestingProblem{
                at, "values nested deeper than " + std::to_string(kMaxBracketDepth) + " levels"};
        }
        if (c != '.' && !continues_key(c)) dots = 0;
        ++at;
    }
    return std::nullopt;
}

}  // namespace nephos
