// SPDX-License-Identifier: Apache-2.0
#pragma once

// The description of every key of a scene: its name, type, unit, range, default, effect and source, and where
// its value lies in the option structs. Reading, checking, writing, the JSON Schema and the reference page
// all walk this one description, so that none of them can drift from the others.
//
//     Section (a table of the file)  -- keys -->  Key  -- section -->  Section of a nested table
//
// A key knows its value by a function from the section's owner to the value: sections such as [lattice] have
// the Scene itself as owner and reach into its parts; the elements of an array of tables own themselves.

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/format/document.h"
#include "scenes/format/scene.h"

namespace nephos {

// What a key holds: the form in the file, and the C++ type behind Key::value.
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

// What numbers are allowed; also for each component of an extent, vector, colour or range.
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
    std::string effect;  // what it does, in a sentence or two
    std::string source;  // where it comes from: "D, advection"; empty: nephos' own

    // The value within its section's owner; null for a key that Section::finish reads (another form of the
    // same).
    void* (*value)(void* owner) = nullptr;

    bool required = false;
    std::string default_text;             // what a missing key means, where no constant says it
    std::vector<std::string_view> words;  // in the order of the enum's values
    int (*word_index)(const void* value) = nullptr;
    void (*set_word)(void* value, int index) = nullptr;
    std::vector<std::string> together_with;  // keys that must be there with this one
    std::string replaced_by;  // a key that takes this one's place: only one of both may be there
    bool (*written)(const void* owner) = nullptr;  // whether the canonical scene has it; null: always

    const Section* section = nullptr;         // table, tables
    int min_items = 0, max_items = 0;         // tables
    const void* element_defaults = nullptr;   // tables: an element as append() makes it
    void* (*append)(void* vector) = nullptr;  // adds an element with the section's defaults and returns it
    std::size_t (*size)(const void* vector) = nullptr;
    const void* (*element)(const void* vector, std::size_t index) = nullptr;
};

// What a section's finishing touch may use: the table as it was read, and where to report.
struct SectionReader {
    Document& document;
    const Node& table;
    std::string path;  // of the section, "" at the top
    std::vector<std::string>
        failed;  // its keys that have problems already; their values are still the defaults

    // Whether all of these keys were read without a problem, or are missing.
    bool sound(std::initializer_list<std::string_view> names) const;

    // The path of a key in it, for messages: "`sun.elevation_deg`".
    std::string quoted(std::string_view key) const;
    // The key's entry; null when it is missing.
    const Entry* find(std::string_view key) const { return table.find(key); }
    // The place of the key's value, or of the table when the key is missing.
    Place place(std::string_view key) const;
    // Its number; `otherwise` when it is missing or no number.
    double number(std::string_view key, double otherwise) const;
    void report(std::string_view key, std::string message, std::string expected = {}) const;
};

// A name that is looked for in a section although another key says it.
struct Elsewhere {
    std::string name;
    std::string meant;  // path of that key: "precipitation.kind"
};

struct Section {
    std::string title;
    std::string effect;
    std::vector<Key> keys;
    // Checks what concerns several keys, and reads keys without a value. Called when every key was read
    // without a problem; for the whole scene always, with SectionReader::failed. May be null.
    void (*finish)(const SectionReader& reader, void* owner) = nullptr;
    std::vector<Elsewhere> elsewhere{};  // for messages on unknown keys

    const Key* find(std::string_view name) const;
};

// The section of the whole file; its owner is a Scene.
const Section& scene_section();

// The key at a path of names without indices ("field", "scatters", "count"); null when there is none.
const Key* find_key(const std::vector<std::string>& path);

// What a key expects, for messages: "a number from -18 to 90, in degrees".
std::string expected_text(const Key& key);

// Its range alone: "-18 to 90", "> 0"; empty when anything goes.
std::string limits_text(const Limits& limits);

// A unit in words: "deg" is "degrees".
std::string unit_text(std::string_view unit);

}  // namespace nephos
