// SPDX-License-Identifier: Apache-2.0
#include "scenes/format/toml_edit.h"

#include <algorithm>
#include <charconv>
#include <iterator>
#include <optional>

#include "core/error.h"
#include "scenes/format/text.h"
#include "scenes/format/toml_change.h"

namespace nephos {
namespace {

using Form = TomlNode::Form;
constexpr std::size_t kNone = std::string_view::npos;

// What must stand before a new line at `at`: an end for the last line when it has none.
std::string line_break_before(std::string_view text, std::size_t at) {
    const bool at_line_start =
        at == 0 || text[at - 1] == '\n' || (at == 3 && text.starts_with("\xEF\xBB\xBF"));
    return at_line_start ? "" : newline_of(text);
}

std::string dotted(const TextPath& path, std::size_t from) {
    std::string out;
    for (std::size_t n = from; n < path.size(); ++n) {
        if (!out.empty()) out += '.';
        out += toml_key(path[n].name);
    }
    return out;
}

// The name of the section of a path: its names without indices.
std::string header_name(const TextPath& path) {
    TextPath names;
    std::ranges::copy_if(path, std::back_inserter(names),
                         [](const TextStep& step) { return !step.name.empty(); });
    return dotted(names, 0);
}

[[noreturn]] void refuse(const TextPath& path, const std::string& why) {
    throw Error(ErrorCode::usage, enclosed(path_text(path), '`') + " " + why);
}

// The deepest node of a path that is there, and how many steps lead to it.
struct Reached {
    const TomlNode* node = nullptr;
    std::size_t steps = 0;
};

Reached reach(const TomlNode& root, const TextPath& path) {
    Reached reached{&root, 0};
    for (const TextStep& step : path) {
        const TomlNode* next = nullptr;
        if (step.name.empty()) {
            if (step.index < reached.node->items.size()) next = &reached.node->items[step.index];
        } else {
            next = reached.node->find(step.name);
        }
        if (next == nullptr) break;
        reached = {next, reached.steps + 1};
    }
    return reached;
}

// Where a key of the root goes that has none yet: below the comment at the start of the file.
std::size_t below_first_comment(std::string_view text, std::size_t at) {
    while (at < text.size() && text[at] == '#') at = std::min(text.find('\n', at), text.size() - 1) + 1;
    return at;
}

// Collects all sections of a node and of those within it, also of those below its dotted keys.
void collect_places(const TomlNode& node, bool headers_only, std::vector<TextRegion>& out) {
    if (node.form == Form::section) {
        const auto& own = headers_only ? node.headers : node.places;
        out.insert(out.end(), own.begin(), own.end());
    }
    for (const auto& [name, entry] : node.entries) {
        if (entry.form == Form::section || entry.form == Form::sections || entry.form == Form::dotted)
            collect_places(entry, headers_only, out);
    }
    if (node.form == Form::sections) {
        for (const TomlNode& item : node.items) collect_places(item, headers_only, out);
    }
}

std::size_t end_of_sections(const TomlNode& node) {
    std::vector<TextRegion> places;
    collect_places(node, false, places);
    std::size_t end = node.insert_at;
    for (const TextRegion& place : places) end = std::max(end, place.end);
    return end;
}

Change new_section(std::string_view text, std::size_t at, const std::string& header,
                   const std::string& body) {
    const std::string newline = newline_of(text);
    std::string by = line_break_before(text, at);
    if (at > 0 && at != 3) by += newline;  // an empty line before it
    by += header + newline + body;
    return {{at, at}, by};
}

std::string as_lines(std::span<const TextEntry> entries, const std::string& newline) {
    std::string out;
    for (const auto& [name, value] : entries) out += toml_key(name) + " = " + value + newline;
    return out;
}

std::string as_braces(std::span<const TextEntry> entries) {
    std::string out = "{ ";
    for (const auto& [name, value] : entries) {
        if (out.size() > 2) out += ", ";
        out += toml_key(name) + " = " + value;
    }
    return out += entries.empty() ? "}" : " }";
}

// Adds `key = value` to a table that is there.
Change added_key(std::string_view text, const TomlNode& table, const std::string& key,
                 std::string_view value) {
    const std::string entry = table.prefix + key + " = " + std::string(value);
    const bool braces = table.form == Form::inlined || table.in_braces;
    if (braces) {
        const bool first = table.form == Form::inlined && table.entries.empty();
        if (!first) return {{table.insert_at, table.insert_at}, ", " + entry};
        return {{table.insert_at, table.value.end - 1}, " " + entry + " "};
    }
    const bool implied = table.form == Form::section && table.headers.empty();
    if (implied) return {};  // the caller makes a section
    const std::string newline = newline_of(text);
    std::size_t at = table.insert_at;
    if (table.form == Form::section && table.headers.size() == 1 && table.headers[0] == TextRegion{at, at}) {
        at = below_first_comment(text, at);  // the root without keys
    }
    std::string indent;
    if (!table.entries.empty() && at > 0) indent = indent_at(text, at - 1);
    return {{at, at}, line_break_before(text, at) + indent + entry + newline};
}

// Adds a key that is missing from `from` on in the path.
Change missing_key(std::string_view text, const TomlNode& root, const TextPath& path, const Reached& reached,
                   std::string_view value) {
    const TomlNode& table = *reached.node;
    for (std::size_t n = reached.steps; n < path.size(); ++n) {
        if (path[n].name.empty()) refuse(path, "does not exist: there is no such element");
    }
    if (!table.is_table()) refuse(path, "lies in something that is no table");
    const std::string newline = newline_of(text);
    if (&table == &root && path.size() - reached.steps > 1) {
        TextPath header(path.begin(), path.end() - 1);
        const std::string body = toml_key(path.back().name) + " = " + std::string(value) + newline;
        return new_section(text, text.size(), "[" + dotted(header, 0) + "]", body);
    }
    if (table.form == Form::section && table.headers.empty()) {  // it has only sub-tables
        const TextPath header(path.begin(), path.begin() + std::ptrdiff_t(reached.steps));
        std::vector<TextRegion> places;
        collect_places(table, false, places);
        const auto first = std::ranges::min(places, {}, &TextRegion::begin);
        const std::string body = dotted(path, reached.steps) + " = " + std::string(value) + newline;
        return {{first.begin, first.begin}, "[" + header_name(header) + "]" + newline + body + newline};
    }
    return added_key(text, table, dotted(path, reached.steps), value);
}

// Removes the blank lines, too, that follow what is removed where a blank line or the text's start is before it.
TextRegion with_blank_lines(std::string_view text, TextRegion region) {
    const bool blank_before =
        region.begin == 0 || (region.begin >= 2 && text[region.begin - 1] == '\n' &&
                              (text[region.begin - 2] == '\n' || text[region.begin - 2] == '\r'));
    if (!blank_before && region.end < text.size()) return region;
    if (region.end >= text.size() && blank_before &&
        region.begin > 0) {  // the last section: its blank line above
        const std::string newline = newline_of(text);
        if (text.substr(0, region.begin).ends_with(newline + newline)) region.begin -= newline.size();
        return region;
    }
    while (region.end < text.size()) {
        const std::size_t line = text.find('\n', region.end);
        const std::size_t end = line == kNone ? text.size() : line + 1;
        if (text.substr(region.end, end - region.end).find_first_not_of(" \t\r\n") != kNone) break;
        region.end = end;
    }
    return region;
}

// Returns the regions in the order of the text; those with only characters of `between` between them as one.
std::vector<TextRegion> merged(std::string_view text, std::vector<TextRegion> regions,
                               std::string_view between = " \t\r\n") {
    std::ranges::sort(regions, {}, &TextRegion::begin);
    std::vector<TextRegion> out;
    for (const TextRegion& region : regions) {
        const bool joins =
            !out.empty() &&
            (region.begin <= out.back().end ||
             text.substr(out.back().end, region.begin - out.back().end).find_first_not_of(between) == kNone);
        if (joins) {
            out.back().end = std::max(out.back().end, region.end);
        } else {
            out.push_back(region);
        }
    }
    return out;
}

// Removes a key between the braces of its table.
std::vector<Change> removed_in_braces(std::string_view text, const TomlNode& node) {
    std::vector<Change> changes;
    for (const TextRegion& place : merged(text, node.places, " \t,")) {
        const std::size_t comma = after_comma(text, place.end);
        const std::size_t begin_blank = text.find_last_not_of(" \t", place.begin - 1);
        if (comma > place.end) {
            changes.push_back(
                {{place.begin, std::min(text.find_first_not_of(" \t", comma), text.size())}, ""});
        } else if (text[begin_blank] == ',') {
            changes.push_back({{begin_blank, place.end}, ""});
        } else {
            changes.push_back({place, ""});
        }
    }
    return changes;
}

}  // namespace

TextPath text_path(std::string_view path) {
    TextPath steps;
    std::size_t at = 0;
    const auto fail = [&] { throw Error(ErrorCode::usage, enclosed(path, '`') + " is no path of a key"); };
    while (true) {
        const std::size_t end = std::min(path.find_first_of(".[", at), path.size());
        if (end == at) fail();
        steps.push_back({std::string(path.substr(at, end - at)), 0});
        at = end;
        while (at < path.size() && path[at] == '[') {
            std::size_t index = 0;
            const auto [rest, error] =
                std::from_chars(path.data() + at + 1, path.data() + path.size(), index);
            if (error != std::errc() || rest == path.data() + path.size() || *rest != ']') fail();
            steps.push_back({{}, index});
            at = std::size_t(rest - path.data()) + 1;
        }
        if (at == path.size()) return steps;
        if (path[at] != '.') fail();
        ++at;
    }
}

std::string path_text(const TextPath& path) {
    std::string out;
    for (const TextStep& step : path) {
        if (step.name.empty()) {
            out = indexed(out, step.index);
        } else {
            if (!out.empty()) out += '.';
            out += step.name;
        }
    }
    return out;
}

const TomlNode* find_node(const TomlNode& root, const TextPath& path) {
    const Reached reached = reach(root, path);
    return reached.steps == path.size() ? reached.node : nullptr;
}

namespace {

// Returns the text with items of an array more or less, and all else in it as it was, comments too; nothing where the array at
// `path` is to be as long as it was, where none of its items stays, or where it is so long that finding those takes too much time.
std::optional<std::string> with_items(std::string_view text, const TextPath& path, const TomlNode& array,
                                      std::string_view value, NumberForm form) {
    if (array.form != Form::array || !value.starts_with('[')) return std::nullopt;
    const std::string whole = "v = " + std::string(value);
    const TomlNode parsed = toml_tree(whole);
    const auto texts_of = [](std::string_view in, const std::vector<TomlNode>& items) {
        std::vector<std::string_view> texts;
        for (const TomlNode& item : items)
            texts.push_back(in.substr(item.value.begin, item.value.end - item.value.begin));
        return texts;
    };
    const std::vector<std::string_view> was = texts_of(text, array.items),
                                        now = texts_of(whole, parsed.find("v")->items);
    if (was.size() == now.size()) return std::nullopt;
    const auto found = common_items(was, now, form);
    if (!found) return std::nullopt;
    const std::size_t kept = was.size() - std::size_t(std::ranges::count(*found, kNone));
    if (kept == 0 && !was.empty() && !now.empty()) return std::nullopt;
    std::string out(text);
    TextPath item = path;
    item.push_back({});
    for (std::size_t n = was.size(); n-- > 0;) {
        item.back().index = n;
        if ((*found)[n] == kNone) out = without(out, item);
    }
    // Begin with the last one: what stands before it stays where it is.
    const TomlNode root = toml_tree(out);
    const TomlNode& left = *find_node(root, path);
    std::vector<std::size_t> places;
    std::ranges::copy_if(*found, std::back_inserter(places),
                         [](std::size_t place) { return place != kNone; });
    std::size_t next = places.size();  // of those that stay, the one behind `k`
    for (std::size_t k = now.size(); k-- > 0;) {
        const std::string more(now[k]);
        if (next > 0 && places[next - 1] == k)
            --next;
        else if (next > 0)
            out = applied(out, added_behind(out, left.items[next - 1].value, more));
        else if (kept > 0)
            out = applied(out, {added_before(out, left.items.front().value, more)});
        else
            out.insert(left.value.begin + 1, k + 1 < now.size() ? more + ", " : more);
    }
    return out;
}

}  // namespace

std::string with_value(std::string_view text, const TextPath& path, std::string_view value, NumberForm form) {
    const TomlNode root = toml_tree(text);
    const Reached reached = reach(root, path);
    if (reached.steps < path.size()) return applied(text, {missing_key(text, root, path, reached, value)});
    const TomlNode& node = *reached.node;
    if (node.form == Form::value || node.form == Form::array || node.form == Form::inlined) {
        if (std::optional<std::string> items = with_items(text, path, node, value, form))
            return *std::move(items);
        return applied(text, replaced_value(text, node, value, form));
    }
    refuse(path, "is a table: its keys are set one by one");
}

std::string without(std::string_view text, const TextPath& path) {
    const TomlNode root = toml_tree(text);
    const TomlNode* node = find_node(root, path);
    if (node == nullptr || path.empty()) return std::string(text);
    const TextPath above(path.begin(), path.end() - 1);
    const TomlNode& parent = *find_node(root, above);
    if (parent.form == Form::array) return applied(text, removed_element(text, parent, path.back().index));
    std::vector<Change> changes;
    std::vector<TextRegion> sections;
    collect_places(*node, false, sections);
    for (const TextRegion& section : merged(text, sections))
        changes.push_back({with_blank_lines(text, section), ""});
    if (node->form == Form::section || node->form == Form::sections) return applied(text, changes);
    const bool braces = parent.form == Form::inlined || parent.in_braces || node->in_braces;
    if (braces) return applied(text, removed_in_braces(text, *node));
    for (const TextRegion& place : node->places) changes.push_back({place, ""});
    return applied(text, changes);
}

std::string with_new_element(std::string_view text, const TextPath& array, std::span<const TextEntry> entries,
                             std::optional<std::size_t> before) {
    const TomlNode root = toml_tree(text);
    const Reached reached = reach(root, array);
    const std::string newline = newline_of(text);
    const std::string header = "[[" + header_name(array) + "]]";
    if (reached.steps < array.size()) {
        const TomlNode& table = *reached.node;
        if (table.form != Form::section) {
            return applied(text, {missing_key(text, root, array, reached, "[" + as_braces(entries) + "]")});
        }
        const std::size_t at = &table == &root ? text.size() : end_of_sections(table);
        return applied(text, {new_section(text, at, header, as_lines(entries, newline))});
    }
    const TomlNode& node = *reached.node;
    if (node.form == Form::sections) {
        if (before && *before == 0) {
            std::vector<TextRegion> places;
            collect_places(node.items.front(), false, places);
            const std::size_t at = std::ranges::min(places, {}, &TextRegion::begin).begin;
            return applied(text, {{{at, at}, header + newline + as_lines(entries, newline) + newline}});
        }
        const TomlNode& last =
            before && *before < node.items.size() ? node.items[*before - 1] : node.items.back();
        return applied(text, {new_section(text, end_of_sections(last), header, as_lines(entries, newline))});
    }
    if (node.form != Form::array) refuse(array, "is no array of tables");
    const std::string element = as_braces(entries);
    if (node.items.empty()) {
        return applied(text, {{{node.value.begin + 1, node.value.begin + 1}, element}});
    }
    if (before && *before < node.items.size())
        return applied(text, {added_before(text, node.items[*before].value, element)});
    return applied(text, added_behind(text, node.items.back().value, element));
}

std::string with_copied_element(std::string_view text, const TextPath& array, std::size_t index) {
    const TomlNode root = toml_tree(text);
    const TomlNode* node = find_node(root, array);
    if (node == nullptr || index >= node->items.size()) {
        refuse(array, "has no element " + std::to_string(index));
    }
    const TomlNode& item = node->items[index];
    const std::string newline = newline_of(text);
    if (node->form == Form::sections) {
        std::vector<TextRegion> headers;
        collect_places(item, true, headers);
        std::ranges::sort(headers, {}, &TextRegion::begin);
        std::string copy;
        for (const TextRegion& region : headers) {
            copy += text.substr(region.begin, region.end - region.begin);
            if (!copy.ends_with('\n')) copy += newline;
        }
        const std::size_t at = end_of_sections(item);
        std::string by = line_break_before(text, at);
        by += newline;
        by += copy;
        return applied(text, {{{at, at}, by}});
    }
    const std::string copy(text.substr(item.value.begin, item.value.end - item.value.begin));
    return applied(text, added_behind(text, item.value, copy));
}

}  // namespace nephos
