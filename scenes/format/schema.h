// SPDX-License-Identifier: Apache-2.0
#pragma once

// The description of every key of a scene: name, type, unit, range, default, effect, source, and an accessor
// to its value in the option structs. Reading, checking, writing, the JSON Schema and the reference page all
// traverse this one description, so that they cannot disagree.
//
//     Section (a table of the file)  -- keys -->  Key  -- section -->  Section of a nested table
//
// Key::value maps a section's owner to the value. The owner of a section such as [lattice] is the Scene; the
// owner of an element of an array of tables is that element.

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/format/document.h"
#include "scenes/format/scene.h"

namespace nephos {

// The type of a key: its form in the file, and the C++ type behind Key::value.
enum class KeyKind {
    boolean,  // true or false                                           bool
    integer,  //                                                         int
    count,    // an integer >= 0                                         std::uint64_t
    seed,     // an integer >= 0, or a text with all 64 bits             std::uint64_t
    number,   //                                                         double
    text,     //                                                         std::string
    path,     // the name of a file                                      std::optional<std::filesystem::path>
    word,     // one of Key::words                                       an enum with values 0, 1, 2 ...
    extent,   // [x, y, z], integers                                     Extent
    vector,   // [x, y, z]                                               Vec3
    colour,   // [red, green, blue], linear                              Rgb
    range,    // [min, max], or one number for both                      Range
    counts,   // the same in integers                                    CountRange
    texts,    // texts, or one alone                                     std::vector<std::string>
    boundaries,  // [x, y, z] of Key::words, or one for all                 Boundaries
    table,       // a table, described by Key::section                      its owner
    tables,      // any number of tables, each described by Key::section    std::vector of owners
};

// Limits of what a scene places and of its times: beyond any weather on Earth, and about 30 years.
inline constexpr double kFarthestPlace_m = 1e7;
inline constexpr double kLongest_s = 1e9;

// The valid numbers; also for each component of an extent, vector, colour or range.
struct Limits {
    double min = -std::numeric_limits<double>::infinity();
    double max = std::numeric_limits<double>::infinity();
    bool above_min = false;  // min itself is not allowed
    bool below_max = false;  // max itself is not allowed
    bool infinite = false;   // inf is allowed
};

struct Section;

struct Key {
    std::string name;
    KeyKind kind{};
    std::string unit;  // "m", "deg", "cells", ...; empty: none
    Limits limits;
    std::string effect;  // in a sentence or two
    std::string source;  // publication and chapter: "D, advection"; empty: nephos' own

    // Returns the value within its section's owner; null for a key that Section::finish reads (an
    // alternative form of another key).
    void* (*value)(void* owner) = nullptr;

    bool required = false;
    std::string default_text;             // the meaning of a missing key, if not a constant default
    std::vector<std::string_view> words;  // in the order of the enum's values
    int (*word_index)(const void* value) = nullptr;
    void (*set_word)(void* value, int index) = nullptr;
    std::vector<std::string> together_with;        // keys that are required beside this one
    std::string replaced_by;                       // a key that excludes this one
    bool (*written)(const void* owner) = nullptr;  // true if the canonical scene has it; null: always

    const Section* section = nullptr;         // table, tables
    int min_items = 0, max_items = 0;         // tables
    const void* element_defaults = nullptr;   // tables: an element as append() makes it
    void* (*append)(void* vector) = nullptr;  // adds an element with the section's defaults and returns it
    std::size_t (*size)(const void* vector) = nullptr;
    const void* (*element)(const void* vector, std::size_t index) = nullptr;
};

// The input of Section::finish: the table as it was read, and the document for reports.
struct SectionReader {
    Document& document;
    const Node& table;
    std::string path;  // of the section, "" at the top
    // Its keys with reported problems; their values are the defaults.
    std::vector<std::string> failed;

    // Returns true when all of these keys were read without a problem, or are missing.
    bool sound(std::initializer_list<std::string_view> names) const;

    // Returns the quoted path of a key of the section, for messages: "`sun.elevation_deg`".
    std::string quoted(std::string_view key) const;
    // Returns the key's entry; null when it is missing.
    const Entry* find(std::string_view key) const { return table.find(key); }
    // Returns the position of the key's value, or of the table when the key is missing.
    Place place(std::string_view key) const;
    // Returns the key's number; `otherwise` when it is missing or no number.
    double number(std::string_view key, double otherwise) const;
    void report(std::string_view key, std::string message, std::string expected = {}) const;
    // Returns the reader of a table within this one; of an empty one when it is missing, or no table.
    SectionReader below(std::string_view key) const;
    // Returns the reader of an item of an array of tables. The array must have this item.
    SectionReader item(std::string_view array, std::size_t index) const;
};

// A name that users expect in a section although another key has its meaning.
struct Elsewhere {
    std::string name;
    std::string meant;  // path of that key: "precipitation.kind"
};

struct Section {
    std::string title;
    std::string effect;
    std::vector<Key> keys;
    // Checks conditions on several keys, and reads keys without a value. Called when every key was read
    // without a problem; for the whole scene always, with SectionReader::failed. May be null.
    void (*finish)(const SectionReader& reader, void* owner) = nullptr;
    std::vector<Elsewhere> elsewhere{};  // suggestions for unknown keys

    const Key* find(std::string_view name) const;
};

// Returns the section of the whole file; its owner is a Scene. Thread-safe.
const Section& scene_section();

// Returns the key at a path of names without indices ("field", "scatters", "count"); null when there is none.
const Key* find_key(const std::vector<std::string>& path);

// Returns whether an option may give a value of the key without quotes as a text.
bool takes_text(const Key& key);

// Returns the path of a key of a section: key_path("sun", "date") is "sun.date". Either may be empty.
std::string key_path(std::string_view section, std::string_view key);

// Returns the expected value of a key for messages: "a number from -18 to 90, in degrees".
std::string expected_text(const Key& key);

// Returns the range for messages: "-18 to 90", "> 0"; empty without limits.
std::string limits_text(const Limits& limits);

// Returns a unit in words: "degrees" for "deg".
std::string unit_text(std::string_view unit);

// Reads `node` into `value` by the description `key`; `path` names the key in messages. Reports problems, and
// then leaves the value unchanged. For every kind but table and tables.
void read_value(Document& document, const Key& key, const Node& node, const std::string& path, void* value);

// Parses the text form of a seed, decimal or hexadecimal after "0x". Returns false when it is neither, or too
// large.
bool parse_seed(std::string_view text, std::uint64_t& seed);

}  // namespace nephos
