// SPDX-License-Identifier: Apache-2.0
// Simulations (T, figures 26 and 27): scenes that are open together, each with a simulation of its own that runs or
// pauses on its own; one is shown. And the layers of the shown one.

#include <algorithm>
#include <future>
#include <system_error>
#include <utility>

#include <imgui.h>

#include "apps/editor/state.h"

namespace nephos {
namespace {

// Limits the checkpoints of all simulations together.
constexpr std::size_t kCheckpointBytes = std::size_t(1024) << 20;

OpenScene& scene_at(Editor& editor, std::size_t index) {
    return index == editor.shown ? editor : editor.scenes[index];
}

void share_memory(Editor& editor) {
    for_each_scene(
        editor, [&](OpenScene& scene) { scene.live->keep_at_most(kCheckpointBytes / editor.scenes.size()); });
}

// Puts the shown scene to the others.
void put_away(Editor& editor) {
    attempt(editor, [&] { editor.document->autosave(editor.folder); });
    editor.live->show(false);
    editor.scenes[editor.shown] = std::move(static_cast<OpenScene&>(editor));
}

void take_out(Editor& editor, std::size_t index) {
    static_cast<OpenScene&>(editor) = std::move(editor.scenes[index]);
    editor.shown = index;
    editor.live->show(true);
    if (editor.picture) {
        editor.window->set_picture(editor.picture->width, editor.picture->height,
                                   editor.picture->rgba.data());
    } else {
        editor.window->clear_picture();
    }
}

// A name that no open scene has: "{NAME}-2.toml".
std::string unused_title(Editor& editor, const std::filesystem::path& title) {
    for (int number = 2;; ++number) {
        const std::string name =
            title.stem().string() + "-" + std::to_string(number) + title.extension().string();
        bool taken = false;
        for_each_scene(editor, [&](const OpenScene& scene) { taken |= scene.document->title() == name; });
        std::error_code error;  // nor a file beside it, whose edits those of a copy would be taken for
        if (!taken && !std::filesystem::exists(editor.document->folder() / name, error)) return name;
    }
}

using Action = std::function<void()>;

// A row of the list; what was chosen in it is done when the list is drawn.
void simulation_row(Editor& editor, std::size_t index, Action& chosen) {
    OpenScene& scene = scene_at(editor, index);
    const std::string number = std::to_string(index + 1);
    const LiveStatus status = scene.live->status();
    ImGui::PushID(int(index));
    if (ImGui::SmallButton(scene.running ? "||##runs" : ">##runs"))
        scene.live->run(scene.running = !scene.running);
    editor.controls.note("run simulation " + number);
    tooltip_of_last(scene.running ? "Pause this simulation" : "Let this simulation run");
    ImGui::SameLine();
    const float end = ImGui::GetContentRegionMax().x - 1.5f * ImGui::GetFontSize();
    const std::string name = (scene.document->is_modified() ? "\u2022 " : "") + scene.document->title();
    const ImVec2 from = ImGui::GetCursorScreenPos();
    const float width = std::max(1.0f, end - ImGui::GetCursorPosX() - 4.5f * ImGui::GetFontSize());
    ImGui::PushClipRect(from, ImVec2(from.x + width, from.y + ImGui::GetFrameHeight()), true);
    const bool clicked =
        ImGui::Selectable(name.c_str(), index == editor.shown, ImGuiSelectableFlags_None, ImVec2(width, 0));
    ImGui::PopClipRect();
    if (clicked) chosen = [&editor, index] { show_scene(editor, index); };
    editor.controls.note("simulation " + number);
    tooltip_of_last(scene.document->has_file() ? scene.document->path().string().c_str() : "not saved yet");
    ImGui::SameLine(end - 4.2f * ImGui::GetFontSize());
    const bool shows_picture = index == editor.shown && scene.running && scene.picture;
    ImGui::TextDisabled("%llu",
                        static_cast<unsigned long long>(shows_picture ? scene.picture->step : status.step));
    tooltip_of_last("The step that it is at");
    if (editor.scenes.size() > 1) {
        ImGui::SameLine(end);
        if (ImGui::SmallButton("\u00d7")) {
            chosen = [&editor, index] {
                show_scene(editor, index);
                ask_before(editor, Pending::close_scene);
            };
        }
        editor.controls.note("delete simulation " + number);
        tooltip_of_last("Close this simulation and its scene; files stay");
    }
    ImGui::PopID();
}

void list_buttons(Editor& editor, Action& chosen) {
    const auto small = [&](const char* label, const char* name, const char* hint) {
        const bool pressed = ImGui::SmallButton(label);
        editor.controls.note(name);
        tooltip_of_last(hint);
        return pressed;
    };
    if (small("New", "new simulation", "A new scene beside those that are open"))
        chosen = [&editor] {
            add_scene(editor, std::make_unique<SceneDocument>(first_scene_text(),
                                                              unused_title(editor, "untitled.toml")));
        };
    ImGui::SameLine();
    if (small("Copy", "copy simulation", "A copy of the shown scene, to vary it: both run"))
        chosen = [&editor] { copy_scene(editor); };
    ImGui::SameLine();
    if (small("Open...", "open simulation", "A scene from a file beside those that are open")) {
        chosen = [&editor] {
            open_dialog(editor, FileDialog::open);
            editor.opens_beside = true;
        };
    }
    if (editor.scenes.size() < 2) return;
    bool any_runs = false;
    for_each_scene(editor, [&](const OpenScene& scene) { any_runs |= scene.running; });
    ImGui::SameLine();
    if (small(any_runs ? "Pause all" : "Run all", "run all simulations", "Pause or run all simulations")) {
        for_each_scene(editor, [&](OpenScene& scene) { scene.live->run(scene.running = !any_runs); });
    }
}

}  // namespace

void for_each_scene(Editor& editor, const std::function<void(OpenScene&)>& act) {
    for (std::size_t n = 0; n < editor.scenes.size(); ++n) act(scene_at(editor, n));
}

bool add_scene(Editor& editor, std::unique_ptr<SceneDocument> document) {
    if (editor.scenes.size() >= kMostScenes) {
        say(editor,
            "There are " + std::to_string(kMostScenes) + " simulations open, and there is room for no more",
            true);
        return false;
    }
    auto live = std::make_unique<LiveScene>(DeviceOptions{.splatting = Splatting::cpu});  // may fail
    editor.scenes.emplace_back().live = std::move(live);
    put_away(editor);
    take_out(editor, editor.scenes.size() - 1);
    share_memory(editor);
    open_document(editor, std::move(document));
    return true;
}

void show_scene(Editor& editor, std::size_t index) {
    if (index == editor.shown || index >= editor.scenes.size()) return;
    put_away(editor);
    take_out(editor, index);
}

void copy_scene(Editor& editor) {
    const std::string title = unused_title(editor, editor.document->title());
    const bool runs = editor.running;
    const std::uint64_t step = editor.live->status().step;
    // Edits that are not saved are not saved in the copy either.
    auto copy = editor.document->copy_of_saved(title);
    copy->edit(editor.document->text(), "Copy");
    if (!add_scene(editor, std::move(copy))) return;
    editor.start_step = step;
    editor.live->run(editor.running = runs);
}

void close_scene(Editor& editor) {
    if (editor.scenes.size() < 2) return;
    editor.document->remove_autosave();
    // Its threads may be in the middle of a step: they end beside the window.
    try {
        editor.closing.push_back(
            std::async(std::launch::async, [live = std::move(editor.live)]() mutable { live.reset(); }));
    } catch (const std::system_error&) {  // no thread is to be had: they have ended here
    }
    std::erase_if(editor.closing, [](const std::future<void>& one) {
        return one.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
    });
    editor.scenes.erase(editor.scenes.begin() + std::ptrdiff_t(editor.shown));
    take_out(editor, std::min(editor.shown, editor.scenes.size() - 1));
    share_memory(editor);
}

void simulations_list(Editor& editor) {
    ImGui::TextDisabled("SIMULATIONS");
    Action chosen;
    for (std::size_t n = 0; n < editor.scenes.size(); ++n) simulation_row(editor, n, chosen);
    list_buttons(editor, chosen);
    ImGui::Spacing();
    ImGui::Separator();
    if (chosen) attempt(editor, chosen);
}

void layers_list(Editor& editor) {
    if (!editor.shown_scene || editor.shown_scene->layers.empty()) return;
    ImGui::Spacing();
    ImGui::TextDisabled("LAYERS THAT RUN");
    const std::vector<LayerOptions>& layers = editor.shown_scene->layers;
    editor.view.hidden.resize(layers.size(), false);
    const LiveStep* step = nullptr;
    if (editor.picture && editor.picture->step < editor.steps.size())
        step = &editor.steps[editor.picture->step];
    if (!ImGui::BeginTable("layers", 5, ImGuiTableFlags_SizingStretchProp)) return;
    for (const char* heading : {"layer", "state", "clouds", "cover", "rain"})
        ImGui::TableSetupColumn(heading);
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
