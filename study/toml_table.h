// SPDX-License-Identifier: Apache-2.0
#pragma once

// Reads the tables of study files with the errors of scenes: every problem at once up to kMostProblems, each with its
// place, a caret, and the key that was meant. Private to study/.

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/format/document.h"

namespace nephos {

class TomlTable {
  public:
    // `node` is a table; `path` names it in messages, empty for the file itself. Both must outlive this object.
    TomlTable(Document& document, const Node& node, std::string path);
    // Reports every key that was not asked for.
    ~TomlTable();
    TomlTable(const TomlTable&) = delete;
    TomlTable& operator=(const TomlTable&) = delete;

    bool has(std::string_view key);
    std::optional<std::string> text(const std::string& key);
    std::optional<double> number(const std::string& key, double min, double max);
    std::optional<std::uint64_t> integer(const std::string& key, std::uint64_t min, std::uint64_t max);
    std::optional<bool> flag(const std::string& key);
    std::optional<std::size_t> word(const std::string& key, const std::vector<std::string_view>& words);
    std::vector<std::string> texts(const std::string& key);
    std::vector<std::string> values(const std::string& key);  // each as canonical_toml()
    // Returns where the value of a key stands, or the table where the key is missing; and the items of an array, or the only
    // value instead of one.
    Place place(std::string_view key);
    std::vector<Place> item_places(std::string_view key);
    // Calls `read` for the table `key`, or for each of an array of tables.
    void table(const std::string& key, const std::function<void(TomlTable&)>& read);
    void tables(const std::string& key, const std::function<void(TomlTable&)>& read);
    // Reports a problem with a key, or with the table where the key is missing.
    void report(const std::string& key, const std::string& message, const std::string& expected);
    // Reports a problem that has a place of its own, as of another file.
    void report(Problem problem);

  private:
    const Entry* find(std::string_view key);
    std::string path_of(const std::string& key) const;
    void wrong_kind(const Entry& entry, const std::string& expected);

    Document& document_;
    const Node& node_;
    std::string path_;
    std::vector<std::string> asked_;
};

// Returns a value of TOML on one line, in the form that equal values have in common: keys of tables sorted, numbers and
// texts as study files write them. Nothing where the text is not one value, or has a date or time in it.
std::optional<std::string> canonical_toml(std::string_view value);

// Reads a text into a table; `label` names it in messages. Throws SceneErrors with the problems.
void read_toml_text(std::string text, const std::string& label, const std::function<void(TomlTable&)>& read);

// Reads a file likewise; messages call it by its `kind`. Throws SceneErrors with the problems, Error(io).
void read_toml_file(const std::filesystem::path& path, const std::function<void(TomlTable&)>& read,
                    std::string_view kind = "scene");

}  // namespace nephos
