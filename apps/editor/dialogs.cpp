// SPDX-License-Identifier: Apache-2.0
// Dialogs over the window: files and shortcuts; what waits for an answer.

#include <algorithm>
#include <array>

#include <imgui.h>

#include "apps/editor/field_text.h"
#include "apps/editor/state.h"
#include "apps/nephos/arguments.h"
#include "core/error.h"
#include "core/paths.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

const char* title_of(FileDialog dialog) {
    switch (dialog) {
        case FileDialog::open:
            return "Open a scene";
        case FileDialog::save_as:
            return "Save the scene as";
        case FileDialog::export_grid:
            return "Export the present grid";
        case FileDialog::screenshot:
            return "Save a picture of the window";
        case FileDialog::choose:
            return "Choose a file";
        case FileDialog::none:
            break;
    }
    return "";
}

std::string extension_of(const Editor& editor, FileDialog dialog) {
    if (dialog == FileDialog::choose) return editor.chosen_extension;
    if (dialog == FileDialog::export_grid) return ".vdb";
    return dialog == FileDialog::screenshot ? ".png" : ".toml";
}

// Returns whether the dialog asks for a file that is there.
bool is_reading(FileDialog dialog) { return dialog == FileDialog::open || dialog == FileDialog::choose; }

// Returns whether a file is no scene, but a grid that one can start from.
bool is_grid(const fs::path& path) { return path.extension() == ".vdb"; }

// Does with the chosen file what the dialog was opened for.
bool accept(Editor& editor, const fs::path& path) {
    try {
        switch (editor.dialog) {
            case FileDialog::open:
                if (!fs::is_regular_file(path)) throw Error(ErrorCode::io, path.string() + ": no such file");
                ask_before(editor, Pending::open, path);
                return true;
            case FileDialog::save_as:
                if (!editor.document->has_file() || !is_same_place(path, editor.document->path())) {
                    refuse_to_replace_listed_file(path);
                    for_each_scene(editor, [&](const OpenScene& open) {
                        if (const Scene* const scene = open.document->current_scene())
                            refuse_to_replace_files_of(*scene, path);
                    });
                }
                editor.document->save_as(path);
                note_recent(editor.settings, path);
                keep_settings(editor);
                say(editor, "Saved " + path.string());
                return true;
            case FileDialog::export_grid:
                refuse_own_files(editor, path, true);
                start_export(editor, path);
                return true;
            case FileDialog::screenshot:
                editor.capture_to = path;
                editor.capture_by_user = true;
                return true;
            case FileDialog::choose:
                if (!fs::is_regular_file(path)) throw Error(ErrorCode::io, path.string() + ": no such file");
                editor.take_chosen(path);
                return true;
            case FileDialog::none:
                return true;
        }
    } catch (const std::exception& error) {
        editor.dialog_problem = error.what();
    }
    return false;
}

struct Listed {
    std::string name;
    bool is_folder = false;
};

std::vector<Listed> content_of(const fs::path& folder, const std::string& extension) {
    std::vector<Listed> out;
    std::error_code error;
    for (auto at = fs::directory_iterator(folder, error); !error && at != fs::directory_iterator();
         at.increment(error)) {
        const std::string name = at->path().filename().string();
        std::error_code ignored;  // a link to nowhere is no folder
        const bool is_folder = at->is_directory(ignored);
        if (name.starts_with('.') || (!is_folder && at->path().extension() != extension)) continue;
        out.push_back({name, is_folder});
        if (out.size() >= 5000) break;
    }
    std::ranges::sort(out, [](const Listed& a, const Listed& b) {
        return a.is_folder != b.is_folder ? a.is_folder : a.name < b.name;
    });
    return out;
}

fs::path chosen_path(const Editor& editor) {
    fs::path path = editor.dialog_folder / editor.dialog_name;  // an absolute name stays as it is
    if (path.extension() != extension_of(editor, editor.dialog)) path += extension_of(editor, editor.dialog);
    return path;
}

// Whether writing there would replace a file that is not the scene's own, or that another program has changed.
bool is_asked_first(const Editor& editor, const fs::path& path) {
    std::error_code error;
    if (is_reading(editor.dialog) || !fs::exists(fs::symlink_status(path, error))) return false;
    const bool own = editor.dialog == FileDialog::save_as && editor.document->has_file() &&
                     fs::equivalent(path, editor.document->path(), error);
    return !own || editor.document->is_changed_on_disk();
}

void file_dialog(Editor& editor) {
    const char* title = title_of(editor.dialog);
    if (!ImGui::IsPopupOpen(title)) ImGui::OpenPopup(title);
    const float em = ImGui::GetFontSize();
    ImGui::SetNextWindowSize(ImVec2(34 * em, 27 * em), ImGuiCond_Appearing);
    bool open = true;
    if (!ImGui::BeginPopupModal(title, &open, ImGuiWindowFlags_NoSavedSettings)) {
        editor.dialog = FileDialog::none;
        editor.opens_beside = false;
        return;
    }
    bool accepted = false;
    ImGui::TextWrapped("%s", editor.dialog_folder.string().c_str());
    const bool previews = editor.dialog == FileDialog::choose;
    const float list_width = previews ? 0.58f * ImGui::GetContentRegionAvail().x : 0;
    ImGui::BeginChild("files", ImVec2(list_width, -3.6f * ImGui::GetFrameHeightWithSpacing()), true);
    if (ImGui::Selectable("..")) editor.dialog_folder = editor.dialog_folder.parent_path();
    editor.controls.note("file ..");
    for (const Listed& entry : content_of(editor.dialog_folder, extension_of(editor, editor.dialog))) {
        const std::string label = entry.is_folder ? entry.name + "/" : entry.name;
        if (ImGui::Selectable(label.c_str(), entry.name == editor.dialog_name,
                              ImGuiSelectableFlags_AllowDoubleClick)) {
            if (entry.is_folder) {
                editor.dialog_folder /= entry.name;
            } else {
                editor.dialog_name = entry.name;
                accepted = ImGui::IsMouseDoubleClicked(ImGuiMouseButton_Left);
            }
        }
        editor.controls.note("file " + entry.name);
    }
    ImGui::EndChild();
    if (previews) {
        ImGui::SameLine();
        ImGui::BeginChild("preview", ImVec2(0, -3.6f * ImGui::GetFrameHeightWithSpacing()), true);
        if (!editor.dialog_name.empty()) file_preview(editor, chosen_path(editor));
        ImGui::EndChild();
    }
    ImGui::SetNextItemWidth(-1);
    if (input_text("##name", editor.dialog_name, "name of the file", ImGuiInputTextFlags_EnterReturnsTrue)) {
        accepted = true;
    }
    editor.controls.note("file name");
    const bool named = !editor.dialog_name.empty();
    const fs::path path = named ? chosen_path(editor) : fs::path();
    if (path != editor.replaced) editor.replaced.clear();  // another name: no question any more
    ImGui::TextWrapped("%s", editor.dialog_problem.c_str());
    if (!named) ImGui::BeginDisabled();
    bool replaces = false;
    if (!is_reading(editor.dialog) && !editor.replaced.empty()) {
        replaces = button(editor, "Replace it");
    } else {
        accepted |= button(editor, editor.dialog == FileDialog::open ? "Open"
                                   : is_reading(editor.dialog)       ? "Choose"
                                                                     : "Save");
    }
    if (!named) ImGui::EndDisabled();
    ImGui::SameLine();
    if (button(editor, "Cancel") || ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape))) open = false;
    if (accepted && named && is_asked_first(editor, path)) {
        editor.replaced = path;
        editor.dialog_problem = path.filename().string() + " is there already.";
        accepted = false;
    }
    if ((accepted || replaces) && named && accept(editor, path)) open = false;
    if (!open) {
        const bool before_pending = editor.dialog == FileDialog::save_as && !editor.document->is_modified();
        editor.dialog = FileDialog::none;
        editor.dialog_problem.clear();
        editor.replaced.clear();
        ImGui::CloseCurrentPopup();
        if (editor.pending == Pending::none) editor.opens_beside = false;  // cancelled, or done
        if (before_pending && editor.pending != Pending::none) do_pending(editor);
    }
    ImGui::EndPopup();
}

bool is_anything_unsaved(Editor& editor) {
    bool any = false;
    for_each_scene(editor, [&](OpenScene& scene) {
        scene.document->look_at_disk();
        any |= scene.document->is_modified();
    });
    return any;
}

void shortcuts_window(Editor& editor) {
    if (!editor.show_shortcuts) return;
    static constexpr std::array<std::array<const char*, 2>, 28> kKeys{{
        {"Space", "run or pause"},
        {",   .", "a step back, a step on"},
        {"Home", "back to the start"},
        {"Left mouse button", "turn round what is looked at"},
        {"Right mouse button", "look around"},
        {"Middle mouse button", "shift the view"},
        {"Wheel", "nearer, farther"},
        {"W A S D   Q E", "fly; Shift: four times as fast"},
        {"F", "look at all clouds"},
        {"Double-click, V", "go to the cloud under the mouse"},
        {"L", "the next click is lightning"},
        {"M, B", "set a checkpoint; back to the last one"},
        {"C", "camera of the scene"},
        {"G", "shapes of the scene over the picture"},
        {"1 ... 6", "beauty, density, transmittance, light only, wireframe, voxels"},
        {"Ctrl+N", "new scene"},
        {"Ctrl+O", "open"},
        {"Ctrl+S", "save"},
        {"Ctrl+Shift+S", "save as"},
        {"Ctrl+Z", "undo"},
        {"Ctrl+Y", "redo"},
        {"Ctrl+D", "copy the selected element"},
        {"Delete", "delete the selected element"},
        {"Ctrl+click on a number", "type it"},
        {"Ctrl+R", "run the scene into files"},
        {"F12", "picture of the window"},
        {"F1", "this list"},
        {"Ctrl+Q", "quit"},
    }};
    if (ImGui::Begin("Keys", &editor.show_shortcuts,
                     ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoSavedSettings |
                         ImGuiWindowFlags_NoCollapse)) {
        if (ImGui::BeginTable("keys", 2)) {
            for (const auto& [key, what] : kKeys) {
                ImGui::TableNextRow();
                ImGui::TableNextColumn();
                ImGui::TextUnformatted(key);
                ImGui::TableNextColumn();
                ImGui::TextDisabled("%s", what);
            }
            ImGui::EndTable();
        }
    }
    ImGui::End();
}

}  // namespace

void open_dialog(Editor& editor, FileDialog dialog) {
    editor.dialog = dialog;
    editor.dialog_problem.clear();
    editor.replaced.clear();
    editor.opens_beside = false;
    // Files that keys name are sought from the scene on; where they were found is no place for anything else.
    if (dialog == FileDialog::choose || editor.take_chosen) editor.dialog_folder.clear();
    editor.take_chosen = nullptr;
    std::error_code error;
    if (editor.dialog_folder.empty()) {
        const fs::path start = editor.document->has_file()
                                   ? fs::absolute(editor.document->path(), error).parent_path()
                                   : fs::current_path(error);
        editor.dialog_folder = start;
    }
    const fs::path stem = editor.document->path().stem();
    editor.dialog_name = is_reading(dialog) ? "" : stem.string() + extension_of(editor, dialog);
}

void ask_before(Editor& editor, Pending what, fs::path path) {
    // A field was left for this, and its text refused: it is not lost before that was seen.
    if (is_refusal_unseen(editor)) return;
    const bool beside = what == Pending::open && editor.opens_beside;
    forget_pending(editor);  // what was asked before is asked anew
    editor.opens_beside = beside;
    editor.pending = what;
    editor.pending_path = std::move(path);
    editor.document->look_at_disk();  // it may be gone since
    // Leaves the scene that is shown to what is asked of it: dialogs() goes on with the end of the program.
    const bool is_asked =
        editor.question || editor.dialog != FileDialog::none || !editor.left_autosaves.empty();
    editor.is_put_off = what == Pending::close && is_asked && is_anything_unsaved(editor);
    if (editor.is_put_off) return;
    const bool replaces = !beside && !is_grid(editor.pending_path);
    if (!replaces || !editor.document->is_modified()) do_pending(editor);
}

void forget_pending(Editor& editor) {
    editor.pending = Pending::none;
    editor.is_put_off = false;
    editor.opens_beside = false;
    for_each_scene(editor, [](OpenScene& scene) { scene.is_answered = false; });
}

bool is_asking(const Editor& editor) {
    return editor.pending != Pending::none || editor.question || editor.dialog != FileDialog::none ||
           !editor.left_autosaves.empty();
}

void do_pending(Editor& editor) {
    if (editor.pending == Pending::close && editor.exported) {
        editor.question = {"A grid is being written: " + editor.exported->path.filename().string() + ".",
                           "Wait for it and quit", [&editor] {
                               finish_export(editor);
                               editor.pending = Pending::close;
                               do_pending(editor);
                           }};
        editor.pending = Pending::none;
        return;
    }
    if (editor.pending == Pending::close && editor.run && !editor.run->done) {
        editor.question = {
            "A run into files is under way: out/" + editor.run->folder.filename().string() + ".",
            "Stop it and quit", [&editor] {
                editor.run.reset();  // after the step that it is at; `nephos run --resume --out` goes on
                editor.pending = Pending::close;
                do_pending(editor);
            }};
        editor.pending = Pending::none;
        return;
    }
    const Pending what = std::exchange(editor.pending, Pending::none);
    const bool beside = std::exchange(editor.opens_beside, false);
    const auto open = [&](std::unique_ptr<SceneDocument> document) {
        if (beside) {
            add_scene(editor, std::move(document));
        } else {
            open_document(editor, std::move(document));
        }
    };
    attempt(editor, [&] {
        if (what == Pending::close) {
            for (std::size_t n = 0; n < editor.scenes.size(); ++n) {
                const OpenScene& scene = n == editor.shown ? editor : editor.scenes[n];
                scene.document->look_at_disk();  // a file may have gone while something was asked
                if (scene.is_answered || !scene.document->is_modified()) continue;
                show_scene(editor, n);  // it is asked about next
                editor.pending = Pending::close;
                return;
            }
            editor.quit = true;
        } else if (what == Pending::close_scene) {
            close_scene(editor);
        } else if (what == Pending::new_scene) {
            open_document(editor, std::make_unique<SceneDocument>(first_scene_text()));
        } else if (what == Pending::empty_scene) {
            open_document(editor, std::make_unique<SceneDocument>(empty_scene_text()));
        } else if (what == Pending::open && is_grid(editor.pending_path)) {
            offer_grid(editor, editor.pending_path);
        } else if (what == Pending::open) {
            open(SceneDocument::opened(editor.pending_path, editor.folder));
        }
    });
}

void dialogs(Editor& editor) {
    // One at a time, what was asked last first: popups that open beside each other close each other. The window's
    // own cross may ask while another one is open.
    if (editor.question)
        question_dialog(editor);
    else if (editor.dialog != FileDialog::none)
        file_dialog(editor);
    else if (!editor.left_autosaves.empty())
        recovery_dialog(editor);
    else if (std::exchange(editor.is_put_off, false) && !editor.document->is_modified())
        do_pending(editor);
    else if (editor.pending != Pending::none)
        unsaved_dialog(editor);  // until it is answered, whatever becomes of the file meanwhile
    run_window(editor);
    generation_window(editor);
    shortcuts_window(editor);
}

}  // namespace nephos
