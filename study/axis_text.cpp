// SPDX-License-Identifier: Apache-2.0
#include "study/axis_text.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <optional>

#include "study/toml_table.h"
#include <fmt/format.h>

#include "core/text.h"
#include "scenes/format/override.h"
#include "scenes/format/schema.h"
#include "scenes/format/text.h"

namespace nephos {

namespace {

std::string canonical_number_or_word(const std::string& value) {
    if (value.empty() || value == "true" || value == "false") return value;
    if (std::string_view("\"'[{").find(value[0]) != std::string_view::npos)
        return canonical_toml(value).value_or(value);
    const bool has_plus = value[0] == '+' && value.size() > 1 && value[1] != '-';
    const char *begin = value.data() + has_plus, *end = value.data() + value.size();
    std::int64_t whole = 0;
    if (const auto read = std::from_chars(begin, end, whole); read.ec == std::errc() && read.ptr == end) {
        constexpr std::int64_t kExact = std::int64_t(1) << 53;
        if (whole < -kExact || whole > kExact)
            return fmt::format("{}", whole);  // a double may be another number
    }
    double number = 0;
    const auto [last, error] = std::from_chars(begin, end, number);
    if (error == std::errc() && last == end) return number_text(number == 0 ? 0.0 : number);  // one zero only
    // 0x10 and 1_000 are numbers of TOML, too.
    const bool may_be = value.find_first_not_of("0123456789abcdefABCDEFxob_.+-") == value.npos;
    const std::optional<std::string> other = may_be ? canonical_toml(value) : std::nullopt;
    if (other && *other != value) return canonical_number_or_word(*other);
    return toml_string(value);
}

}  // namespace

std::string canonical_value(const std::string& value, bool of_text) {
    std::string text = canonical_number_or_word(value);
    return of_text && !is_compound(text) && !text.starts_with('"') ? toml_string(value) : text;
}

bool take_text(const std::vector<std::string>& keys) {
    return !keys.empty() && std::ranges::all_of(keys, [](const std::string& name) {
        const Key* key = find_key(names_of_key(name));
        return key != nullptr && takes_text(*key);
    });
}

std::string no_key_text(std::string_view key) {
    const std::string problem = key_problem(key);
    return problem.empty() ? problem : fmt::format("`{}` is no key of a scene: {}", escaped(key), problem);
}

bool is_compound(std::string_view value) { return value.starts_with('[') || value.starts_with('{'); }

std::string canonical_key(std::string_view key) {
    constexpr std::string_view kBlank = " \t";
    const std::size_t first = key.find_first_not_of(kBlank);
    if (first == key.npos) return {};
    key = key.substr(first, key.find_last_not_of(kBlank) - first + 1);
    std::string text;
    for (std::size_t n = 0; n < key.size(); ++n) {
        const bool is_leading = key[n] == '0' && !text.empty() && text.back() == '[';
        if (is_leading && n + 1 < key.size() && key[n + 1] >= '0' && key[n + 1] <= '9') continue;
        text += key[n];
    }
    return text;
}

std::vector<std::string> outer_keys(std::string_view key) {
    std::vector<std::string> outer;
    for (std::size_t n = 1; n < key.size(); ++n)
        if (key[n] == '.' || key[n] == '[') outer.emplace_back(key.substr(0, n));
    return outer;
}

}  // namespace nephos
