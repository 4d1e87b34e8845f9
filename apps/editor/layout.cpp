// SPDX-License-Identifier: Apache-2.0
// Places the panels in the window, and moves the bars between them.

#include <algorithm>
#include <cmath>
#include <functional>

#include "apps/editor/state.h"

namespace nephos {
namespace {

// Without a background: the window itself has the panels' colour, and filling large rectangles is what a software driver
// takes longest for.
ImGuiWindowFlags panel_flags() {
    return ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove |
           ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoSavedSettings |
           ImGuiWindowFlags_NoBringToFrontOnFocus | ImGuiWindowFlags_NoBackground;
}

// A bar between two panels that the mouse moves; `size` and `least` are in points at scale 1.
void splitter(Editor& editor, const char* name, const ImVec2& min, const ImVec2& max, bool vertical,
              float sign, float least, float& size, float scale) {
    ImGui::SetNextWindowPos(min);
    ImGui::SetNextWindowSize(ImVec2(std::max(1.0f, max.x - min.x), std::max(1.0f, max.y - min.y)));
    ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, ImVec2(0, 0));
    ImGui::Begin(name, nullptr, panel_flags() | ImGuiWindowFlags_NoScrollbar);
    ImGui::InvisibleButton("bar", ImVec2(std::max(1.0f, max.x - min.x), std::max(1.0f, max.y - min.y)));
    editor.controls.note(name);
    const bool hot = ImGui::IsItemHovered() || ImGui::IsItemActive();
    if (hot) ImGui::SetMouseCursor(vertical ? ImGuiMouseCursor_ResizeEW : ImGuiMouseCursor_ResizeNS);
    if (hot)
        ImGui::GetWindowDrawList()->AddRectFilled(min, max, ImGui::GetColorU32(ImGuiCol_SeparatorHovered));
    if (ImGui::IsItemActive()) {
        const float by = vertical ? ImGui::GetIO().MouseDelta.x : ImGui::GetIO().MouseDelta.y;
        size = std::clamp(size + sign * by / scale, least, kLargestPanel);
    }
    ImGui::End();
    ImGui::PopStyleVar();
}

void panel(const char* name, const ImVec2& min, const ImVec2& max, ImGuiWindowFlags more,
           const std::function<void()>& fill) {
    if (max.x - min.x < 2 || max.y - min.y < 2) return;
    ImGui::SetNextWindowPos(min);
    ImGui::SetNextWindowSize(ImVec2(max.x - min.x, max.y - min.y));
    if (ImGui::Begin(name, nullptr, panel_flags() | more)) fill();
    ImGui::End();
}

}  // namespace

void layout(Editor& editor, float scale) {
    const ImVec2 size = ImGui::GetIO().DisplaySize;
    const float bar = 5 * scale, top = ImGui::GetFrameHeight(), status = ImGui::GetFrameHeight() + 2 * scale;
    const float room = std::max(1.0f, size.x - 60 * scale);
    float left = std::floor(editor.settings.left * scale), right = std::floor(editor.settings.right * scale);
    if (left + right > room) {  // a narrow window: the picture keeps a third
        const float fit = std::max(0.0f, 0.66f * size.x) / (left + right);
        left = std::floor(left * fit);
        right = std::floor(right * fit);
    }
    if (size.x < 420 * scale) left = right = 0;
    float bottom = std::floor(editor.settings.bottom * scale);
    bottom = std::min(bottom, std::floor(0.45f * size.y));
    if (size.y < 260 * scale) bottom = 0;
    const float low = size.y - status, middle = std::max(top + 1, low - bottom);
    panel("Outline", {0, top}, {left, low}, 0, [&] { outline_panel(editor); });
    panel("Properties", {size.x - right, top}, {size.x, low}, 0, [&] {
        if (ImGui::BeginTabBar("tabs")) {
            const auto tab = [&](const char* name, int number) {
                const bool wanted = editor.wanted_tab == number;
                const bool open = ImGui::BeginTabItem(
                    name, nullptr, wanted ? ImGuiTabItemFlags_SetSelected : ImGuiTabItemFlags_None);
                editor.controls.note(std::string("tab ") + name);
                if (open) editor.tab = number;
                return open;
            };
            const int wanted = editor.wanted_tab;
            if (tab("Properties", 0)) {
                properties_panel(editor);
                ImGui::EndTabItem();
            }
            if (tab("View", 1)) {
                view_options_panel(editor);
                ImGui::EndTabItem();
            }
            if (tab("Text", 2)) {
                text_panel(editor);
                ImGui::EndTabItem();
            }
            if (wanted == editor.wanted_tab) editor.wanted_tab = -1;
            ImGui::EndTabBar();
        }
    });
    if (bottom > 0) {
        panel("Time", {left + (left > 0 ? bar : 0), middle + bar},
              {size.x - right - (right > 0 ? bar : 0), low}, ImGuiWindowFlags_NoScrollbar,
              [&] { timeline_panel(editor); });
    }
    ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, ImVec2(0, 0));
    panel("Picture", {left + (left > 0 ? bar : 0), top},
          {size.x - right - (right > 0 ? bar : 0), bottom > 0 ? middle : low},
          ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoScrollWithMouse,
          [&] { view_panel(editor); });
    ImGui::PopStyleVar();
    if (left > 0)
        splitter(editor, "left bar", {left, top}, {left + bar, low}, true, 1, kLeastLeft,
                 editor.settings.left, scale);
    if (right > 0) {
        splitter(editor, "right bar", {size.x - right - bar, top}, {size.x - right, low}, true, -1,
                 kLeastRight, editor.settings.right, scale);
    }
    if (bottom > 0) {
        splitter(editor, "bottom bar", {left + bar, middle}, {size.x - right - bar, middle + bar}, false, -1,
                 kLeastBottom, editor.settings.bottom, scale);
    }
    ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, ImVec2(9 * scale, 3 * scale));
    panel("Status", {0, low}, {size.x, size.y}, ImGuiWindowFlags_NoScrollbar, [&] { status_bar(editor); });
    ImGui::PopStyleVar();
}

}  // namespace nephos
