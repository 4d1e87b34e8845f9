// SPDX-License-Identifier: Apache-2.0
#include "simulation/sealed_json.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "simulation/checked_json.h"

namespace nephos {
namespace {

// What follows the last other member, but for the checksum itself.
constexpr std::string_view kBefore = ",\n  \"xxh3\": \"", kAfter = "\"\n}\n";
constexpr std::size_t kDigits = 32;

std::string seal_text(const std::string& digits) { return fmt::format("{}{}{}", kBefore, digits, kAfter); }

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
    const nlohmann::ordered_json json = parsed_json_text(text, JsonLists::left_out);
    if (json.is_object() && !json.contains(kSealKey)) return Seal::none;
    constexpr std::size_t kSize = kBefore.size() + kDigits + kAfter.size();
    if (text.size() < kSize) return Seal::broken;
    const std::string_view before = std::string_view(text).substr(0, text.size() - kSize);
    Digest digest;
    digest.add(before);
    return text.substr(before.size()) == seal_text(digest) ? Seal::whole : Seal::broken;
}

}  // namespace nephos
