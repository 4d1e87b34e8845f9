// SPDX-License-Identifier: Apache-2.0
#include "study/toml_table.h"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

#include "core/text.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

constexpr std::size_t kMaxFileBytes = 8u << 20;

// Returns the first date or time in a node, null where there is none. Of these the tree has no text, and no key of a scene
// takes one.
const Node* date_in(const Node& node) {
    if (node.kind == Node::Kind::date) return &node;
    for (const Node& item : node.items)
        if (const Node* date = date_in(item)) return date;
    for (const Entry& entry : node.entries)
        if (const Node* date = date_in(entry.value)) return date;
    return nullptr;
}

std::string value_text(const Node& node);

// Returns a table between braces, its keys sorted.
std::string table_text(const Node& node) {
    std::vector<const Entry*> sorted;
    for (const Entry& entry : node.entries) sorted.push_back(&entry);
    std::ranges::sort(sorted, {}, [](const Entry* entry) { return std::string_view(entry->name); });
    std::vector<std::string> items;
    for (const Entry* entry : sorted)
        items.push_back(toml_key(entry->name) + " = " + value_text(entry->value));
    return "{" + joined(items, ", ") + "}";
}

// Returns a node as TOML on one line. Recursion is bounded by the parser. Precondition: date_in() finds nothing in it.
std::string value_text(const Node& node) {
    switch (node.kind) {
        case Node::Kind::boolean:
            return node.boolean ? "true" : "false";
        case Node::Kind::integer:
            return std::to_string(node.integer);
        case Node::Kind::number:
            return number_text(node.number == 0 ? 0.0 : node.number);  // one zero only
        case Node::Kind::text:
            return toml_string(node.text);
        case Node::Kind::array: {
            std::vector<std::string> items;
            for (const Node& item : node.items) items.push_back(value_text(item));
            return "[" + joined(items, ", ") + "]";
        }
        case Node::Kind::table:
            return table_text(node);
        case Node::Kind::date:
            break;
    }
    throw std::logic_error("a date has no text");
}

// " from 0 to 1"; ends that only say that a number is finite, or above 0, as words.
std::string range_text(double min, double max) {
    using Limits = std::numeric_limits<double>;
    const std::string low = min == Limits::min()      ? " above 0"
                            : min == Limits::lowest() ? ""
                                                      : " from " + number_text(min);
    const std::string high =
        max == Limits::max() ? "" : (low.empty() ? " up to " : " to ") + number_text(max);
    return low.starts_with(" from") && high.empty() ? low + " upwards" : low + high;
}

}  // namespace

TomlTable::TomlTable(Document& document, const Node& node, std::string path)
    : document_(document), node_(node), path_(std::move(path)) {}

TomlTable::~TomlTable() {
    std::vector<std::string_view> known(asked_.begin(), asked_.end());
    for (const Entry& entry : node_.entries) {
        if (document_.is_full()) break;
        if (std::ranges::count(asked_, entry.name) > 0) continue;
        const std::string_view closest = closest_word(entry.name, known);
        std::string expected = closest.empty() ? "expected one of: " + joined(asked_)
                                               : fmt::format("did you mean `{}`?", closest);
        document_.report(entry.place, fmt::format("unknown key `{}`", path_of(shortened(entry.name))),
                         std::move(expected));
    }
}

const Entry* TomlTable::find(std::string_view key) {
    if (std::ranges::count(asked_, key) == 0) asked_.emplace_back(key);
    return node_.find(key);
}

std::string TomlTable::path_of(const std::string& key) const {
    return path_.empty() ? key : path_ + "." + key;
}

void TomlTable::wrong_kind(const Entry& entry, const std::string& expected) {
    document_.report(entry.value.place,
                     fmt::format("`{}` is {}", path_of(entry.name), kind_name(entry.value.kind)),
                     "expected " + expected);
}

void TomlTable::report(const std::string& key, const std::string& message, const std::string& expected) {
    const Entry* entry = find(key);
    document_.report(entry ? entry->value.place : node_.place, message, expected);
}

void TomlTable::report(Problem problem) {
    if (!document_.is_full()) document_.problems.push_back(std::move(problem));
}

bool TomlTable::has(std::string_view key) { return find(key) != nullptr; }

std::optional<std::string> TomlTable::text(const std::string& key) {
    const Entry* entry = find(key);
    if (entry == nullptr) return std::nullopt;
    if (entry->value.kind == Node::Kind::text) return entry->value.text;
    wrong_kind(*entry, "a text");
    return std::nullopt;
}

std::optional<double> TomlTable::number(const std::string& key, double min, double max) {
    const Entry* entry = find(key);
    if (entry == nullptr) return std::nullopt;
    const bool whole = entry->value.kind == Node::Kind::integer;
    const double value = whole ? double(entry->value.integer) : entry->value.number;
    const std::string expected = "a number" + range_text(min, max);
    if (!whole && entry->value.kind != Node::Kind::number) {
        wrong_kind(*entry, expected);
    } else if (!(value >= min && value <= max)) {
        document_.report(entry->value.place, fmt::format("`{}` is {}", path_of(key), number_text(value)),
                         "expected " + expected);
    } else {
        return value;
    }
    return std::nullopt;
}

std::optional<std::uint64_t> TomlTable::integer(const std::string& key, std::uint64_t min,
                                                std::uint64_t max) {
    const Entry* entry = find(key);
    if (entry == nullptr) return std::nullopt;
    const std::string expected = fmt::format("a whole number from {} to {}", min, max);
    if (entry->value.kind != Node::Kind::integer) {
        wrong_kind(*entry, expected);
    } else if (entry->value.integer < 0 || std::uint64_t(entry->value.integer) < min ||
               std::uint64_t(entry->value.integer) > max) {
        document_.report(entry->value.place, fmt::format("`{}` is {}", path_of(key), entry->value.integer),
                         "expected " + expected);
    } else {
        return std::uint64_t(entry->value.integer);
    }
    return std::nullopt;
}

std::optional<bool> TomlTable::flag(const std::string& key) {
    const Entry* entry = find(key);
    if (entry == nullptr) return std::nullopt;
    if (entry->value.kind == Node::Kind::boolean) return entry->value.boolean;
    wrong_kind(*entry, "true or false");
    return std::nullopt;
}

std::optional<std::size_t> TomlTable::word(const std::string& key,
                                           const std::vector<std::string_view>& words) {
    const std::optional<std::string> value = text(key);
    if (!value) return std::nullopt;
    const auto found = std::ranges::find(words, *value);
    if (found != words.end()) return std::size_t(found - words.begin());
    const std::string_view closest = closest_word(*value, words);
    report(key, fmt::format("`{}` is \"{}\"", path_of(key), shortened(*value)),
           closest.empty() ? fmt::format("expected {}", fmt::join(words, ", "))
                           : fmt::format("did you mean \"{}\"?", closest));
    return std::nullopt;
}

std::vector<std::string> TomlTable::texts(const std::string& key) {
    const Entry* entry = find(key);
    std::vector<std::string> all;
    if (entry == nullptr) return all;
    if (entry->value.kind == Node::Kind::text) return {entry->value.text};
    if (entry->value.kind != Node::Kind::array) wrong_kind(*entry, "a text, or an array of texts");
    for (const Node& item : entry->value.items) {
        if (item.kind == Node::Kind::text) {
            all.push_back(item.text);
        } else {
            document_.report(item.place, fmt::format("`{}` holds {}", path_of(key), kind_name(item.kind)),
                             "expected texts");
        }
    }
    return all;
}

std::vector<std::string> TomlTable::values(const std::string& key) {
    const Entry* entry = find(key);
    std::vector<std::string> all;
    if (entry == nullptr) return all;
    if (entry->value.kind != Node::Kind::array) wrong_kind(*entry, "an array of values");
    for (const Node& item : entry->value.items) {
        if (const Node* date = date_in(item)) {
            document_.report(date->place, fmt::format("`{}` holds {}", path_of(key), kind_name(date->kind)),
                             "expected numbers, texts, words, or arrays or tables of them; a date is a text");
        } else {
            all.push_back(value_text(item));
        }
    }
    return all;
}

Place TomlTable::place(std::string_view key) {
    const Entry* entry = find(key);
    return entry ? entry->value.place : node_.place;
}

std::vector<Place> TomlTable::item_places(std::string_view key) {
    std::vector<Place> places;
    const Entry* entry = find(key);
    if (entry == nullptr) return places;
    if (entry->value.kind != Node::Kind::array) return {entry->value.place};
    for (const Node& item : entry->value.items) places.push_back(item.place);
    return places;
}

void TomlTable::table(const std::string& key, const std::function<void(TomlTable&)>& read) {
    const Entry* entry = find(key);
    if (entry == nullptr) return;
    if (entry->value.kind != Node::Kind::table) return wrong_kind(*entry, "a table");
    TomlTable inner(document_, entry->value, path_of(key));
    read(inner);
}

void TomlTable::tables(const std::string& key, const std::function<void(TomlTable&)>& read) {
    const Entry* entry = find(key);
    if (entry == nullptr) return;
    if (entry->value.kind != Node::Kind::array)
        return wrong_kind(*entry, fmt::format("tables, each under [[{}]]", key));
    for (std::size_t n = 0; n < entry->value.items.size() && !document_.is_full(); ++n) {
        const Node& item = entry->value.items[n];
        if (item.kind != Node::Kind::table) {
            document_.report(item.place,
                             fmt::format("`{}` is {}", indexed(path_of(key), n), kind_name(item.kind)),
                             "expected a table");
            continue;
        }
        TomlTable inner(document_, item, indexed(path_of(key), n));
        read(inner);
    }
}

std::optional<std::string> canonical_toml(std::string_view value) {
    Document document;
    const std::optional<Node> root =
        document.parse(document.add_origin({}, "v = " + std::string(value), false));
    if (!root || root->entries.size() != 1 || root->entries.front().name != "v") return std::nullopt;
    const Node& node = root->entries.front().value;
    if (date_in(node) != nullptr) return std::nullopt;
    return value_text(node);
}

void read_toml_text(std::string text, const std::string& label, const std::function<void(TomlTable&)>& read) {
    if (text.size() > kMaxFileBytes)
        throw Error(ErrorCode::usage, fmt::format("{}: is larger than {} bytes", label, kMaxFileBytes));
    Document document;
    const int origin = document.add_origin(label, std::move(text), true);
    if (const std::optional<Node> root = document.parse(origin)) {
        TomlTable table(document, *root, {});
        read(table);
    }
    if (document.is_full()) throw_problems(std::move(document.problems), label);
    if (!document.problems.empty()) throw SceneErrors(std::move(document.problems));
}

void read_toml_file(const std::filesystem::path& path, const std::function<void(TomlTable&)>& read,
                    std::string_view kind) {
    read_toml_text(read_text_file(path, kMaxFileBytes, kind), path.string(), read);
}

}  // namespace nephos
