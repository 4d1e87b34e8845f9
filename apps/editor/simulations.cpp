// SPDX-License-Identifier: Apache-2.0
// The simulations that run (T, figure 27): each layer is one, at its height; how it stands, and whether it is shown.

#include <imgui.h>

#include "apps/editor/state.h"

namespace nephos {

void simulations_list(Editor& editor) {
    if (!editor.shown_scene || editor.shown_scene->layers.empty()) return;
    ImGui::Spacing();
    ImGui::TextDisabled("SIMULATIONS");
    const std::vector<LayerOptions>& layers = editor.shown_scene->layers;
    editor.view.hidden.resize(layers.size(), false);
    const LiveStep* step = nullptr;
    if (editor.picture && editor.picture->step < editor.steps.size()) step = &editor.steps[editor.picture->step];
    if (!ImGui::BeginTable("simulations", 5, ImGuiTableFlags_SizingStretchProp)) return;
    for (const char* heading : {"layer", "state", "clouds", "cover", "rain"}) ImGui::TableSetupColumn(heading);
    ImGui::TableHeadersRow();
    for (std::size_t n = 0; n < layers.size(); ++n) {
        ImGui::TableNextRow();
        ImGui::TableNextColumn();
        bool shown = !editor.view.hidden[n];
        const std::string name = layers[n].name.empty() ? "layer " + std::to_string(n + 1) : layers[n].name;
        if (toggle(editor, name + "##simulation", shown, "Shown in the picture; it runs all the same"))
            editor.view.hidden[n] = !shown;
        if (step == nullptr || n >= step->layers.size()) continue;
        const LayerStep& now = step->layers[n];
        ImGui::TableNextColumn();
        ImGui::Text("%.2f", now.state);
        ImGui::TableNextColumn();
        ImGui::Text("%zu", now.clouds);
        ImGui::TableNextColumn();
        ImGui::Text("%.0f %%", 100 * now.statistics.cover);
        ImGui::TableNextColumn();
        if (now.rain_areas > 0) {
            ImGui::Text("%.1f", now.rain_mm_per_h);
            tooltip_of_last("mm an hour, of the strongest area");
        }
    }
    ImGui::EndTable();
}

}  // namespace nephos
