// SPDX-License-Identifier: Apache-2.0
#pragma once

// TOML text as a tree of nodes with their source positions, so that the file and the --set options can be
// merged and every message can point at its position. Only document.cpp includes the TOML parser.

#include <cstdint>
#include <deque>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/format/errors.h"

namespace nephos {

// A line that is too long to count its characters for each place in it.
struct LongLine {
    int line = 0;
    std::vector<std::size_t> marks;  // bytes of the line before every kCharactersOfMark-th character
};
inline constexpr std::size_t kCharactersOfMark = 256;

// A source text of nodes: the scene file or one --set option.
struct Origin {
    std::string label;  // "scenes/cumulus.toml" or "--set density.half=maybe"
    std::string text;
    bool is_file = true;
    std::vector<std::size_t> line_starts;  // byte offsets
    std::vector<LongLine> long_lines;      // in the order of the text
};

// The position of a character in an origin; line and column count from 1.
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

// Returns the kind of a node for messages: "a text", "an array", ...
std::string_view kind_name(Node::Kind kind);

// The expected form of an option's value.
struct KeyForm {
    bool takes_text = false;  // a value without leading quote or bracket is taken as text
    std::string expected;     // "true or false"; empty: the key is not known
    bool is_array = false;    // the key takes an array: of tables, numbers or texts
};

// The parsed scene file merged with the options, and all problems found so far. Not thread-safe.
class Document {
  public:
    Node root;
    std::vector<Problem> problems;
    bool frames_checked = true;   // false: frames need not fit into the simulated time (reader.h)
    bool models_missing = false;  // a file named by `models` could not be read

    // Adds a source text and returns its index for Place::origin.
    int add_origin(std::string label, std::string text, bool is_file);
    const Origin& origin(int index) const { return origins_[std::size_t(index)]; }

    // Adds a problem; none from kMostProblems on.
    void report(const Place& place, std::string message, std::string expected = {});
    bool is_full() const { return problems.size() >= kMostProblems; }

    // Returns the problem that report() adds.
    Problem problem_at(const Place& place, std::string message, std::string expected = {}) const;

    // Parses the text of an origin. Reports a problem and returns nullopt on a syntax error, invalid UTF-8 or
    // nesting that is too deep.
    std::optional<Node> parse(int origin);

    // Sets a value in `root` by an option "key.path=value". `describe` returns the expected form of the key
    // at a path (without indices). Reports problems.
    void set(const std::string& option, KeyForm (*describe)(const std::vector<std::string>& path));

  private:
    // Parses `text`, which has the same line and column positions as the origin's text.
    std::optional<Node> parse_text(int origin, std::string_view text, const std::string& expected);

    // Parses the value of an option whose '=' is at byte `equals`.
    std::optional<Node> option_value(int origin, std::size_t equals, const KeyForm& form);

    std::deque<Origin> origins_;
};

// Texts of files with base models, by absolute path.
using ModelTexts = std::map<std::string, std::string>;

// Reads the key `models`, base models from other scene files: inserts the [[model]] tables of the files that
// `models` names in front of the document's own, in the order of the list, so that they are read, checked,
// written and hashed as if they stood in the scene. What else those files hold is ignored, their own `models`
// too. A file is read once, however often it is named, and its models are inserted each time. A relative name is
// relative to `folder`, one from a --set option to the current folder. Problems are reported, among them more files
// than 1,000, and more of them than 8 MiB. `texts` is taken for what is in it, and added to.
void take_models_from_files(Document& document, const std::filesystem::path& folder, ModelTexts& texts);

}  // namespace nephos
