// SPDX-License-Identifier: Apache-2.0
#pragma once

// TOML text as a small tree of nodes that know where they stand, so that the file and the --set options can
// be merged and every message can point at its place. The only place that knows the TOML parser is
// document.cpp.

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/format/errors.h"

namespace nephos {

// A text that nodes come from: the scene file or one --set option.
struct Origin {
    std::string label;  // "scenes/cumulus.toml" or "--set density.half=maybe"
    std::string text;
    bool is_file = true;
    std::vector<std::size_t> line_starts;  // byte offsets
};

// A character in an origin; line and column count from 1.
struct Place {
    int origin = 0;
    int line = 1;
    int column = 1;
    bool operator==(const Place&) const = default;
};

struct Entry;

struct Node {
    enum class Kind { boolean, integer, number, text, date, array, table };

    Kind kind = Kind::table;
    Place place;
    bool boolean = false;
    std::int64_t integer = 0;
    double number = 0;
    std::string text;
    std::vector<Node> items;     // array
    std::vector<Entry> entries;  // table, in the order of the text

    const Entry* find(std::string_view name) const;
    Entry* find(std::string_view name);
};

// One key of a table.
struct Entry {
    std::string name;
    Place place;  // of the key
    Node value;
};

// "a text", "an array", ...: the kind of a node in a message.
std::string_view kind_name(Node::Kind kind);

// What the value of an option is to be.
struct KeyForm {
    bool takes_text = false;  // a value that starts with no quote and no bracket is the text itself
    std::string expected;     // "true or false"; empty: the key is not known
};

// The file, the options, and all problems found so far.
class Document {
  public:
    Node root;
    std::vector<Problem> problems;
    bool models_missing = false;  // a file that base models were to come from could not be read

    // Adds a text that places may refer to and returns its number.
    int add_origin(std::string label, std::string text, bool is_file);
    const Origin& origin(int index) const { return origins_[std::size_t(index)]; }

    void report(const Place& place, std::string message, std::string expected = {});

    // Parses the text of an origin. On a syntax error, or a text that no sensible scene contains (not UTF-8,
    // nested too deeply), the problem is reported and the result is empty.
    std::optional<Node> parse(int origin);

    // Puts "key.path=value" into root. `describe` says what is known of the key of this path (without
    // indices). Problems are reported.
    void set(const std::string& option, KeyForm (*describe)(const std::vector<std::string>& path));

  private:
    // `text` lies over the origin's text, so that a place in it is the same place in the origin.
    std::optional<Node> parse_text(int origin, std::string_view text, const std::string& expected);

    // The value of an option whose '=' stands at byte `equals`.
    std::optional<Node> option_value(int origin, std::size_t equals, const KeyForm& form);

    std::deque<Origin> origins_;
};

}  // namespace nephos
