// SPDX-License-Identifier: Apache-2.0
// The sky as a disc, with the sun in it: north above, east on the right, the zenith in the middle, the horizon a circle,
// twilight around it. The sun is dragged to where it is to be (T, 3.3: the light is moved anywhere, also below the horizon).

#include <algorithm>
#include <cmath>
#include <numbers>

#include "apps/editor/state.h"

namespace nephos {
namespace {

constexpr double kRadians = std::numbers::pi / 180;
constexpr double kLowest_deg = -18, kZenith_deg = 90;

// The distance from the middle, 1 at the rim.
double distance_of(double elevation_deg) {
    return (kZenith_deg - std::clamp(elevation_deg, kLowest_deg, kZenith_deg)) / (kZenith_deg - kLowest_deg);
}

void draw_sky(ImDrawList& list, const ImVec2& middle, float radius) {
    const ImU32 line = ImGui::GetColorU32(ImGuiCol_Separator),
                grey = ImGui::GetColorU32(ImGuiCol_TextDisabled);
    const float horizon = radius * float(distance_of(0));
    list.AddCircleFilled(middle, radius, IM_COL32(24, 30, 52, 255), 64);
    list.AddCircleFilled(middle, horizon, IM_COL32(66, 108, 160, 255), 64);
    for (const double elevation : {30.0, 60.0})
        list.AddCircle(middle, radius * float(distance_of(elevation)), line, 48);
    list.AddLine(ImVec2(middle.x - radius, middle.y), ImVec2(middle.x + radius, middle.y), line);
    list.AddLine(ImVec2(middle.x, middle.y - radius), ImVec2(middle.x, middle.y + radius), line);
    list.AddCircle(middle, horizon, grey, 64, 1.5f);
    const float em = ImGui::GetFontSize();
    const auto write = [&](float x, float y, const char* text) {
        list.AddText(ImVec2(x - 0.5f * ImGui::CalcTextSize(text).x, y - 0.5f * em),
                     IM_COL32(235, 238, 242, 220), text);
    };
    write(middle.x, middle.y - horizon + 0.7f * em, "N");
    write(middle.x, middle.y + horizon - 0.7f * em, "S");
    write(middle.x + horizon - 0.7f * em, middle.y, "E");
    write(middle.x - horizon + 0.7f * em, middle.y, "W");
}

}  // namespace

void sun_dial(Editor& editor, const char* name) {
    if (!editor.shown_scene) return;
    const Sun sun = sun_now(editor);
    const float side = std::clamp(ImGui::GetContentRegionAvail().x, 60.0f, 14 * ImGui::GetFontSize());
    const ImVec2 corner = ImGui::GetCursorScreenPos(), middle(corner.x + 0.5f * side, corner.y + 0.5f * side);
    const float radius = 0.48f * side, knob = 0.5f * ImGui::GetFontSize();
    ImGui::InvisibleButton(name, ImVec2(side, side));
    editor.controls.note(name);
    const bool hovered = ImGui::IsItemHovered(), active = ImGui::IsItemActive();
    ImDrawList& list = *ImGui::GetWindowDrawList();
    draw_sky(list, middle, radius);
    const double distance = radius * distance_of(sun.elevation_deg), azimuth = sun.azimuth_deg * kRadians;
    const ImVec2 at(middle.x + float(distance * std::sin(azimuth)),
                    middle.y - float(distance * std::cos(azimuth)));
    const bool up = sun.elevation_deg > 0;
    list.AddCircleFilled(at, active ? 1.2f * knob : knob,
                         up ? IM_COL32(255, 214, 90, 255) : IM_COL32(196, 118, 82, 255));
    list.AddCircle(at, active ? 1.2f * knob : knob, IM_COL32(20, 20, 20, 200));
    if (hovered && !active) {
        char text[96];
        std::snprintf(text, sizeof text, "%.1f\u00b0 %s the horizon, azimuth %.0f\u00b0\nDrag the sun",
                      std::abs(sun.elevation_deg), up ? "above" : "below", sun.azimuth_deg);
        tooltip(text);
    }
    if (!active) return;
    const ImVec2 mouse = ImGui::GetIO().MousePos;
    const double x = double(mouse.x - middle.x) / radius, y = double(middle.y - mouse.y) / radius;
    const double far = std::min(1.0, std::hypot(x, y));
    const double elevation = kZenith_deg - far * (kZenith_deg - kLowest_deg);
    double turned = far < 1e-3 ? sun.azimuth_deg : std::atan2(x, y) / kRadians;
    turned -= 360 * std::floor(turned / 360);
    move_sun(editor, std::round(2 * elevation) / 2, std::round(turned), true);
}

}  // namespace nephos
