// SPDX-License-Identifier: Apache-2.0
#include <charconv>
#include <cmath>
#include <optional>

#include "scenes/format/named_files.h"
#include "scenes/format/schema.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

// A key while its value is read: what messages need.
struct Reading {
    Document& document;
    const Key& key;
    std::string path;

    std::string expected() const { return "expected " + expected_text(key); }
    void report(const Place& place, const std::string& what) const {
        document.report(place, enclosed(path, '`') + " " + what, expected());
    }
};

// Describes a node for messages of the form "... is X": its value when it is short, else its kind.
std::string node_text(const Node& node) {
    switch (node.kind) {
        case Node::Kind::boolean:
            return node.boolean ? "true" : "false";
        case Node::Kind::integer:
            return std::to_string(node.integer);
        case Node::Kind::number:
            return number_text(node.number);
        case Node::Kind::text:
            return "the text " + enclosed(shortened(node.text), '"');
        default:
            return std::string(kind_name(node.kind));
    }
}

bool check_limits(const Reading& reading, const Place& place, double number) {
    const Limits& limits = reading.key.limits;
    if (std::isnan(number)) {
        reading.report(place, "is nan");
    } else if (std::isinf(number) && !(limits.infinite && number > 0)) {
        reading.report(place, "is infinite");
    } else if (number < limits.min || (limits.above_min && number == limits.min)) {
        reading.report(place, "is " + number_text(number) + ", too small");
    } else if (number > limits.max || (limits.below_max && number == limits.max)) {
        reading.report(place, "is " + number_text(number) + ", too large");
    } else {
        return true;
    }
    return false;
}

std::optional<double> number_of(const Reading& reading, const Node& node) {
    double number = 0;
    if (node.kind == Node::Kind::integer) {
        number = double(node.integer);
    } else if (node.kind == Node::Kind::number) {
        number = node.number;
    } else {
        reading.report(node.place, "is " + node_text(node));
        return std::nullopt;
    }
    if (!check_limits(reading, node.place, number)) return std::nullopt;
    return number == 0 ? 0.0 : number;  // one zero only, so that equal scenes have equal hashes
}

std::optional<std::int64_t> integer_of(const Reading& reading, const Node& node) {
    if (node.kind != Node::Kind::integer) {
        reading.report(node.place, "is " + node_text(node));
        return std::nullopt;
    }
    // The limits of integers are below 2^53, where doubles are exact; a larger number is too large in any
    // case.
    if (!check_limits(reading, node.place, double(node.integer))) return std::nullopt;
    return node.integer;
}

// The items of an array of exactly three; null after a report.
const std::vector<Node>* three_items(const Reading& reading, const Node& node) {
    if (node.kind != Node::Kind::array) {
        reading.report(node.place, "is " + node_text(node));
    } else if (node.items.size() != 3) {
        const std::size_t size = node.items.size();
        reading.report(node.place,
                       "has " + std::to_string(size) + (size == 1 ? " item" : " items") + ", not 3");
    } else {
        return &node.items;
    }
    return nullptr;
}

// Reads every component, so that each wrong one is reported.
template <typename Read>
auto read_three(const Reading& reading, const Node& node, Read&& read) {
    using Value = typename decltype(read(reading, node))::value_type;
    std::optional<std::array<Value, 3>> result;
    const std::vector<Node>* items = three_items(reading, node);
    if (items == nullptr) return result;
    std::array<Value, 3> values{};
    bool complete = true;
    for (std::size_t n = 0; n < 3; ++n) {
        const Reading component{reading.document, reading.key, indexed(reading.path, n)};
        const auto value = read(component, (*items)[n]);
        complete = complete && value.has_value();
        if (value) values[n] = *value;
    }
    if (complete) result = values;
    return result;
}

// Two numbers [min, max], or one for both; `read` reads one. Nothing, and a report, when they are not.
template <class Read>
auto read_ends(const Reading& reading, const Node& node, const Read& read) {
    using Value = typename decltype(read(reading, node))::value_type;
    std::optional<std::array<Value, 2>> result;
    if (node.kind != Node::Kind::array) {
        if (const auto number = read(reading, node)) result = {*number, *number};
        return result;
    }
    if (node.items.size() != 2) {
        const std::size_t size = node.items.size();
        reading.report(node.place,
                       "has " + std::to_string(size) + (size == 1 ? " item" : " items") + ", not 2");
        return result;
    }
    const auto min = read({reading.document, reading.key, indexed(reading.path, 0)}, node.items[0]);
    const auto max = read({reading.document, reading.key, indexed(reading.path, 1)}, node.items[1]);
    if (!min || !max) return result;
    if (*min > *max) {
        reading.report(node.place,
                       "runs from " + number_text(double(*min)) + " down to " + number_text(double(*max)));
        return result;
    }
    result = {*min, *max};
    return result;
}

void read_range(const Reading& reading, const Node& node, Range& range) {
    const auto ends = read_ends(reading, node, number_of);
    if (!ends) return;
    const auto [min, max] = *ends;
    if (std::isinf(max) && !std::isinf(min)) {
        reading.report(node.items[1].place, "has an infinite end: no number can be drawn from it");
        return;
    }
    range = {min, max};
}

void read_counts(const Reading& reading, const Node& node, CountRange& counts) {
    if (const auto ends = read_ends(reading, node, integer_of)) counts = {int((*ends)[0]), int((*ends)[1])};
}

void read_texts(const Reading& reading, const Node& node, std::vector<std::string>& texts) {
    if (node.kind == Node::Kind::text) {
        texts = {node.text};
        return;
    }
    if (node.kind != Node::Kind::array) {
        reading.report(node.place, "is " + node_text(node));
        return;
    }
    texts.clear();
    for (std::size_t n = 0; n < node.items.size(); ++n) {
        const Node& item = node.items[n];
        if (item.kind == Node::Kind::text) {
            texts.push_back(item.text);
        } else {
            reading.document.report(item.place,
                                    enclosed(indexed(reading.path, n), '`') + " is " + node_text(item),
                                    "expected a text");
        }
    }
}

std::optional<int> word_of(const Reading& reading, const Node& node) {
    if (node.kind != Node::Kind::text) {
        reading.report(node.place, "is " + node_text(node));
        return std::nullopt;
    }
    const auto& words = reading.key.words;
    for (std::size_t n = 0; n < words.size(); ++n) {
        if (words[n] == node.text) return int(n);
    }
    const std::string_view meant = closest_word(node.text, words);
    std::string expected = reading.expected();
    if (!meant.empty()) expected += "; did you mean " + enclosed(meant, '"') + "?";
    reading.document.report(
        node.place, enclosed(reading.path, '`') + " is " + enclosed(shortened(node.text), '"'), expected);
    return std::nullopt;
}

void read_boundaries(const Reading& reading, const Node& node, Boundaries& boundaries) {
    if (node.kind == Node::Kind::text) {
        if (const auto word = word_of(reading, node)) {
            boundaries = {Boundary(*word), Boundary(*word), Boundary(*word)};
        }
        return;
    }
    if (const auto words = read_three(reading, node, word_of)) {
        boundaries = {Boundary((*words)[0]), Boundary((*words)[1]), Boundary((*words)[2])};
    }
}

void read_seed(const Reading& reading, const Node& node, std::uint64_t& seed) {
    if (node.kind == Node::Kind::integer && node.integer >= 0) {
        seed = std::uint64_t(node.integer);
    } else if (node.kind != Node::Kind::text || !parse_seed(node.text, seed)) {
        reading.report(node.place, "is " + node_text(node));
    }
}

void read_path(const Reading& reading, const Node& node, std::optional<std::filesystem::path>& path) {
    if (node.kind != Node::Kind::text) {
        reading.report(node.place, "is " + node_text(node));
    } else if (names_no_file(node.text)) {
        reading.report(node.place, "names no file");
    } else {
        path = std::filesystem::path(node.text);
    }
}

template <typename T>
T& as(void* value) {
    return *static_cast<T*>(value);
}

}  // namespace

bool parse_seed(std::string_view text, std::uint64_t& seed) {
    int base = 10;
    if (text.starts_with("0x") || text.starts_with("0X")) {
        text.remove_prefix(2);
        base = 16;
    }
    std::uint64_t number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number, base);
    if (error != std::errc() || end != text.data() + text.size()) return false;
    seed = number;
    return true;
}

void read_value(Document& document, const Key& key, const Node& node, const std::string& path, void* value) {
    const Reading reading{document, key, path};
    switch (key.kind) {
        case KeyKind::boolean:
            if (node.kind == Node::Kind::boolean) {
                as<bool>(value) = node.boolean;
            } else {
                reading.report(node.place, "is " + node_text(node));
            }
            break;
        case KeyKind::integer:
            if (const auto number = integer_of(reading, node)) as<int>(value) = int(*number);
            break;
        case KeyKind::count:
            if (const auto number = integer_of(reading, node))
                as<std::uint64_t>(value) = std::uint64_t(*number);
            break;
        case KeyKind::seed:
            read_seed(reading, node, as<std::uint64_t>(value));
            break;
        case KeyKind::number:
            if (const auto number = number_of(reading, node); number && value != nullptr)
                as<double>(value) = *number;
            break;
        case KeyKind::text:
            if (node.kind == Node::Kind::text) {
                as<std::string>(value) = node.text;
            } else {
                reading.report(node.place, "is " + node_text(node));
            }
            break;
        case KeyKind::path:
            read_path(reading, node, as<std::optional<std::filesystem::path>>(value));
            break;
        case KeyKind::word:
            if (const auto word = word_of(reading, node); word && value != nullptr)
                key.set_word(value, *word);
            break;
        case KeyKind::extent:
            if (const auto n = read_three(reading, node, integer_of)) {
                as<Extent>(value) = {int((*n)[0]), int((*n)[1]), int((*n)[2])};
            }
            break;
        case KeyKind::vector:
            if (const auto n = read_three(reading, node, number_of))
                as<Vec3>(value) = {(*n)[0], (*n)[1], (*n)[2]};
            break;
        case KeyKind::colour:
            if (const auto n = read_three(reading, node, number_of)) as<Rgb>(value) = *n;
            break;
        case KeyKind::range:
            read_range(reading, node, as<Range>(value));
            break;
        case KeyKind::counts:
            read_counts(reading, node, as<CountRange>(value));
            break;
        case KeyKind::texts: {
            std::vector<std::string> ignored;
            read_texts(reading, node, value != nullptr ? as<std::vector<std::string>>(value) : ignored);
            break;
        }
        case KeyKind::boundaries:
            read_boundaries(reading, node, as<Boundaries>(value));
            break;
        case KeyKind::table:
        case KeyKind::tables:
            break;
    }
}

}  // namespace nephos
