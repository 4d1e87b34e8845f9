// SPDX-License-Identifier: Apache-2.0
#pragma once

// JSON that somebody may have edited or damaged: every value is read with its bounds, and an error names the file, the
// place of the value, what stands there and what was expected (not installed):
//
//     cloud/export.json: `sequences[0].layout.factor` is "two": expected a whole number from 1 to 1048576

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

namespace nephos {

// One value of a file. Refers to the file's JSON and path, which must outlive it. Every function throws Error(io) as
// above when the value is not what is asked for.
class CheckedJson {
  public:
    using Json = nlohmann::ordered_json;

    CheckedJson(const Json& value, const std::filesystem::path& file, std::string place = {})
        : value_(&value), file_(&file), place_(std::move(place)) {}

    // The member of an object, which must be there.
    CheckedJson at(std::string_view key) const;
    bool has(std::string_view key) const;
    std::vector<CheckedJson> items() const;                            // of a list
    std::vector<std::pair<std::string, CheckedJson>> members() const;  // of an object, in the file's order

    std::string text() const;
    bool truth() const;
    std::int64_t integer(std::int64_t min, std::int64_t max) const;
    double real(double min, double max) const;  // finite

    // Throws the error of this value: "`place` is VALUE: expected ...".
    [[noreturn]] void fail(const std::string& expected) const;

  private:
    const Json* value_;
    const std::filesystem::path* file_;
    std::string place_;  // "sequences[0].layout"; empty: all of the file
};

enum class JsonLists { kept, left_out };  // null stands where one was left out

// Parses a text as nlohmann::ordered_json::parse() does, which for an object takes time with the square of its keys: here it
// is linear. Returns a discarded value where the text is no JSON, and in `error` how many bytes were read up to there, or 0
// where more than 64 objects and lists lie in each other.
nlohmann::ordered_json parsed_json_text(std::string_view text, JsonLists lists = JsonLists::kept,
                                        std::size_t* error = nullptr);

// Returns the bytes of a file, or its beginning where there is a byte of 0, which no JSON has. Throws Error(io) naming it.
std::string read_json_text(const std::filesystem::path& file);

// Parses a file as parsed_json_text(). Throws Error(io) naming it, with the line where it is no JSON.
nlohmann::ordered_json parsed_json(const std::filesystem::path& file, JsonLists lists = JsonLists::kept);

// Of several members with one key keeps the last value, at the place of the first; linear. For members that were appended.
void merge_doubles(nlohmann::ordered_json::object_t& members);

}  // namespace nephos
