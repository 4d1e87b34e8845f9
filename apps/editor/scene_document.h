// SPDX-License-Identifier: Apache-2.0
#pragma once

// The scene that is edited: its text, what the text means, its history, and its file.
//
// The text is the truth. Every edit makes a new text (scenes/format/toml_edit.h), which is read at once: a scene
// without problems becomes scene(), otherwise problems() says what is wrong and scene() stays the last good one. Undo
// and redo go through the history of texts, so that a walk back ends in the same bytes. Not thread-safe.

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/editor/autosave.h"
#include "core/file_stamp.h"
#include "scenes/format/document.h"
#include "scenes/format/errors.h"
#include "scenes/format/scene.h"
#include "scenes/format/toml_edit.h"

namespace nephos {

class SceneDocument {
  public:
    // A new scene that has never been saved; `text` is its start.
    // Names of files in it are relative to `folder`.
    explicit SceneDocument(std::string text, std::string name = "untitled.toml",
                           std::filesystem::path folder = {});
    // Throws Error(io) when the file cannot be read; a file with problems is opened all the same.
    explicit SceneDocument(const std::filesystem::path& path);
    // As that; a file that is gone is one without text when there are left_autosaves() of it in `folder` or beside it.
    static std::unique_ptr<SceneDocument> opened(const std::filesystem::path& path,
                                                 const std::filesystem::path& folder);

    // Returns a copy without a file, with the text that was saved here. It is_modified() while the file of this one does
    // not have it.
    std::unique_ptr<SceneDocument> copy_of_saved(std::string name) const;

    const std::string& text() const { return history_[at_].text; }
    // As it was opened or saved last.
    const std::string& saved_text() const { return saved_text_; }
    const TomlNode& tree() const { return tree_; }
    // The values of the text, of its last version without syntax errors.
    const Node& values() const { return values_; }
    // The last text without problems as a scene; none when there was none.
    const std::optional<Scene>& last_sound_scene() const { return scene_; }
    const std::vector<Problem>& problems() const { return problems_; }
    // The scene of the text as it is; null while it has problems. What acts on elements of the text takes this one: those of an
    // earlier one may stand elsewhere in it.
    const Scene* current_scene() const { return problems_.empty() && scene_ ? &*scene_ : nullptr; }
    // The text cannot be parsed: values() are those of an earlier one.
    bool has_syntax_error() const { return syntax_error_; }

    // Replaces the text as one step of the history. Edits in a row with the same `merge`, if it is not empty, are one
    // step: those of one drag of a slider. Returns false when nothing changes.
    bool edit(std::string text, const std::string& what, const std::string& merge = {});
    // Ends such a row.
    void end_merging();
    // Takes such a step back as if it had never been, if it is the last one and goes on: what could be done again before can be
    // again. Returns whether it did.
    bool take_back(const std::string& merge);

    bool can_undo() const { return at_ > 0; }
    bool can_redo() const { return at_ + 1 < history_.size(); }
    void undo();
    void redo();
    std::string undo_text() const { return can_undo() ? history_[at_].what : ""; }
    std::string redo_text() const { return can_redo() ? history_[at_ + 1].what : ""; }
    // Rises with every change of the text, also by undo.
    std::uint64_t version() const { return version_; }

    // Returns whether there are edits that no file has: also of a file that is gone, or that has come back with another text.
    bool is_modified() const { return is_gone_ || is_in_no_file_ || text() != saved_text_; }
    bool has_file() const { return has_file_; }
    // Returns whether the file was gone when it was last looked at.
    bool is_gone() const { return is_gone_; }
    const std::filesystem::path& path() const { return path_; }
    // The folder that names of files in the text are relative to; empty: the present one.
    std::filesystem::path folder() const;
    std::string title() const { return path_.filename().string(); }
    // Returns whether the file has another content than when it was read or saved, whatever its time says.
    bool is_changed_on_disk() const;
    // Throw Error(io) naming the file; the file then is as it was.
    void save();
    void save_as(const std::filesystem::path& path);

    // What another program did to the file since it was read or saved.
    enum class Disk { same, reloaded, differs, gone };
    // Reads a file that changed, unless there are unsaved edits (`differs`). The old text can be had again by undo.
    Disk look_at_disk();
    // Only whether it is gone; reads nothing, and so changes no text.
    void look_whether_gone();
    void reload();

    // Writes unsaved edits into a file beside the scene's (autosave.h), in `folder` for one that has none or where one cannot
    // write there; removes that file when there are none. Files that are there already stay as they are. `now`: the text, or what
    // it is about to become. Looks whether the file is gone. Throws Error(io).
    void autosave(const std::filesystem::path& folder, const std::string& now);
    void autosave(const std::filesystem::path& folder) { autosave(folder, text()); }
    void remove_autosave() { autosave_.remove(); }
    // Returns the files of that kind that ended editors left for this scene, with edits that the text does not have, and
    // those that cannot be read; the newest first.
    std::vector<LeftAutosave> left_autosaves(const std::filesystem::path& folder) const;
    // Takes the edits of such a file, as one step of the history, and the file for its own. Throws Error(io).
    void take_autosave(const LeftAutosave& left);
    // When the scene's file was written after such edits: the time of that.
    std::optional<std::filesystem::file_time_type> file_newer_than(const LeftAutosave& left) const;

  private:
    struct Version {
        std::string text, what;
    };
    struct FileText {
        std::string text;
        std::optional<FileStamp> stamp;  // none: the file changed while it was read
    };
    static FileText read_file(const std::filesystem::path& path);
    void read();
    void take_from_disk(FileText now);
    void set_gone(bool is_gone);
    void look_at_origin();
    std::filesystem::path autosave_folder(const std::filesystem::path& folder) const;
    std::string name_elsewhere() const;

    std::vector<Version> history_;
    std::vector<Version> undone_;  // what could be done again before the step that goes on
    std::size_t at_ = 0, history_bytes_ = 0;
    std::string merge_, saved_text_;
    std::filesystem::path path_;
    bool has_file_ = false, is_gone_ = false;  // gone: when it was looked at
    bool is_in_no_file_ = false;  // saved_text_: the file, or that of the original, is gone or another
    std::filesystem::path folder_;         // of one without a file
    std::filesystem::path origin_;         // of a copy without one: the file of the original, if it has one
    std::filesystem::path real_folder_;    // where links led when it was opened or saved
    std::optional<FileStamp> file_stamp_;  // of the version that saved_text_ is; of a copy at its origin
    AutosaveFile autosave_;
    std::string autosaved_text_;
    std::uint64_t version_ = 0;

    TomlNode tree_;
    Node values_;
    std::optional<Scene> scene_;
    std::vector<Problem> problems_;
    bool syntax_error_ = false;
};

}  // namespace nephos
