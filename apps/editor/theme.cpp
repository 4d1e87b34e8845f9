// SPDX-License-Identifier: Apache-2.0
// Colours, spacing and font of the interface.

#include <algorithm>
#include <array>
#include <filesystem>

#include "apps/editor/state.h"

namespace nephos {
namespace {

constexpr float kFontPixels = 15;
// Of the package fonts-dejavu-core; without it the font that ImGui brings.
constexpr const char* kFont = "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf";

// Latin, Greek, punctuation, arrows, signs, blocks and shapes.
constexpr std::array<ImWchar, 15> kGlyphs{0x20,   0x17f,  0x370,  0x3ff,  0x2010, 0x2040, 0x2070, 0x209c,
                                          0x2190, 0x22ff, 0x25a0, 0x25ff, 0x2600, 0x2610, 0};

void colours(bool dark) {
    ImGuiStyle& style = ImGui::GetStyle();
    if (dark) {
        ImGui::StyleColorsDark();
        style.Colors[ImGuiCol_WindowBg] = ImVec4(0.118f, 0.129f, 0.145f, 1);
        style.Colors[ImGuiCol_ChildBg] = ImVec4(0, 0, 0, 0);
        style.Colors[ImGuiCol_PopupBg] = ImVec4(0.15f, 0.16f, 0.18f, 0.99f);
        style.Colors[ImGuiCol_FrameBg] = ImVec4(0.20f, 0.215f, 0.24f, 1);
        style.Colors[ImGuiCol_FrameBgHovered] = ImVec4(0.25f, 0.28f, 0.32f, 1);
        style.Colors[ImGuiCol_FrameBgActive] = ImVec4(0.27f, 0.32f, 0.39f, 1);
        style.Colors[ImGuiCol_MenuBarBg] = ImVec4(0.095f, 0.105f, 0.12f, 1);
        style.Colors[ImGuiCol_Button] = ImVec4(0.22f, 0.26f, 0.32f, 1);
        style.Colors[ImGuiCol_ButtonHovered] = ImVec4(0.27f, 0.37f, 0.50f, 1);
        style.Colors[ImGuiCol_ButtonActive] = ImVec4(0.23f, 0.45f, 0.70f, 1);
        style.Colors[ImGuiCol_Header] = ImVec4(0.20f, 0.31f, 0.44f, 1);
        style.Colors[ImGuiCol_HeaderHovered] = ImVec4(0.23f, 0.36f, 0.52f, 1);
        style.Colors[ImGuiCol_Text] = ImVec4(0.90f, 0.92f, 0.94f, 1);
        style.Colors[ImGuiCol_TextDisabled] = ImVec4(0.56f, 0.60f, 0.65f, 1);
    } else {
        ImGui::StyleColorsLight();
        style.Colors[ImGuiCol_WindowBg] = ImVec4(0.955f, 0.96f, 0.965f, 1);
        style.Colors[ImGuiCol_ChildBg] = ImVec4(0, 0, 0, 0);
        style.Colors[ImGuiCol_FrameBg] = ImVec4(1, 1, 1, 1);
        style.Colors[ImGuiCol_FrameBgHovered] = ImVec4(0.90f, 0.94f, 0.99f, 1);
        style.Colors[ImGuiCol_MenuBarBg] = ImVec4(0.89f, 0.90f, 0.91f, 1);
        style.Colors[ImGuiCol_Button] = ImVec4(0.84f, 0.87f, 0.91f, 1);
        style.Colors[ImGuiCol_ButtonHovered] = ImVec4(0.70f, 0.82f, 0.96f, 1);
        style.Colors[ImGuiCol_Header] = ImVec4(0.72f, 0.83f, 0.96f, 1);
        style.Colors[ImGuiCol_TextDisabled] = ImVec4(0.42f, 0.45f, 0.49f, 1);
        style.Colors[ImGuiCol_Border] = ImVec4(0.72f, 0.74f, 0.77f, 1);
    }
}

}  // namespace

void apply_theme(Editor& editor) {
    float scale = editor.options.scale > 0 ? float(editor.options.scale) : editor.settings.scale;
    if (scale <= 0) scale = editor.window->content_scale();
    scale = std::clamp(scale, kSmallestTextScale, kLargestTextScale);
    ImGuiStyle& style = ImGui::GetStyle();
    style = ImGuiStyle();
    style.WindowRounding = 0;
    style.FrameRounding = 3;
    style.GrabRounding = 3;
    style.PopupRounding = 4;
    style.WindowBorderSize = 0;
    style.FrameBorderSize = editor.settings.dark ? 0.0f : 1.0f;
    style.WindowPadding = ImVec2(9, 8);
    style.FramePadding = ImVec2(6, 3.5f);
    style.ItemSpacing = ImVec2(7, 5);
    style.IndentSpacing = 15;
    style.ScrollbarSize = 13;
    colours(editor.settings.dark);
    style.ScaleAllSizes(scale);
    style.WindowMinSize = ImVec2(1, 1);  // the least that ImGui takes
    ImFontAtlas& fonts = *ImGui::GetIO().Fonts;
    fonts.Clear();
    const float pixels = std::floor(kFontPixels * scale);
    if (std::filesystem::exists(kFont)) {
        fonts.AddFontFromFileTTF(kFont, pixels, nullptr, kGlyphs.data());
    } else {
        ImFontConfig config;
        config.SizePixels = std::floor(13 * scale);
        fonts.AddFontDefault(&config);
    }
    editor.window->rebuild_fonts();
}

}  // namespace nephos
