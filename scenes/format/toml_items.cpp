// SPDX-License-Identifier: Apache-2.0
#include "scenes/format/toml_items.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <iterator>

namespace nephos {
namespace {

using Form = TomlNode::Form;
constexpr std::size_t kNone = std::string_view::npos;

// Returns the base of an integer with a prefix; 10 for all else.
int base_of(std::string_view number) {
    const std::string_view prefix = number.substr(0, 2);
    return prefix == "0x" ? 16 : prefix == "0o" ? 8 : prefix == "0b" ? 2 : 10;
}

// Returns the number that a value of TOML is, if it is one below 2^53.
std::optional<double> number_of(std::string_view value) {
    std::string plain;
    for (const char c : value)
        if (c != '_') plain += c;
    if (plain.starts_with('+')) plain.erase(0, 1);
    const int base = base_of(plain);
    const char *const begin = plain.data() + (base == 10 ? 0 : 2), *const end = plain.data() + plain.size();
    double number = 0;
    std::uint64_t whole = 0;
    const auto parsed =
        base == 10 ? std::from_chars(begin, end, number) : std::from_chars(begin, end, whole, base);
    if (base != 10) number = double(whole);
    constexpr double kLargestWhole = 9007199254740992;
    if (parsed.ec != std::errc() || parsed.ptr != end || !(std::abs(number) < kLargestWhole))
        return std::nullopt;
    return number;
}

// Returns whether two values are written alike or, of up to 2^53, as the same number: `1.0e3` stays where 1000 is set.
bool is_same_number(std::string_view a, std::string_view b) {
    if (a == b) return true;
    const std::optional<double> first = number_of(a);
    return first && first == number_of(b) && std::signbit(*first) == std::signbit(*number_of(b));
}

// Returns whether what a key or an item has is left where it is set to `by`.
bool stays(std::string_view was, std::string_view by, NumberForm form) {
    const bool is_integer = base_of(was) != 10 || was.find_first_of(".eEnf") == kNone;
    const bool may_stay = form == NumberForm::any || is_integer;
    return may_stay && is_same_number(was, by);
}

// Returns the offset of the comma after an element when a comment lies between them; otherwise kNone.
std::size_t comma_behind_comment(std::string_view text, std::size_t end) {
    bool comment = false;
    for (std::size_t at = end;;) {
        at = text.find_first_not_of(" \t\r\n", at);
        if (at == kNone) return kNone;
        if (text[at] != '#') return comment && text[at] == ',' ? at : kNone;
        comment = true;
        at = text.find('\n', at);
        if (at == kNone) return kNone;
    }
}

// Returns whether nothing but blanks stands before `at` on its line.
bool begins_line(std::string_view text, std::size_t at) {
    const std::size_t newline = at == 0 ? kNone : text.rfind('\n', at - 1);
    const std::size_t begin = newline == kNone ? 0 : newline + 1;
    return text.substr(begin, at - begin).find_first_not_of(" \t") == kNone;
}

// Returns the offset after the newline when only blanks and a comment follow on the line; otherwise kNone.
std::size_t rest_of_line(std::string_view text, std::size_t at) {
    const std::size_t next = std::min(text.find_first_not_of(" \t\r", at), text.size());
    if (next < text.size() && text[next] != '\n' && text[next] != '#') return kNone;
    const std::size_t newline = text.find('\n', next);
    return newline == kNone ? text.size() : newline + 1;
}

// Takes an item or a key with braces around out of its list, with one comma.
Change without_item(std::string_view text, const TextRegion& item, std::optional<std::size_t> end_before,
                    std::optional<std::size_t> next_begin) {
    const std::size_t comma = after_comma(text, item.end);
    const std::size_t line = rest_of_line(text, comma);
    if (begins_line(text, item.begin) && line != kNone) {
        const std::size_t newline = item.begin == 0 ? kNone : text.rfind('\n', item.begin - 1);
        return {{newline == kNone ? 0 : newline + 1, line}, ""};
    }
    if (next_begin) {
        const std::size_t to = std::min(text.find_first_not_of(" \t", comma), *next_begin);
        return {{item.begin, to}, ""};
    }
    const bool same_line =
        end_before && text.substr(*end_before, item.begin - *end_before).find_first_of("\n#") == kNone;
    return {{same_line ? *end_before : item.begin, same_line ? item.end : comma}, ""};
}

}  // namespace

std::vector<Change> replaced_value(std::string_view text, const TomlNode& node, std::string_view value,
                                   NumberForm form) {
    const auto text_of = [&](const TextRegion& region) {
        return text.substr(region.begin, region.end - region.begin);
    };
    if (node.form == Form::value && stays(text_of(node.value), value, form)) return {};
    if (node.form != Form::array || !value.starts_with('[')) return {{node.value, std::string(value)}};
    const std::string whole = "v = " + std::string(value);
    const TomlNode parsed = toml_tree(whole);
    const std::vector<TomlNode>& items = parsed.find("v")->items;
    if (items.empty() || items.size() != node.items.size()) return {{node.value, std::string(value)}};
    std::vector<Change> changes;
    for (std::size_t n = 0; n < items.size(); ++n) {
        const TextRegion was = node.items[n].value, now = items[n].value;
        const std::string by = whole.substr(now.begin, now.end - now.begin);
        if (!stays(text_of(was), by, form)) changes.push_back({was, by});
    }
    return changes;
}

std::vector<Change> removed_element(std::string_view text, const TomlNode& array, std::size_t index) {
    const TextRegion item = array.items[index].value;
    if (const std::size_t comma = comma_behind_comment(text, item.end); comma != kNone)
        return {{item, ""}, {{comma, comma + 1}, ""}};  // the comment stays
    std::optional<std::size_t> before, next;
    if (index > 0) before = array.items[index - 1].value.end;
    if (index + 1 < array.items.size()) next = array.items[index + 1].value.begin;
    return {without_item(text, item, before, next)};
}

std::vector<Change> added_behind(std::string_view text, const TextRegion& other, const std::string& item) {
    const std::size_t comma = after_comma(text, other.end), line = rest_of_line(text, comma);
    if (!begins_line(text, other.begin) || line == kNone || comma_behind_comment(text, other.end) != kNone)
        return {{{other.end, other.end}, ", " + item}};
    const bool has_comma = comma > other.end;
    std::vector<Change> changes;
    if (!has_comma) changes.push_back({{other.end, other.end}, ","});
    changes.push_back(
        {{line, line}, indent_at(text, other.begin) + item + (has_comma ? "," : "") + newline_of(text)});
    return changes;
}

// Like added_behind().
Change added_before(std::string_view text, const TextRegion& other, const std::string& item) {
    if (!begins_line(text, other.begin)) return {{other.begin, other.begin}, item + ", "};
    return {{other.begin, other.begin}, item + "," + newline_of(text) + indent_at(text, other.begin)};
}

std::optional<std::vector<std::size_t>> common_items(const std::vector<std::string_view>& was,
                                                     const std::vector<std::string_view>& now,
                                                     NumberForm form) {
    constexpr std::size_t kMostPairs = 4'000'000;
    if (was.size() * now.size() > kMostPairs) return std::nullopt;
    const std::size_t width = now.size() + 1;
    std::vector<std::uint16_t> longest((was.size() + 1) * width, 0);  // of the rests
    for (std::size_t i = was.size(); i-- > 0;) {
        for (std::size_t k = now.size(); k-- > 0;) {
            const std::size_t at = i * width + k;
            longest[at] = stays(was[i], now[k], form) ? std::uint16_t(longest[at + width + 1] + 1)
                                                      : std::max(longest[at + width], longest[at + 1]);
        }
    }
    std::vector<std::size_t> found(was.size(), kNone);
    for (std::size_t i = 0, k = 0; i < was.size() && k < now.size();) {
        const std::size_t at = i * width + k;
        if (stays(was[i], now[k], form))
            found[i++] = k++;
        else if (longest[at + width] >= longest[at + 1])
            ++i;
        else
            ++k;
    }
    return found;
}

}  // namespace nephos
