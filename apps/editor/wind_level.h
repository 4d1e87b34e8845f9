// SPDX-License-Identifier: Apache-2.0
#pragma once

// The wind of a level in the text of a scene, which has two forms: its components, and as pilots say it,
// where it comes from and its speed. Without window or ImGui.

#include <optional>
#include <string>
#include <string_view>

#include "core/wind.h"
#include "scenes/format/document.h"
#include "scenes/format/toml_edit.h"

namespace nephos {

// Returns whether the wind of a level is given by where it comes from and its speed, or one of the two.
bool is_polar(const Node& level);

// Returns the wind of a level, m/s; 0 where numbers are missing.
Velocity velocity_of(const Node& level);

// Returns the value of `from_deg`, `speed_m_per_s`, `east_m_per_s` or `north_m_per_s` of a wind; nothing for
// other keys.
std::optional<double> value_of_wind(const Velocity& wind, std::string_view key);

// Returns the level of a wind whose number a path leads to, as "wind[0].levels[1].from_deg"; null for other
// paths.
const Node* level_of_wind(const Node& values, const TextPath& path);

// Returns the text with another value at a path, as with_value(). A level whose wind is given in the other
// form than that of the key gets this one: its other number is what the wind was. `values`: of the text.
std::string with_value_of_wind(const std::string& text, const Node& values, const TextPath& path,
                               const std::string& value, NumberForm form);

}  // namespace nephos
