// SPDX-License-Identifier: Apache-2.0
// The --set options: "key.path=value" on top of the scene file.

#include "scenes/format/override.h"

#include <charconv>

#include "scenes/format/document.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

// One step down the tree: into a table by name or into an array by index.
struct PathStep {
    std::string name;  // empty: by index
    std::size_t index = 0;
    int column = 1;  // where it stands in the option
};

struct ParsedPath {
    std::vector<PathStep> steps;
    std::size_t equals = 0;  // offset of '='
    int error_column = 0;    // 0: all is well
    std::string error;
};

bool is_key_character(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
}

// Reads "name[1][2].name=" from the start of the option.
ParsedPath parse_path(std::string_view option) {
    ParsedPath path;
    std::size_t at = 0;
    const auto failed = [&](std::string message) {
        path.error = std::move(message);
        path.error_column = int(at) + 1;
        return path;
    };
    constexpr std::size_t kMaxSteps = 64;
    while (path.steps.size() < kMaxSteps) {
        const std::size_t start = at;
        while (at < option.size() && is_key_character(option[at])) ++at;
        if (at == start)
            return failed(at == option.size() ? "the option has no `=`" : "expected the name of a key");
        path.steps.push_back({std::string(option.substr(start, at - start)), 0, int(start) + 1});
        while (at < option.size() && option[at] == '[') {
            const std::size_t digits = ++at;
            while (at < option.size() && option[at] >= '0' && option[at] <= '9') ++at;
            const bool complete = at > digits && at - digits <= 9 && at < option.size() && option[at] == ']';
            if (!complete) return failed("expected an index such as [0]");
            std::size_t index = 0;
            std::from_chars(option.data() + digits, option.data() + at, index);
            path.steps.push_back({{}, index, int(digits)});
            ++at;
        }
        const std::size_t equals = option.find_first_not_of(" \t", at);
        if (equals != std::string_view::npos && option[equals] == '=') {
            path.equals = equals;
            return path;
        }
        if (at == option.size()) return failed("the option has no `=`");
        if (option[at] != '.') return failed("expected `.`, `[` or `=` after a key");
        ++at;
    }
    return failed("the path is too long");
}

std::string_view trimmed(std::string_view text) {
    constexpr std::string_view kBlank = " \t";
    const std::size_t first = text.find_first_not_of(kBlank);
    if (first == std::string_view::npos) return {};
    return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

std::vector<std::string> names_on(const ParsedPath& path) {
    std::vector<std::string> names;
    for (const PathStep& step : path.steps) {
        if (!step.name.empty()) names.push_back(step.name);
    }
    return names;
}

std::string items_text(std::size_t count) {
    if (count == 0) return "it has no items";
    return "it has " + std::to_string(count) + (count == 1 ? " item" : " items") + ", counted from 0";
}

}  // namespace

std::string key_problem(std::string_view key) {
    const ParsedPath path = parse_path(std::string(key) + "=");
    if (path.error_column == 0 && path.equals == key.size()) return {};
    const std::size_t column = path.error_column > 0 ? std::size_t(path.error_column) : path.equals + 1;
    if (column > key.size()) return "it ends before its last name or index does";
    const std::string_view character = character_at(key, column - 1).bytes;
    return "its character " + std::to_string(column) + " is " + enclosed(character, '`');
}

std::string option_label(std::string_view option) { return "--set " + shortened(option, 100); }

std::vector<std::string> names_of_key(std::string_view key) {
    return names_on(parse_path(std::string(key) + "="));
}

std::optional<Node> Document::option_value(int index, std::size_t equals, const KeyForm& form) {
    const std::string_view option = origin(index).text;
    const std::string_view text = trimmed(option.substr(equals + 1));
    const bool bare = !text.empty() && std::string_view("\"'[{").find(text.front()) == std::string_view::npos;
    if (bare && form.takes_text) {
        Node value;
        value.kind = Node::Kind::text;
        value.text = text;
        value.place = {index, 1, int(text.data() - option.data()) + 1};
        if (find_invalid_utf8(text) == text.size()) return value;
        report(value.place, "not UTF-8 text");
        return std::nullopt;
    }
    // The path becomes blanks and one key, so that the columns of the value stay what they are.
    std::string over(equals - 1, ' ');
    over += 'v';
    over += option.substr(equals);
    std::optional<Node> parsed =
        parse_text(index, over, form.expected.empty() ? form.expected : "expected " + form.expected);
    if (!parsed) return std::nullopt;
    if (parsed->entries.size() == 1) return std::move(parsed->entries.front().value);
    report({index, 1, int(equals) + 2}, "the option holds more than one value");
    return std::nullopt;
}

void Document::set(const std::string& option, KeyForm (*describe)(const std::vector<std::string>& path)) {
    const int index = add_origin(option_label(option), option, false);
    const ParsedPath path = parse_path(origin(index).text);
    if (path.error_column > 0) {
        report({index, 1, path.error_column}, path.error, "expected --set key.path=value");
        return;
    }
    std::optional<Node> value = option_value(index, path.equals, describe(names_on(path)));
    if (!value) return;

    Node* node = &root;
    std::string reached;
    for (std::size_t n = 0; n < path.steps.size(); ++n) {
        const PathStep& step = path.steps[n];
        const Place place{index, 1, step.column};
        if (!step.name.empty()) {
            if (node->kind != Node::Kind::table) {
                report(place, enclosed(reached, '`') + " is " + std::string(kind_name(node->kind)) +
                                  ", it has no keys");
                return;
            }
            Entry* entry = node->find(step.name);
            const bool wants_item = n + 1 < path.steps.size() && path.steps[n + 1].name.empty();
            if (entry == nullptr && wants_item) {
                const KeyForm form =
                    describe(names_on({{path.steps.begin(), path.steps.begin() + std::ptrdiff_t(n) + 1}}));
                const std::string whole = enclosed(reached + (reached.empty() ? "" : ".") + step.name, '`');
                if (form.is_array)
                    report(place, whole + " is not in the scene",
                           "expected an array there, of which this changes an item");
                else if (!form.expected.empty())
                    report(place, whole + " has no items", "expected " + form.expected);
                else
                    node->entries.push_back(
                        {step.name, place, {}});  // of which it is said that it is unknown
                return;
            }
            if (entry == nullptr) {
                node->entries.push_back({step.name, place, {}});
                entry = &node->entries.back();
                entry->value.place = place;
            }
            node = &entry->value;
            if (!reached.empty()) reached += '.';
            reached += step.name;
        } else if (node->kind == Node::Kind::array && step.index < node->items.size()) {
            node = &node->items[step.index];
            (reached += '[') += std::to_string(step.index);
            reached += ']';
        } else {
            const bool array = node->kind == Node::Kind::array;
            report(place, enclosed(reached, '`') + " has no item " + std::to_string(step.index),
                   array ? items_text(node->items.size()) : "it is no array");
            return;
        }
    }
    *node = std::move(*value);
}

}  // namespace nephos
