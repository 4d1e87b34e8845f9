// SPDX-License-Identifier: Apache-2.0
// Changes of the document, and the document itself: opened, saved. Nothing here lets an exception out: what goes wrong
// is said, and the edits that were made stay.

#include <exception>
#include <utility>

#include <imgui.h>

#include "apps/editor/state.h"
#include "apps/editor/wind_level.h"

namespace nephos {

bool attempt(Editor& editor, const std::function<void()>& act) {
    try {
        act();
        return true;
    } catch (const std::exception& error) {
        say(editor, error.what(), true);
        return false;
    }
}

bool change_text(Editor& editor, const TextEdit& edit, const std::string& what, const std::string& merge) {
    if (editor.document->has_syntax_error()) {
        say(editor, "Nothing is changed while the text has a syntax error: mend it in the tab Text, or undo",
            true);
        return false;
    }
    return attempt(editor, [&] { editor.document->edit(edit(editor.document->text()), what, merge); });
}

void set_value(Editor& editor, const TextPath& path, const std::string& value, bool dragging,
               NumberForm form) {
    const bool is_at_work =
        ImGui::IsAnyItemActive() || (editor.recorded_value && editor.recorded_value->path == path);
    if (is_recorded_when_left(editor, path) && is_at_work) {
        const bool goes_on = editor.recorded_value && editor.recorded_value->path == path;
        if (goes_on) {
            editor.recorded_value->value = value;
        } else {
            std::optional<std::string> before;
            if (value_now(editor, path)) before = editor.values_now[path_text(path)];
            editor.recorded_value = {path, value, form, before};
        }
        return;
    }
    set_values(editor, TextPath(path.begin(), path.end() - 1), {{path.back().name, value}}, dragging, form);
}

void finish_recorded_value(Editor& editor) {
    if (!editor.recorded_value || ImGui::IsAnyItemActive()) return;
    const Editor::RecordedValue done = *std::exchange(editor.recorded_value, std::nullopt);
    bool is_other = false;  // not where it was changed back
    attempt(editor, [&] {
        const std::string& text = editor.document->text();
        is_other = done.before ? *done.before != done.value
                               : with_value(text, recorded_place(editor, done.path).value_or(done.path),
                                            done.value, done.form) != text;
    });
    if (is_other)
        set_values(editor, TextPath(done.path.begin(), done.path.end() - 1),
                   {{done.path.back().name, done.value}}, false, done.form);
}

void set_values(Editor& editor, const TextPath& table, const std::vector<TextEntry>& entries, bool dragging,
                NumberForm form) {
    TextPath path = table;
    path.push_back({entries.front().first, 0});
    const std::optional<TextPath> place = recorded_place(editor, path);
    if (!place)
        return say(editor,
                   entries.front().second + " of " + path_text(path) +
                       " is not set: another key frame holds at this step, which has no level at that height",
                   true);
    path = *place;
    const std::string name = path_text(path);
    const auto changed = [&](std::string text) {
        for (const auto& [key, value] : entries) {
            path.back().name = key;
            text = with_value_of_wind(text, editor.document->values(), path, value, form);
        }
        return text;
    };
    if (is_kept_from_recording(editor, path)) {
        return say(editor,
                   entries.front().second + " of " + name +
                       " is not set, as it cannot be recorded while the text has problems: switch "
                       "\"Record as key frames\" off, or mend them",
                   true);
    }
    bool recorded = false;
    if (is_recorded(editor, path) && !editor.document->has_syntax_error()) {
        const bool tried =
            attempt(editor, [&] { recorded = record_live(editor, path, changed(editor.document->text())); });
        if (!tried) return;
    }
    if (!recorded) change_text(editor, changed, "Change " + name, dragging ? name : "");
}

void open_document(Editor& editor, std::unique_ptr<SceneDocument> document) {
    if (editor.document) editor.document->remove_autosave();
    OpenScene next;  // nothing of the scene before is left but how it is looked at
    next.document = std::move(document);
    next.live = std::move(editor.live);
    next.speed = editor.speed;
    next.view = editor.view;
    next.view.hidden.clear();
    static_cast<OpenScene&>(editor) = std::move(next);
    editor.flash_on_click = false;
    editor.live->clear();  // until the scene of the new one is there, which may have problems
    editor.window->clear_picture();
    editor.live->run(editor.running);
    if (editor.document->has_file()) {
        note_recent(editor.settings, editor.document->path());
        keep_settings(editor);
    }
    editor.left_autosaves = editor.document->left_autosaves(editor.folder);
}

bool save_document(Editor& editor) {
    const auto save = [&editor] {
        try {
            editor.document->save();
            note_recent(editor.settings, editor.document->path());
            say(editor, "Saved " + editor.document->path().string());
            return true;
        } catch (const std::exception& error) {
            say(editor, std::string("Not saved: ") + error.what(), true);
            return false;
        }
    };
    if (!editor.document->is_changed_on_disk()) return save();
    editor.question = {editor.document->title() + " was changed by another program since it was read.",
                       "Overwrite it", [&editor, save] {
                           if (save() && editor.pending != Pending::none) do_pending(editor);
                       }};
    return false;
}

void keep_settings(Editor& editor) {
    if (!editor.options.screenshot.empty()) return;  // nobody has set anything
    editor.settings.plots = editor.show_plots;
    editor.settings.shapes = editor.show_gizmos;
    editor.settings.tab = editor.tab;
    try {
        write_settings(editor.folder, editor.settings);
    } catch (const std::exception& error) {
        say(editor, std::string("Settings are not kept: ") + error.what(), true);
    }
}

}  // namespace nephos
