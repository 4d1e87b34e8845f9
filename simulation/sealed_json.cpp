// SPDX-License-Identifier: Apache-2.0
#include "simulation/sealed_json.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "simulation/checked_json.h"

namespace nephos {
namespace {

// Stand around the checksum, after the last other member.
constexpr std::string_view kBefore = ",\n  \"xxh3\": \"", kAfter = "\"\n}\n";
constexpr std::size_t kDigits = 32;

std::string seal_text(const std::string& digits) { return fmt::format("{}{}{}", kBefore, digits, kAfter); }

// Returns the last character of a JSON object before the brace that closes it; 0 for other texts.
char last_of(std::string_view text) {
    constexpr std::string_view kWhite = " \t\r\n";
    const std::size_t brace = text.find_last_not_of(kWhite);
    if (brace == text.npos) return 0;
    const std::size_t last = text.substr(0, brace).find_last_not_of(kWhite);
    return last == text.npos ? '\0' : text[last];
}

}  // namespace

std::string seal_text(const Digest& before) { return seal_text(before.hex()); }

std::string sealed_text(std::string_view object) {
    Digest digest;
    const std::string_view before = object.substr(0, object.rfind("\n}"));
    digest.add(before);
    return std::string(before) + seal_text(digest);
}

Seal seal_of(const std::filesystem::path& list) {
    const std::string text = read_json_text(list);
    constexpr std::size_t kSize = kBefore.size() + kDigits + kAfter.size();
    if (text.size() >= kSize) {
        const std::string_view before = std::string_view(text).substr(0, text.size() - kSize);
        Digest digest;
        digest.add(before);
        if (text.substr(before.size()) == seal_text(digest)) return Seal::whole;
    }
    // The last member of lists of earlier versions is an object or a list, which a text with one byte changed does not become.
    const char last = last_of(text);
    if (last != '}' && last != ']') return Seal::broken;
    const nlohmann::ordered_json json = parsed_json_text(text, JsonLists::left_out);
    return json.is_object() && !json.contains(kSealKey) ? Seal::none : Seal::broken;
}

}  // namespace nephos
