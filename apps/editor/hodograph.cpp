// SPDX-License-Identifier: Apache-2.0
// The wind of a key frame as a hodograph: a point a height, at the velocity of the air there, north above and east on the
// right. Points can be dragged.

#include <algorithm>
#include <array>
#include <cmath>

#include "apps/editor/schema_values.h"
#include "apps/editor/state.h"
#include "apps/editor/wind_level.h"
#include "core/text.h"
#include "core/wind.h"

namespace nephos {
namespace {

std::vector<TextEntry> entries_of(const Velocity& v, bool polar) {
    const auto tenth = [](double value) { return number_text(std::round(10 * value) / 10); };
    if (!polar) return {{"east_m_per_s", tenth(v.east_m_per_s)}, {"north_m_per_s", tenth(v.north_m_per_s)}};
    return {{"from_deg", number_text(std::round(*value_of_wind(v, "from_deg")))},
            {"speed_m_per_s", tenth(*value_of_wind(v, "speed_m_per_s"))}};
}

// Blue for the lowest height, red for the highest.
ImU32 colour_of(std::size_t level, std::size_t count) {
    const float t = count > 1 ? float(level) / float(count - 1) : 0;
    return IM_COL32(int(80 + 150 * t), int(150 - 50 * t), int(240 - 170 * t), 255);
}

// The path of the key frame that is selected, or one of its levels.
std::optional<TextPath> selected_wind(const Editor& editor) {
    const TextPath& at = editor.selected;
    const std::size_t length = !at.empty() && at[0].name == "wind"                          ? 2
                               : at.size() > 2 && at[0].name == "layer" && at[2].name == "wind" ? 4
                                                                                             : 0;
    if (length == 0 || at.size() < length) return std::nullopt;
    return TextPath(at.begin(), at.begin() + std::ptrdiff_t(length));
}

void rings(ImDrawList& list, const ImVec2& middle, float radius, double most) {
    const ImU32 grey = ImGui::GetColorU32(ImGuiCol_TextDisabled), faint = ImGui::GetColorU32(ImGuiCol_Separator);
    for (int n = 1; n <= 4; ++n) {
        const float r = radius * float(n) / 4;
        list.AddCircle(middle, r, faint, 48);
        char text[24];
        std::snprintf(text, sizeof text, "%g", most * n / 4);
        list.AddText(ImVec2(middle.x + 0.71f * r + 2, middle.y + 0.71f * r - 2), grey, text);
    }
    list.AddLine(ImVec2(middle.x - radius, middle.y), ImVec2(middle.x + radius, middle.y), faint);
    list.AddLine(ImVec2(middle.x, middle.y - radius), ImVec2(middle.x, middle.y + radius), faint);
    list.AddText(ImVec2(middle.x + 3, middle.y - radius), grey, "north");
    list.AddText(ImVec2(middle.x + radius - 2.2f * ImGui::GetFontSize(), middle.y - ImGui::GetFontSize()), grey, "east");
}

}  // namespace

void hodograph(Editor& editor) {
    const std::optional<TextPath> frame = selected_wind(editor);
    if (!frame) return;
    TextPath levels = *frame;
    levels.push_back({"levels", 0});
    const Node* list = value_node(editor.document->values(), levels);
    if (list == nullptr || list->items.empty()) return;
    ImGui::Spacing();
    ImGui::TextDisabled("HODOGRAPH, m/s: where the air goes, a point a height");
    const std::size_t count = list->items.size();
    std::vector<Velocity> winds;
    double fastest = 4;
    for (const Node& level : list->items) {
        winds.push_back(velocity_of(level));
        fastest = std::max(fastest, std::hypot(winds.back().east_m_per_s, winds.back().north_m_per_s));
    }
    static double scale = 0;  // stays while a point is dragged; one mouse
    static std::optional<std::size_t> held;
    if (!ImGui::IsMouseDown(ImGuiMouseButton_Left)) {
        held.reset();
        scale = 8 * std::ceil(1.15 * fastest / 8);
    }
    const float side = std::clamp(ImGui::GetContentRegionAvail().x, 60.0f, 22 * ImGui::GetFontSize());
    const ImVec2 corner = ImGui::GetCursorScreenPos(), middle(corner.x + 0.5f * side, corner.y + 0.5f * side);
    const float radius = 0.47f * side;
    ImGui::InvisibleButton("hodograph", ImVec2(side, side));
    editor.controls.note("hodograph");
    ImDrawList& draw = *ImGui::GetWindowDrawList();
    draw.AddRectFilled(corner, ImVec2(corner.x + side, corner.y + side), ImGui::GetColorU32(ImGuiCol_FrameBg), 3);
    rings(draw, middle, radius, scale);
    const auto place = [&](const Velocity& v) {
        return ImVec2(middle.x + radius * float(v.east_m_per_s / scale), middle.y - radius * float(v.north_m_per_s / scale));
    };
    const ImVec2 mouse = ImGui::GetIO().MousePos;
    const float knob = 0.42f * ImGui::GetFontSize();
    std::optional<std::size_t> under;
    for (std::size_t n = 0; n < count; ++n) {
        const ImVec2 at = place(winds[n]);
        if (n > 0) draw.AddLine(place(winds[n - 1]), at, ImGui::GetColorU32(ImGuiCol_TextDisabled), 1.5f);
        if (std::hypot(mouse.x - at.x, mouse.y - at.y) < 1.6f * knob) under = n;
        editor.controls.now["hodograph " + std::to_string(n)] = {ImVec2(at.x - knob, at.y - knob),
                                                                 ImVec2(at.x + knob, at.y + knob)};
    }
    for (std::size_t n = 0; n < count; ++n) {
        const ImVec2 at = place(winds[n]);
        draw.AddCircleFilled(at, held == n || under == n ? 1.25f * knob : knob, colour_of(n, count));
        char text[32];
        std::snprintf(text, sizeof text, "%g m", number_in(list->items[n], "height_m"));
        draw.AddText(ImVec2(at.x + knob + 2, at.y - 0.5f * ImGui::GetFontSize()), ImGui::GetColorU32(ImGuiCol_Text), text);
    }
    if (ImGui::IsItemHovered() && ImGui::IsMouseClicked(ImGuiMouseButton_Left)) held = under;
    if (ImGui::IsItemHovered() && !held) tooltip("Drag a point: the wind at that height");
    if (!held || *held >= count || !ImGui::IsMouseDragging(ImGuiMouseButton_Left, 1)) return;
    const Velocity wanted{scale * double((mouse.x - middle.x) / radius), scale * double((middle.y - mouse.y) / radius)};
    TextPath level = levels;
    level.push_back({{}, *held});
    set_values(editor, level, entries_of(wanted, is_polar(list->items[*held])), true);
}

}  // namespace nephos
