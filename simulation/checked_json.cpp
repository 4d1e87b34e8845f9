// SPDX-License-Identifier: Apache-2.0
#include "simulation/checked_json.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <system_error>
#include <unordered_map>
#include <unordered_set>

#include <fmt/format.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

constexpr std::size_t kMostShown = 60;  // bytes of a value in a message
constexpr std::size_t kMostOpen = 64;   // objects and lists in each other

using Json = nlohmann::ordered_json;

// Makes a value of the parts that the parser finds.
class Builder : public nlohmann::json_sax<Json> {
  public:
    explicit Builder(JsonLists lists) : leaves_lists_out_(lists == JsonLists::left_out) {}
    Json take() { return std::move(root_); }
    // Bytes read up to where the text is no JSON; 0: it is nested too deeply.
    std::size_t error() const { return error_; }

    bool null() override { return put(nullptr); }
    bool boolean(bool value) override { return put(value); }
    bool number_integer(number_integer_t value) override { return put(value); }
    bool number_unsigned(number_unsigned_t value) override { return put(value); }
    bool number_float(number_float_t value, const string_t&) override { return put(value); }
    bool string(string_t& value) override { return put(std::move(value)); }
    bool binary(binary_t&) override { return false; }  // no text has one
    bool start_object(std::size_t) override { return open(Json::object()); }
    bool key(string_t& name) override {
        if (left_out_ == 0) key_ = std::move(name);
        return true;
    }
    bool end_object() override {
        if (left_out_ > 0) return true;
        merge_doubles(open_.back()->get_ref<Json::object_t&>());
        open_.pop_back();
        return true;
    }
    bool start_array(std::size_t) override {
        if (!leaves_lists_out_) return open(Json::array());
        if (left_out_ == 0) put(nullptr);
        ++left_out_;
        return true;
    }
    bool end_array() override {
        if (leaves_lists_out_)
            --left_out_;
        else
            open_.pop_back();
        return true;
    }
    bool parse_error(std::size_t position, const std::string&, const nlohmann::detail::exception&) override {
        error_ = position;
        return false;
    }

  private:
    bool put(Json value) {
        if (left_out_ == 0) add(std::move(value));
        return true;
    }
    // Each value is copied with all that is in it when the object around it grows.
    bool open(Json value) {
        if (left_out_ == 0) open_.push_back(add(std::move(value)));
        return open_.size() <= kMostOpen;
    }
    // Returns the place of the value, where it stays until the object or list that it is in is added to.
    Json* add(Json value) {
        if (open_.empty()) {
            root_ = std::move(value);
            return &root_;
        }
        if (open_.back()->is_array()) {
            Json::array_t& items = open_.back()->get_ref<Json::array_t&>();
            return &items.emplace_back(std::move(value));
        }
        Json::object_t& members = open_.back()->get_ref<Json::object_t&>();
        return &members.emplace_back(std::move(key_), std::move(value)).second;
    }

    Json root_;
    std::vector<Json*> open_;               // objects and lists, the innermost last
    std::string key_;                       // of the value that follows
    std::size_t left_out_ = 0, error_ = 0;  // lists that are open and left out
    bool leaves_lists_out_;
};

bool has_doubles(const Json::object_t& members) {
    constexpr std::size_t kFew = 16;
    const std::size_t count = members.size();
    if (count <= kFew) {
        for (std::size_t n = 1; n < count; ++n)
            for (std::size_t before = 0; before < n; ++before)
                if (members.data()[before].first == members.data()[n].first) return true;
        return false;
    }
    std::unordered_set<std::string_view> keys;
    for (const auto& [key, value] : members)
        if (!keys.insert(key).second) return true;
    return false;
}

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
        result.emplace_back(
            key, CheckedJson(value, *file_, place_.empty() ? shortened(key) : place_ + "." + shortened(key)));
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

void merge_doubles(nlohmann::ordered_json::object_t& members) {
    if (!has_doubles(members)) return;
    std::unordered_map<std::string_view, std::size_t> places;
    Json::object_t merged;
    for (auto& [key, value] : members) {
        const auto [known, is_new] = places.try_emplace(key, merged.size());
        if (is_new)
            merged.emplace_back(key, std::move(value));
        else
            merged.data()[known->second].second = std::move(value);
    }
    members = std::move(merged);
}

nlohmann::ordered_json parsed_json_text(std::string_view text, JsonLists lists, std::size_t* error) {
    // The parser takes a byte of 0 for the end of the text.
    if (const std::size_t zero = text.find('\0'); zero != text.npos) {
        if (error != nullptr) *error = zero + 1;
        return Json(Json::value_t::discarded);
    }
    Builder builder(lists);
    if (Json::sax_parse(text, &builder)) return builder.take();
    if (error != nullptr) *error = builder.error();
    return Json(Json::value_t::discarded);
}

std::string read_json_text(const std::filesystem::path& file) {
    std::ifstream stream = open_stream(file);
    std::string text, piece(std::size_t(1) << 20, '\0');
    while (stream.read(piece.data(), std::streamsize(piece.size())) || stream.gcount() > 0) {
        text.append(piece, 0, std::size_t(stream.gcount()));
        // No text has one, and a file with a hole may have very many.
        if (text.find('\0', text.size() - std::size_t(stream.gcount())) != text.npos) return text;
    }
    check_reading(stream, file);
    return text;
}

nlohmann::ordered_json parsed_json(const std::filesystem::path& file, JsonLists lists) {
    const std::string text = read_json_text(file);
    std::size_t error = 0;
    Json json = parsed_json_text(text, lists, &error);
    if (!json.is_discarded()) return json;
    if (error == 0) throw Error(ErrorCode::io, file.string() + ": is nested too deeply for a file of nephos");
    const auto end = text.begin() + std::ptrdiff_t(std::min(error, text.size()));
    throw Error(ErrorCode::io, fmt::format("{}: is no JSON, or is damaged: line {} cannot be read",
                                           file.string(), std::count(text.begin(), end, '\n') + 1));
}

}  // namespace nephos
