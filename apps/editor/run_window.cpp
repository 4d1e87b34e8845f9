// SPDX-License-Identifier: Apache-2.0
// `nephos run` beside the window.

#include <filesystem>

#include <imgui.h>

#include "apps/editor/state.h"
#include "core/text.h"
#include "simulation/run_folder.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

void start_run(Editor& editor) {
    auto run = std::make_unique<BackgroundRun>();
    BackgroundRun& state = *run;
    const Scene& of_text = *editor.document->current_scene();
    state.folder = fs::path("out") / of_text.name;
    state.thread = std::thread([&state, scene = of_text, file = editor.document->path().string()] {
        std::string result, failure;
        bool is_complete = false;
        try {
            RunSettings settings = run_settings(scene, file);
            settings.folder = state.folder;
            settings.device.splatting = scene.frames.splatting;
            settings.device.device = scene.frames.device;
            RunObserver observer;
            observer.stop = [&state] { return state.stop.load(); };
            observer.progress = [&state](const RunProgress& progress) {
                const std::scoped_lock lock(state.mutex);
                state.fraction =
                    progress.steps_in_all > 0 ? double(progress.steps) / double(progress.steps_in_all) : 0;
                state.phase = std::string(progress.phase) + ": step " + std::to_string(progress.steps) + "/" +
                              std::to_string(progress.steps_in_all) + ", frame " +
                              std::to_string(progress.frames) + "/" + std::to_string(progress.frames_in_all);
            };
            const RunReport report = run_scene(std::move(settings), observer);
            is_complete = report.complete;
            result = is_complete ? "complete: " + std::to_string(report.frames) + " frames in " +
                                       report.folder.string()
                                 : "stopped; `nephos run --resume --out " +
                                       shell_word(report.folder.string()) + "` goes on";
        } catch (const std::exception& error) {
            failure = error.what();
        }
        const std::scoped_lock lock(state.mutex);
        state.result = result;
        state.failure = failure;
        if (is_complete) state.fraction = 1;
        state.done = true;
    });
    editor.run = std::move(run);
}

}  // namespace

void run_window(Editor& editor) {
    if (!editor.show_run) return;
    const float em = ImGui::GetFontSize();
    // As high as what it shows, which grows once the run begins.
    ImGui::SetNextWindowSizeConstraints(ImVec2(32 * em, 0), ImVec2(32 * em, 32 * em));
    if (ImGui::Begin("Run the scene", &editor.show_run,
                     ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoCollapse |
                         ImGuiWindowFlags_AlwaysAutoResize)) {
        ImGui::TextWrapped(
            "Simulates the whole scene as it stands and writes density grids, pictures and statistics, "
            "as `nephos run` does.");
        ImGui::Spacing();
        const bool is_sound = editor.document->current_scene() != nullptr;
        if (!editor.run && !is_sound) {
            ImGui::TextWrapped("The scene has problems: they come first.");
        } else if (!editor.run) {
            ImGui::Text("into out/%s", editor.document->current_scene()->name.c_str());
            if (button(editor, "Start the run")) attempt(editor, [&] { start_run(editor); });
        } else {
            const std::scoped_lock lock(editor.run->mutex);
            ImGui::ProgressBar(float(editor.run->fraction));
            editor.controls.note("run progress");
            const std::string text = !editor.run->failure.empty()  ? editor.run->failure
                                     : !editor.run->result.empty() ? editor.run->result
                                                                   : editor.run->phase;
            ImGui::TextWrapped("%s", text.c_str());
        }
        if (editor.run && editor.run->done) {
            if (button(editor, "Close the run")) {
                editor.run.reset();
                editor.show_run = false;
            }
        } else if (editor.run && button(editor, "Stop the run")) {
            editor.run->stop = true;
        }
    }
    ImGui::End();
}

}  // namespace nephos
