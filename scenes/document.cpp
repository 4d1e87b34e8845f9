// SPDX-License-Identifier: Apache-2.0
#include "scenes/document.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "scenes/nesting.h"
#include "scenes/text.h"

// A parse failure is returned, not thrown, and the parser's own asserts are off: the text is a user's, and no
// text may end the program.
#define TOML_EXCEPTIONS 0
#define TOML_ASSERT(expr) static_assert(true)
#define TOML_ENABLE_FORMATTERS 0
#include <toml++/toml.h>

namespace nephos {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

std::vector<std::size_t> find_line_starts(std::string_view text) {
    std::vector<std::size_t> starts{0};
    for (std::size_t at = text.find('\n'); at != std::string_view::npos; at = text.find('\n', at + 1)) {
        starts.push_back(at + 1);
    }
    return starts;
}

// The line without its end, `line` counted from 1; empty beyond the text.
std::string_view line_of(const Origin& origin, int line) {
    if (line < 1 || std::size_t(line) > origin.line_starts.size()) return {};
    const std::size_t start = origin.line_starts[std::size_t(line) - 1];
    std::string_view rest = std::string_view(origin.text).substr(start);
    rest = rest.substr(0, std::min(rest.find('\n'), rest.size()));
    if (!rest.empty() && rest.back() == '\r') rest.remove_suffix(1);
    return rest;
}

Place place_of_offset(const Origin& origin, int index, std::size_t offset) {
    const auto after = std::upper_bound(origin.line_starts.begin(), origin.line_starts.end(), offset);
    const std::size_t start = *std::prev(after);
    Place place{index, int(after - origin.line_starts.begin()), 1};
    for (std::size_t at = start; at < offset;) {
        at += character_at(origin.text, at).bytes.size();
        ++place.column;
    }
    return place;
}

// The part of a line around the place of a problem, and the caret's column in it.
struct Excerpt {
    std::string text;
    int caret = 0;
};

Excerpt excerpt_around(std::string_view line, int column) {
    constexpr std::size_t kBefore = 70, kAfter = 40;  // characters
    std::vector<std::size_t> offsets;                 // of the characters up to the last one shown
    const auto wanted = std::size_t(std::max(column, 1));
    for (std::size_t at = 0; at < line.size() && offsets.size() < wanted + kAfter;) {
        offsets.push_back(at);
        at += character_at(line, at).bytes.size();
    }
    const std::size_t caret = std::min(wanted, offsets.size() + 1);  // one past the end is a place, too
    const std::size_t first = caret > kBefore ? caret - kBefore : 0;
    const std::size_t begin = first < offsets.size() ? offsets[first] : line.size();
    std::size_t end = line.size();
    if (offsets.size() == wanted + kAfter) end = offsets.back();
    Excerpt excerpt{printable(line.substr(begin, end - begin)), int(caret - first)};
    if (first > 0) {
        excerpt.text.insert(0, "...");
        excerpt.caret += 3;
    }
    if (end < line.size()) excerpt.text += "...";
    return excerpt;
}

Place place_of(const toml::source_region& region, int origin) {
    return {origin, int(region.begin.line), int(region.begin.column)};
}

// The parser's words, which start with "Error while parsing ...".
std::string reason_of(const toml::parse_error& error) {
    constexpr std::string_view kOpening = "Error while ";
    std::string_view reason = error.description();
    if (reason.starts_with(kOpening)) reason.remove_prefix(kOpening.size());
    return printable(reason);
}

// Recursion is bounded by find_excessive_nesting().
Node converted(const toml::node& source, int origin) {
    Node node;
    node.place = place_of(source.source(), origin);
    if (const auto* table = source.as_table()) {
        node.kind = Node::Kind::table;
        for (const auto& [key, value] : *table) {
            node.entries.push_back(
                {std::string(key.str()), place_of(key.source(), origin), converted(value, origin)});
        }
        std::sort(node.entries.begin(), node.entries.end(), [](const Entry& a, const Entry& b) {
            return std::tie(a.place.line, a.place.column) < std::tie(b.place.line, b.place.column);
        });
    } else if (const auto* array = source.as_array()) {
        node.kind = Node::Kind::array;
        for (const auto& value : *array) node.items.push_back(converted(value, origin));
    } else if (const auto* text = source.as_string()) {
        node.kind = Node::Kind::text;
        node.text = text->get();
    } else if (const auto* integer = source.as_integer()) {
        node.kind = Node::Kind::integer;
        node.integer = integer->get();
    } else if (const auto* number = source.as_floating_point()) {
        node.kind = Node::Kind::number;
        node.number = number->get();
    } else if (const auto* boolean = source.as_boolean()) {
        node.kind = Node::Kind::boolean;
        node.boolean = boolean->get();
    } else {
        node.kind = Node::Kind::date;
    }
    return node;
}

}  // namespace

const Entry* Node::find(std::string_view name) const {
    for (const Entry& entry : entries) {
        if (entry.name == name) return &entry;
    }
    return nullptr;
}

Entry* Node::find(std::string_view name) { return const_cast<Entry*>(std::as_const(*this).find(name)); }

std::string_view kind_name(Node::Kind kind) {
    switch (kind) {
        case Node::Kind::boolean:
            return "a truth value";
        case Node::Kind::integer:
            return "an integer";
        case Node::Kind::number:
            return "a number";
        case Node::Kind::text:
            return "a text";
        case Node::Kind::date:
            return "a date or time";
        case Node::Kind::array:
            return "an array";
        case Node::Kind::table:
            return "a table";
    }
    return "a value";
}

int Document::add_origin(std::string label, std::string text, bool is_file) {
    if (text.starts_with(kByteOrderMark)) text.erase(0, kByteOrderMark.size());
    Origin origin{std::move(label), std::move(text), is_file, {}};
    origin.line_starts = find_line_starts(origin.text);
    origins_.push_back(std::move(origin));
    return int(origins_.size()) - 1;
}

void Document::report(const Place& place, std::string message, std::string expected) {
    const Origin& from = origin(place.origin);
    const Excerpt excerpt = excerpt_around(line_of(from, place.line), place.column);
    const SourcePosition where{from.label, from.is_file ? place.line : 0, place.column};
    problems.push_back({where, std::move(message), std::move(expected), excerpt.text, excerpt.caret});
}

std::optional<Node> Document::parse(int index) { return parse_text(index, origin(index).text, {}); }

std::optional<Node> Document::parse_text(int index, std::string_view text,
                                         const std::string& expected_value) {
    const Origin& from = origin(index);
    const auto fail_at = [&](std::size_t offset, std::string message, std::string expected) {
        report(place_of_offset(from, index, offset), std::move(message), std::move(expected));
        return std::nullopt;
    };
    if (const std::size_t zero = text.find('\0'); zero != std::string_view::npos) {
        return fail_at(zero, "not a text file: it contains a zero byte", "expected a scene in TOML");
    }
    if (const std::size_t bad = find_invalid_utf8(text); bad < text.size()) {
        return fail_at(bad, "not UTF-8 text", "expected a scene in TOML, saved as UTF-8");
    }
    if (const auto nesting = find_excessive_nesting(text)) {
        return fail_at(nesting->offset, nesting->message, "no key of a scene needs that");
    }
    const toml::parse_result result = toml::parse(text, from.label);
    if (!result) {
        const toml::parse_error& error = result.error();
        report(place_of(error.source(), index), "not valid TOML: " + reason_of(error), expected_value);
        return std::nullopt;
    }
    return converted(result.table(), index);
}

}  // namespace nephos
