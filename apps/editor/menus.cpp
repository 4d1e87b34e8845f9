// SPDX-License-Identifier: Apache-2.0
// Menus, the status bar, and the tabs View and Text.

#include <algorithm>
#include <cmath>

#include <imgui.h>

#include "apps/editor/field_text.h"
#include "apps/editor/state.h"
#include "core/error.h"
#include "scenes/format/warnings.h"

namespace nephos {
namespace {

bool item(Editor& editor, const char* label, const char* keys = nullptr, bool enabled = true,
          bool on = false) {
    const bool chosen = ImGui::MenuItem(label, keys, on, enabled);
    editor.controls.note(std::string("menu ") + label);
    return chosen;
}

bool begin_menu(Editor& editor, const char* label, bool enabled = true) {
    const bool open = ImGui::BeginMenu(label, enabled);
    editor.controls.note(std::string("menu ") + label);
    return open;
}

void file_menu(Editor& editor) {
    if (item(editor, "New", "Ctrl+N")) ask_before(editor, Pending::new_scene);
    if (item(editor, "New, empty")) ask_before(editor, Pending::empty_scene);
    if (item(editor, "Open...", "Ctrl+O")) open_dialog(editor, FileDialog::open);
    if (begin_menu(editor, "Recent", !editor.settings.recent.empty())) {
        const std::vector<std::string> recent = editor.settings.recent;
        for (const std::string& path : recent) {
            if (ImGui::MenuItem(path.c_str())) ask_before(editor, Pending::open, path);
        }
        ImGui::EndMenu();
    }
    if (begin_menu(editor, "Scenes of the folder", !editor.folder_scenes.empty())) {
        for (const std::filesystem::path& path : editor.folder_scenes) {
            if (item(editor, path.filename().string().c_str())) ask_before(editor, Pending::open, path);
        }
        ImGui::EndMenu();
    }
    ImGui::Separator();
    if (item(editor, "Save", "Ctrl+S")) {
        if (editor.document->has_file()) {
            save_document(editor);
        } else {
            open_dialog(editor, FileDialog::save_as);
        }
    }
    if (item(editor, "Save as...", "Ctrl+Shift+S")) open_dialog(editor, FileDialog::save_as);
    if (item(editor, "Reload", nullptr, editor.document->has_file())) {
        const bool reloaded = attempt(editor, [&] { editor.document->reload(); });
        if (reloaded) say(editor, "Read again");
    }
    ImGui::Separator();
    if (item(editor, "Run into files...", "Ctrl+R")) editor.show_run = true;
    if (item(editor, "Export the grid...")) open_dialog(editor, FileDialog::export_grid);
    if (item(editor, "Picture of the window...", "F12")) open_dialog(editor, FileDialog::screenshot);
    ImGui::Separator();
    if (item(editor, "Quit", "Ctrl+Q")) ask_before(editor, Pending::close);
}

void edit_menu(Editor& editor) {
    const std::string undo = "Undo " + editor.document->undo_text() + "###undo",
                      redo = "Redo " + editor.document->redo_text() + "###redo";
    if (ImGui::MenuItem(undo.c_str(), "Ctrl+Z", false, editor.document->can_undo())) editor.document->undo();
    editor.controls.note("menu Undo");
    if (ImGui::MenuItem(redo.c_str(), "Ctrl+Y", false, editor.document->can_redo())) editor.document->redo();
    editor.controls.note("menu Redo");
}

void view_menu(Editor& editor) {
    if (item(editor, "Look at the clouds", "F")) frame_scene(editor);
    if (item(editor, "Camera of the scene", "C")) take_scene_camera(editor);
    if (item(editor, "Keep this camera in the scene", nullptr, editor.camera.moved)) keep_camera(editor);
    ImGui::Separator();
    for (int mode = 0; mode < int(std::size(kViewModes)); ++mode) {
        const std::string key = std::to_string(mode + 1);
        if (item(editor, kViewModes[mode], key.c_str(), true, editor.view.mode == mode))
            editor.view.mode = mode;
    }
    ImGui::Separator();
    if (item(editor, "Shapes over the picture", "G", true, editor.show_gizmos))
        editor.show_gizmos = !editor.show_gizmos;
    if (item(editor, "Plots", nullptr, true, editor.show_plots)) editor.show_plots = !editor.show_plots;
    ImGui::Separator();
    if (item(editor, "Dark", nullptr, true, editor.settings.dark)) {
        editor.settings.dark = true;
        editor.theme_changed = true;
    }
    if (item(editor, "Light", nullptr, true, !editor.settings.dark)) {
        editor.settings.dark = false;
        editor.theme_changed = true;
    }
    if (begin_menu(editor, "Size of text")) {
        for (const float scale : {0.0f, 0.8f, 1.0f, 1.25f, 1.5f, 2.0f}) {
            const std::string label =
                scale == 0 ? "as the display says" : std::to_string(int(100 * scale)) + " %";
            if (item(editor, label.c_str(), nullptr, true, editor.settings.scale == scale)) {
                editor.settings.scale = scale;
                editor.theme_changed = true;
            }
        }
        ImGui::EndMenu();
    }
}

// Where the caret of a problem goes in the text.
void problem_lines(Editor& editor) {
    for (const Problem& problem : editor.document->problems()) {
        ImGui::PushStyleColor(ImGuiCol_Text, ImVec4(0.93f, 0.36f, 0.32f, 1));
        const std::string place = problem.where.line > 0 ? std::to_string(problem.where.line) + ":" +
                                                               std::to_string(problem.where.column) + "  "
                                                         : "";
        ImGui::TextWrapped("%s", (place + problem.message).c_str());
        ImGui::PopStyleColor();
        if (!problem.source_line.empty()) {
            const ImVec2 at = ImGui::GetCursorScreenPos();
            ImGui::TextDisabled("%s", problem.source_line.c_str());
            if (problem.caret > 0) {  // under the character, whatever the width of those before it
                std::size_t byte = 0;
                for (int n = 1; n < problem.caret && byte < problem.source_line.size(); ++n) {
                    ++byte;
                    while (byte < problem.source_line.size() && (problem.source_line[byte] & 0xc0) == 0x80)
                        ++byte;
                }
                const float x = at.x + ImGui::CalcTextSize(problem.source_line.substr(0, byte).c_str()).x;
                const float y = at.y + ImGui::GetTextLineHeight() + 1, size = 0.35f * ImGui::GetFontSize();
                ImGui::GetWindowDrawList()->AddTriangleFilled(
                    ImVec2(x + 0.8f * size, y), ImVec2(x - 0.1f * size, y + size),
                    ImVec2(x + 1.7f * size, y + size), IM_COL32(237, 92, 82, 255));
                ImGui::Dummy(ImVec2(1, size));
            }
        }
        if (!problem.expected.empty()) ImGui::TextWrapped("%s", problem.expected.c_str());
        ImGui::Separator();
    }
}

}  // namespace

void menu_bar(Editor& editor) {
    if (!ImGui::BeginMainMenuBar()) return;
    if (begin_menu(editor, "File")) {
        file_menu(editor);
        ImGui::EndMenu();
    }
    if (begin_menu(editor, "Edit")) {
        edit_menu(editor);
        ImGui::EndMenu();
    }
    if (begin_menu(editor, "View")) {
        view_menu(editor);
        ImGui::EndMenu();
    }
    if (begin_menu(editor, "Help")) {
        if (item(editor, "Keys", "F1")) editor.show_shortcuts = true;
        ImGui::Separator();
        ImGui::TextDisabled("nephos %s", version().c_str());
        ImGui::TextDisabled("window: %s", editor.window->device_name().c_str());
        ImGui::TextDisabled("pictures: %s", editor.live->status().device.c_str());
        ImGui::EndMenu();
    }
    ImGui::EndMainMenuBar();
}

void status_bar(Editor& editor) {
    const LiveStatus status = editor.live->status();
    const std::size_t problems = editor.document->problems().size();
    const ImVec4 red(0.93f, 0.36f, 0.32f, 1);
    const bool fresh = std::chrono::steady_clock::now() - editor.message_time < std::chrono::seconds(12);
    const float rates = 26 * ImGui::GetFontSize();
    const bool refused = fresh && editor.message_is_bad && !editor.message.empty();
    if (problems > 0) {
        const std::string text = refused ? editor.message
                                         : std::to_string(problems) +
                                               (problems == 1 ? " problem: " : " problems: ") +
                                               editor.document->problems().front().message;
        const ImVec2 room(std::max(1.0f, ImGui::GetContentRegionAvail().x - rates), 0);
        if (ImGui::Selectable("##problems", false, 0, room)) editor.wanted_tab = 2;
        const ImVec2 low = ImGui::GetItemRectMin(), high = ImGui::GetItemRectMax();
        const ImVec4 clip(low.x, low.y, high.x, high.y);
        const ImVec2 at(low.x, 0.5f * (low.y + high.y - ImGui::GetFontSize()));
        // Not as its label, in which `##` has a meaning.
        ImGui::GetWindowDrawList()->AddText(nullptr, 0, at, ImGui::GetColorU32(red), text.data(),
                                            text.data() + text.size(), 0, &clip);
        editor.controls.note("problems");
        if (refused) editor.controls.note("refusal");
    } else if (fresh && !editor.message.empty()) {
        if (editor.message_is_bad) ImGui::PushStyleColor(ImGuiCol_Text, red);
        ImGui::TextUnformatted(editor.message.substr(0, 200).c_str());
        if (editor.message_is_bad) {
            ImGui::PopStyleColor();
            editor.controls.note("refusal");
        }
    } else {
        ImGui::TextDisabled(
            "%s", editor.document->has_file() ? editor.document->path().string().c_str() : "not saved yet");
    }
    const auto now = std::chrono::steady_clock::now();
    if (now - editor.rates_time > std::chrono::milliseconds(500)) {
        editor.rates_time = now;
        char text[160];
        std::snprintf(text, sizeof text, "%.0f ms a picture   %.1f ms a step   %.0f frames/s",
                      editor.picture ? editor.picture->draw_ms : 0.0, status.step_ms,
                      double(ImGui::GetIO().Framerate));
        editor.rates = text;
    }
    const float width = ImGui::CalcTextSize(editor.rates.c_str()).x;
    const float at = ImGui::GetWindowWidth() - width - 10;
    if (at < 0.4f * ImGui::GetWindowWidth()) return;
    ImGui::SameLine(at);
    ImGui::TextDisabled("%s", editor.rates.c_str());
    editor.controls.note("rates");
    tooltip_of_last("Where the time goes: drawing, simulating, and the window itself");
}

void view_options_panel(Editor& editor) {
    ImGui::TextDisabled("WHAT THE PICTURE SHOWS");
    for (int mode = 0; mode < int(std::size(kViewModes)); ++mode) {
        if (ImGui::RadioButton(kViewModes[mode], editor.view.mode == mode)) editor.view.mode = mode;
        editor.controls.note(std::string("mode ") + kViewModes[mode]);
    }
    if (editor.view.mode == kVoxels || editor.view.mode == kWireframe) {
        toggle(editor, "hum", editor.view.hum, "Cells with vapour, green");
        ImGui::SameLine();
        toggle(editor, "act", editor.view.act, "Cells in phase transition, orange");
        ImGui::SameLine();
        toggle(editor, "cld", editor.view.cld, "Cells with cloud, red");
        float slab[2] = {float(100 * editor.view.slab_low), float(100 * editor.view.slab_high)};
        ImGui::SetNextItemWidth(-1);
        if (ImGui::DragFloatRange2("##slab", &slab[0], &slab[1], 0.5f, 0, 100, "slab from %.0f %%",
                                   "to %.0f %%")) {
            editor.view.slab_low = std::clamp(double(slab[0]) / 100, 0.0, 0.99);
            editor.view.slab_high = std::clamp(double(slab[1]) / 100, editor.view.slab_low + 0.01, 1.0);
        }
        editor.controls.note("slab");
        tooltip_of_last("Only cells between these fractions of the lattice's height are there");
    }
    toggle(editor, "Detail when nothing moves", editor.view.detail,
           "Noise below the voxel, as frames have it; drafts while something moves are drawn without");
    layers_list(editor);
    ImGui::Spacing();
    ImGui::TextDisabled("CLOUDS FROM BASE MODELS");
    toggle(editor, "Seed boxes", editor.view.debug.boxes, "Edges of the boxes, blue (T, figure 28)");
    toggle(editor, "Centre axes", editor.view.debug.axes, "x red, y green, z blue");
    toggle(editor, "Roots", editor.view.debug.roots, "An arrow for each root, blue");
    toggle(editor, "Light rays", editor.view.debug.rays,
           "Ways of the absorption factor, yellow; red inside of boxes");
    ImGui::Spacing();
    ImGui::TextDisabled("OVER THE PICTURE");
    toggle(editor, "Shapes of the selection", editor.show_gizmos,
           "Lattice, parcels, seeds; handles of the selected one (G)");
    ImGui::SetNextItemWidth(-1);
    if (ImGui::BeginCombo("##slice of", kSliceNames[int(editor.slice_of)])) {
        for (int kind = 0; kind < int(std::size(kSliceNames)); ++kind) {
            if (ImGui::Selectable(kSliceNames[kind], int(editor.slice_of) == kind))
                editor.slice_of = SliceOf(kind);
            editor.controls.note(std::string("choice ") + kSliceNames[kind]);
        }
        ImGui::EndCombo();
    }
    editor.controls.note("slice of");
    tooltip_of_last(
        "A slice of the automaton at one height: its bits, hum green, act orange, cld red, as in the plots; "
        "or the "
        "probabilities of its field, from blue to red for the largest in the slice");
    if (editor.slice_of >= SliceOf::p_hum) ImGui::TextDisabled("red: %.4g per step", editor.slice_most);
    if (editor.slice_of != SliceOf::nothing && editor.slice_cells > 0) {
        // Leaves that of a higher layer as it is, for when that one is shown again.
        int shown = std::min(editor.slice, editor.slice_cells - 1);
        ImGui::SetNextItemWidth(-1);
        if (ImGui::SliderInt("##slice", &shown, 0, editor.slice_cells - 1, "cell %d from below",
                             ImGuiSliderFlags_AlwaysClamp))
            editor.slice = shown;
        editor.controls.note("slice");
    }
    toggle(editor, "Plots below the time line", editor.show_plots);
    ImGui::Spacing();
    ImGui::TextDisabled("CAMERA");
    if (button(editor, "Look at the clouds", "F")) frame_scene(editor);
    ImGui::SameLine();
    if (button(editor, "That of the scene", "C")) take_scene_camera(editor);
    if (button(
            editor, "Keep it in the scene",
            "Writes place and target into [camera]; of a camera with a path, as its key frame at this time"))
        keep_camera(editor);
    double fov = editor.camera.camera.vertical_fov_deg;
    const double low = 5, high = 120;
    ImGui::SetNextItemWidth(-1);
    if (ImGui::SliderScalar("##fov", ImGuiDataType_Double, &fov, &low, &high, "field of view %.0f\u00b0")) {
        editor.camera.camera.vertical_fov_deg = std::clamp(fov, low, high);
        editor.camera.moved = true;
    }
    editor.controls.note("field of view");
    ImGui::Spacing();
    ImGui::TextDisabled("LIVE CHANGES");
    toggle(
        editor, "Record as key frames", editor.record,
        "Changes of wind, climate and sun then act from the present step on, and are written into the scene "
        "as key frames: the saved scene repeats what was seen, bit for bit. Otherwise the scene is simulated "
        "anew.");
    if (editor.shown_scene && !editor.shown_scene->layers.empty()) {
        ImGui::SetNextItemWidth(-1);
        ImGui::SliderFloat("##final state", &editor.final_state, 0, 1, "atmosphere to %.2f",
                           ImGuiSliderFlags_AlwaysClamp);
        editor.controls.note("final state");
        tooltip_of_last("State of the atmosphere that the climate goes to: 0 clear, 1 storm (T, 3.4)");
        ImGui::SetNextItemWidth(-1);
        ImGui::SliderFloat("##duration", &editor.climate_minutes, 1, 120, "within %.0f min of simulated time",
                           ImGuiSliderFlags_AlwaysClamp);
        editor.controls.note("climate duration");
        if (button(editor, "Start the change now",
                   "Writes the change into [climate] as key frames from the present step on")) {
            record_climate(editor, std::round(100.0 * double(editor.final_state)) / 100,
                           60 * std::round(double(editor.climate_minutes)));
        }
    }
    sun_dial(editor, "sun dial in view");
    toggle(editor, "Lightning where I click", editor.flash_on_click,
           "The next click on the picture is a flash at that place, at the step that is shown (L)");
}

void text_panel(Editor& editor) {
    const std::size_t count = editor.document->problems().size();
    const float em = ImGui::GetFontSize();
    if (editor.text_version != editor.document->version()) {
        editor.text_buffer = editor.document->text();
        editor.text_version = editor.document->version();
    }
    const float below = count > 0 ? std::min(14 * em, 0.4f * ImGui::GetContentRegionAvail().y) : 0;
    if (input_lines("##text", editor.text_buffer,
                    ImVec2(-1, ImGui::GetContentRegionAvail().y - below - (count > 0 ? 6 : 0)),
                    ImGuiInputTextFlags_AllowTabInput)) {
        attempt(editor, [&] { editor.document->edit(editor.text_buffer, "Type"); });
        editor.text_version = editor.document->version();
    }
    editor.controls.note("text");
    if (count == 0) return;
    if (ImGui::BeginChild("problems", ImVec2(0, 0))) problem_lines(editor);
    ImGui::EndChild();
}

}  // namespace nephos
