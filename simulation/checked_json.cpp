// SPDX-License-Identifier: Apache-2.0
#include "simulation/checked_json.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>

#include <fmt/format.h>

#include "core/descriptor.h"
#include "core/error.h"

namespace nephos {
namespace {

constexpr std::size_t kMostShown = 60;  // bytes of a value in a message

}  // namespace

void CheckedJson::fail(const std::string& expected) const {
    std::string shown = value_->is_array()    ? "a list"
                        : value_->is_object() ? "an object"
                                              : value_->dump(-1, ' ', true, Json::error_handler_t::replace);
    if (shown.size() > kMostShown) shown = shown.substr(0, kMostShown) + " ...";
    throw Error(ErrorCode::io,
                place_.empty()
                    ? fmt::format("{}: is {}: expected {}", file_->string(), shown, expected)
                    : fmt::format("{}: `{}` is {}: expected {}", file_->string(), place_, shown, expected));
}

bool CheckedJson::has(std::string_view key) const {
    if (!value_->is_object()) fail("an object");
    return value_->contains(key);
}

CheckedJson CheckedJson::at(std::string_view key) const {
    const std::string place = place_.empty() ? std::string(key) : place_ + "." + std::string(key);
    if (!has(key)) throw Error(ErrorCode::io, fmt::format("{}: `{}` is missing", file_->string(), place));
    return {value_->at(std::string(key)), *file_, place};
}

std::vector<CheckedJson> CheckedJson::items() const {
    if (!value_->is_array()) fail("a list");
    std::vector<CheckedJson> result;
    for (std::size_t n = 0; n < value_->size(); ++n)
        result.emplace_back((*value_)[n], *file_, fmt::format("{}[{}]", place_, n));
    return result;
}

std::vector<std::pair<std::string, CheckedJson>> CheckedJson::members() const {
    if (!value_->is_object()) fail("an object");
    std::vector<std::pair<std::string, CheckedJson>> result;
    for (const auto& [key, value] : value_->items())
        result.emplace_back(key, CheckedJson(value, *file_, place_.empty() ? key : place_ + "." + key));
    return result;
}

std::string CheckedJson::text() const {
    if (!value_->is_string()) fail("a text");
    return value_->get<std::string>();
}

bool CheckedJson::truth() const {
    if (!value_->is_boolean()) fail("true or false");
    return value_->get<bool>();
}

std::int64_t CheckedJson::integer(std::int64_t min, std::int64_t max) const {
    const auto wrong = [&] { fail(fmt::format("a whole number from {} to {}", min, max)); };
    if (!value_->is_number_integer()) wrong();
    // Numbers above the largest of a signed integer are unsigned ones in this library.
    if (value_->is_number_unsigned() && value_->get<std::uint64_t>() > std::uint64_t(INT64_MAX)) wrong();
    const auto number = value_->get<std::int64_t>();
    if (number < min || number > max) wrong();
    return number;
}

double CheckedJson::real(double min, double max) const {
    const double number = value_->is_number() ? value_->get<double>() : NAN;
    if (!(number >= min && number <= max)) fail(fmt::format("a number from {:g} to {:g}", min, max));
    return number;
}

nlohmann::ordered_json parsed_json(const std::filesystem::path& file) {
    require_regular_file(file);
    std::ifstream stream(file, std::ios::binary);
    const std::string text((std::istreambuf_iterator<char>(stream)), {});
    check_reading(stream, file);
    try {
        return nlohmann::ordered_json::parse(text);
    } catch (const nlohmann::json::parse_error& error) {
        const auto end = text.begin() + std::ptrdiff_t(std::min(error.byte, text.size()));
        throw Error(ErrorCode::io, fmt::format("{}: is no JSON, or is damaged: line {} cannot be read",
                                               file.string(), std::count(text.begin(), end, '\n') + 1));
    }
}

}  // namespace nephos
