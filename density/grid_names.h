// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <string_view>

namespace nephos {

// Returns whether the grid of the wind in a VDB file may have this name: some programs take names for paths, and look
// grids up by them, so no other grid has it.
constexpr bool is_name_of_wind(std::string_view name) {
    const auto is_allowed = [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
    };
    constexpr std::size_t kLongest = 60;
    return !name.empty() && name.size() <= kLongest && std::all_of(name.begin(), name.end(), is_allowed) &&
           name != "density" && name != "hum" && name != "act" && name != "cld";
}

inline constexpr std::string_view kExpectedNameOfWind =
    "up to 60 letters, digits or `_` that name no other grid, such as \"velocity\"";

}  // namespace nephos
