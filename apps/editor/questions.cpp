// SPDX-License-Identifier: Apache-2.0
// Questions before something is lost: unsaved edits, those of an earlier session, what would be overwritten.

#include <chrono>
#include <ctime>
#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include <imgui.h>

#include "apps/editor/state.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

std::string time_text(fs::file_time_type time) {
    const auto seconds =
        std::chrono::time_point_cast<std::chrono::seconds>(std::chrono::file_clock::to_sys(time));
    const std::time_t when = std::chrono::system_clock::to_time_t(seconds);
    std::tm local{};
    char text[64] = "";
    if (localtime_r(&when, &local) != nullptr)
        std::strftime(text, sizeof text, "%-d %B %Y, %H:%M:%S", &local);
    return text;
}

// Returns true for a scene whose file is gone, once all that was kept of it is answered.
bool is_nothing_left(const Editor& editor) {
    return editor.left_autosaves.empty() && editor.document->is_gone() && editor.document->text().empty();
}

// Takes the edits that an ended session left, into the scene, or those of a copy of it into a simulation beside it.
void take_edits(Editor& editor, const LeftAutosave& found) {
    if (found.scene != editor.document->title()) {
        auto copy = editor.document->copy_of_saved(found.scene);
        copy->take_autosave(found);
        if (is_nothing_left(editor))
            open_document(editor, std::move(copy));
        else if (!add_scene(editor, std::move(copy)))
            return;
    } else {
        editor.document->take_autosave(found);
    }
    say(editor, "Edits recovered; save to keep them, undo to go back");
}

}  // namespace

void unsaved_dialog(Editor& editor) {
    constexpr const char* kTitle = "Unsaved edits";
    if (!ImGui::IsPopupOpen(kTitle)) ImGui::OpenPopup(kTitle);
    if (!ImGui::BeginPopupModal(kTitle, nullptr,
                                ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoSavedSettings))
        return;
    ImGui::Text(editor.document->is_gone()       ? "The file of %s is gone from the disk."
                : editor.document->is_modified() ? "%s has edits that are not saved."
                                                 : "%s is saved: its file has this text.",
                editor.document->title().c_str());
    editor.controls.note("unsaved " + editor.document->title());
    ImGui::Spacing();
    if (button(editor, "Save them")) {
        if (!editor.document->has_file()) {
            open_dialog(editor, FileDialog::save_as);
            ImGui::CloseCurrentPopup();
        } else if (save_document(editor)) {
            do_pending(editor);
            ImGui::CloseCurrentPopup();
        } else if (editor.question) {
            ImGui::CloseCurrentPopup();
        }
    }
    ImGui::SameLine();
    if (button(editor, "Discard them")) {
        editor.is_answered = true;
        do_pending(editor);
        ImGui::CloseCurrentPopup();
    }
    ImGui::SameLine();
    if (button(editor, "Go on editing") || ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape))) {
        forget_pending(editor);
        ImGui::CloseCurrentPopup();
    }
    ImGui::EndPopup();
}

// One file after the other; what the user decides is done to the file that was found, or said to be gone.
void recovery_dialog(Editor& editor) {
    constexpr const char* kTitle = "Edits of an earlier session";
    if (!ImGui::IsPopupOpen(kTitle)) ImGui::OpenPopup(kTitle);
    if (!ImGui::BeginPopupModal(kTitle, nullptr,
                                ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoSavedSettings))
        return;
    const LeftAutosave found = editor.left_autosaves.front();
    const std::string& title = found.scene;
    const bool is_copy = title != editor.document->title();
    bool answered = false, takes = false;
    if (!found.problem.empty()) {
        ImGui::Text("An earlier session with %s left edits that cannot be read:", title.c_str());
        ImGui::PushTextWrapPos(34 * ImGui::GetFontSize());
        ImGui::TextUnformatted(found.problem.c_str());
        ImGui::PopTextWrapPos();
        editor.controls.note("unreadable edits");
        ImGui::Spacing();
    } else {
        ImGui::Text("An earlier session with %s ended before its edits were saved.", title.c_str());
        if (is_copy) ImGui::Text("It is a copy of %s that has no file.", editor.document->title().c_str());
        ImGui::TextDisabled("The edits are of %s.", time_text(found.time).c_str());
        if (const auto newer = editor.document->file_newer_than(found); newer && !is_copy) {
            ImGui::Text("The file itself is newer: it was written on %s.", time_text(*newer).c_str());
            editor.controls.note("the file is newer");
        }
        ImGui::Spacing();
        takes = button(editor, "Take them",
                       is_copy ? "As a simulation beside this one"
                               : "In place of what the file has; undo goes back to that");
        ImGui::SameLine();
    }
    const std::string there = "As a scene in " + found.path.parent_path().string() + ", to look at later";
    if (button(editor, "Keep them in a file", there.c_str())) {
        attempt(editor, [&] { say(editor, "Kept as " + keep_autosave(found, title).string()); });
        answered = true;
    }
    ImGui::SameLine();
    if (button(editor, "Delete them")) {
        attempt(editor, [&] { delete_autosave(found); });
        answered = true;
    }
    ImGui::SameLine();
    if (button(editor, "Ask again next time", "They stay where they are")) answered = true;
    if (answered || takes) {
        editor.left_autosaves.erase(editor.left_autosaves.begin());
        ImGui::CloseCurrentPopup();
    }
    if (takes) attempt(editor, [&] { take_edits(editor, found); });
    ImGui::EndPopup();
    if (answered && is_nothing_left(editor))
        open_document(editor, std::make_unique<SceneDocument>(first_scene_text()));
}

void question_dialog(Editor& editor) {
    constexpr const char* kTitle = "Are you sure?";
    if (!ImGui::IsPopupOpen(kTitle)) ImGui::OpenPopup(kTitle);
    if (!ImGui::BeginPopupModal(kTitle, nullptr,
                                ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoSavedSettings))
        return;
    ImGui::TextUnformatted(editor.question->text.c_str());
    ImGui::Spacing();
    const bool yes = button(editor, editor.question->yes);
    ImGui::SameLine();
    const bool no = button(editor, "Go back") || ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape));
    if (yes || no) {
        const Question question = std::move(*editor.question);
        editor.question.reset();
        ImGui::CloseCurrentPopup();
        if (no) forget_pending(editor);
        if (yes) attempt(editor, question.act);
    }
    ImGui::EndPopup();
}

}  // namespace nephos
