// SPDX-License-Identifier: Apache-2.0
#pragma once

// A map of a TOML text: which bytes of it are which key, value, table and element, so that toml_edit.h can change
// some of them and leave all others as they are. The parser of document.h gives where a value begins; this adds where
// everything ends, which belongs to whom, and where something new goes. Texts are those that the parser accepted.

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace nephos {

// Bytes [begin, end) of a text.
struct TextRegion {
    std::size_t begin = 0, end = 0;
    bool operator==(const TextRegion&) const = default;
};

struct TomlEntry;

struct TomlNode {
    enum class Form {
        value,     // a text, number, truth value or date
        array,     // [1, 2]
        inlined,   // { a = 1, b = 2 }
        dotted,    // a table that keys such as `a.b = 1` make
        section,   // a table with a header [a], or an element [[a]], or one that has only sub-tables [a.b]
        sections,  // all elements [[a]]
    };

    Form form = Form::value;
    TextRegion value;  // of value, array, inlined: its bytes; of an element of these the same

    // Where its definition stands: `key = value` with its line, or within braces without; each line of a dotted table;
    // each header with the comment directly above it up to the end of its last key.
    std::vector<TextRegion> places;
    std::vector<TextRegion>
        headers;  // section: each of `places` without that comment; none when only implied

    // section, dotted, inlined: where the next key goes, and what stands before its name ("a.b.").
    std::size_t insert_at = 0;
    std::string prefix;
    bool in_braces = false;  // dotted: within an inlined table

    std::vector<TomlEntry> entries;  // tables, in the order of the text
    std::vector<TomlNode> items;     // array, sections

    bool is_table() const { return form == Form::dotted || form == Form::inlined || form == Form::section; }
    const TomlNode* find(std::string_view name) const;
    TomlNode* find(std::string_view name);
};

// One key of a table.
struct TomlEntry {
    std::string name;
    TomlNode value;
};

// Returns the tree of a text without syntax errors; its root is a section whose header is the start of the text. Of
// other texts it describes what comes before the first error. Linear in the text's length but for its keys, which are
// looked up among their neighbours. Pure.
TomlNode toml_tree(std::string_view text);

}  // namespace nephos
