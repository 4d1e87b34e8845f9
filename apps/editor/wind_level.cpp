// SPDX-License-Identifier: Apache-2.0
#include "apps/editor/wind_level.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "apps/editor/schema_values.h"
#include "core/text.h"

namespace nephos {
namespace {

constexpr std::array<std::string_view, 2> kPolar{"from_deg", "speed_m_per_s"},
    kComponents{"east_m_per_s", "north_m_per_s"};

bool has_any(const Node& level, const std::array<std::string_view, 2>& keys) {
    return std::ranges::any_of(keys, [&](std::string_view key) { return level.find(key) != nullptr; });
}

}  // namespace

bool is_polar(const Node& level) { return has_any(level, kPolar); }

Velocity velocity_of(const Node& level) {
    if (!is_polar(level)) return {number_in(level, "east_m_per_s"), number_in(level, "north_m_per_s")};
    return velocity_from(number_in(level, "from_deg"), number_in(level, "speed_m_per_s"));
}

std::optional<double> value_of_wind(const Velocity& wind, std::string_view key) {
    if (key == "east_m_per_s") return wind.east_m_per_s;
    if (key == "north_m_per_s") return wind.north_m_per_s;
    const double speed = std::hypot(wind.east_m_per_s, wind.north_m_per_s);
    if (key == "speed_m_per_s") return speed;
    if (key != "from_deg") return std::nullopt;
    if (speed == 0) return 0;
    constexpr double kRadians = std::numbers::pi / 180;  // per degree
    const double from = std::atan2(-wind.east_m_per_s, -wind.north_m_per_s) / kRadians,
                 turned = from < 0 ? from + 360 : from;
    return turned < 360 ? turned : 0;  // of one that is a little below 0
}

const Node* level_of_wind(const Node& values, const TextPath& path) {
    if (path.size() < 5 || path[path.size() - 5].name != "wind" || path[path.size() - 3].name != "levels" ||
        !value_of_wind({}, path.back().name))
        return nullptr;
    return value_node(values, TextPath(path.begin(), path.end() - 1));
}

std::string with_value_of_wind(const std::string& text, const Node& values, const TextPath& path,
                               const std::string& value, NumberForm form) {
    const Node* const level = level_of_wind(values, path);
    if (level == nullptr) return with_value(text, path, value, form);
    const bool becomes_polar = std::ranges::count(kPolar, path.back().name) > 0;
    const auto &new_keys = becomes_polar ? kPolar : kComponents,
               &old_keys = becomes_polar ? kComponents : kPolar;
    if (has_any(*level, new_keys) || !has_any(*level, old_keys)) return with_value(text, path, value, form);
    constexpr int kDigits = 10;
    TextPath at = path;
    std::string out = text;
    for (const std::string_view key : old_keys) {
        at.back().name = key;
        out = without(out, at);
    }
    for (const std::string_view key : new_keys) {
        at.back().name = key;
        out = with_value(
            out, at,
            key == path.back().name ? value : number_text(*value_of_wind(velocity_of(*level), key), kDigits),
            form);
    }
    return out;
}

}  // namespace nephos
