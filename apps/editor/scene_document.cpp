// SPDX-License-Identifier: Apache-2.0
#include "apps/editor/scene_document.h"

#include <system_error>
#include <utility>

#include "core/atomic_file.h"
#include "core/error.h"
#include "scenes/format/reader.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostHistoryBytes = 256u << 20;
constexpr std::string_view kAutosaveEnd = ".autosave";

std::string read_file(const fs::path& path) {
    std::string text = read_text_file(path, kMaxSceneBytes);
    if (text.size() > kMaxSceneBytes) throw Error(ErrorCode::io, path.string() + ": too large for a scene");
    return text;
}

}  // namespace

SceneDocument::SceneDocument(std::string text, std::string name) : path_(std::move(name)) {
    saved_text_ = text;
    history_.push_back({std::move(text), "New"});
    read();
}

SceneDocument::SceneDocument(const fs::path& path) : path_(path), has_file_(true) {
    saved_text_ = read_file(path);
    history_.push_back({saved_text_, "Open"});
    note_file();
    read();
}

void SceneDocument::read() {
    ++version_;
    problems_.clear();
    syntax_error_ = true;
    try {
        const fs::path folder = has_file_ ? fs::absolute(path_).parent_path() : fs::path();
        Document document;
        const int origin = document.add_origin(path_.filename().string(), text(), true);
        std::optional<Node> parsed = document.parse(origin);
        if (!parsed) {
            problems_ = std::move(document.problems);
            return;
        }
        values_ = std::move(*parsed);
        tree_ = toml_tree(text());
        syntax_error_ = false;
        Scene scene = read_scene_text(text(), path_.filename().string(), folder);
        if (values_.find("name") == nullptr && has_file_) scene.name = path_.stem().string();
        scene_ = std::move(scene);
    } catch (const SceneErrors& errors) {
        problems_ = errors.problems();
    } catch (const std::exception& error) {  // an edit is never lost to what it means
        Problem& problem = problems_.emplace_back();
        problem.where.file = path_.filename().string();
        problem.message = error.what();
    }
}

bool SceneDocument::edit(std::string text, const std::string& what, const std::string& merge) {
    if (text == this->text()) return false;
    const bool merges = !merge.empty() && merge == merge_ && at_ > 0 && at_ + 1 == history_.size();
    if (merges) {
        history_[at_].text = std::move(text);
    } else {
        history_.resize(at_ + 1);
        history_.push_back({std::move(text), what});
        ++at_;
    }
    merge_ = merge;
    history_bytes_ = 0;
    for (const Version& version : history_) history_bytes_ += version.text.size();
    while (history_bytes_ > kMostHistoryBytes && at_ > 1) {
        history_bytes_ -= history_.front().text.size();
        history_.erase(history_.begin());
        --at_;
    }
    read();
    return true;
}

void SceneDocument::undo() {
    if (!can_undo()) return;
    --at_;
    merge_.clear();
    read();
}

void SceneDocument::redo() {
    if (!can_redo()) return;
    ++at_;
    merge_.clear();
    read();
}

void SceneDocument::note_file() {
    std::error_code error;
    const auto time = fs::last_write_time(path_, error);
    file_time_ = error ? std::nullopt : std::optional(time);
}

void SceneDocument::save() { save_as(path_); }

void SceneDocument::save_as(const fs::path& path) {
    write_atomically(path, text());
    const bool moved = !has_file_ || path != path_;
    path_ = path;
    has_file_ = true;
    saved_text_ = text();
    note_file();
    merge_.clear();
    remove_autosave();
    if (moved) read();  // names of files in it are relative to its folder
}

bool SceneDocument::is_changed_on_disk() const {
    if (!has_file_) return false;
    std::error_code error;
    const auto time = fs::last_write_time(path_, error);
    if (error || time == file_time_) return false;
    try {
        return read_file(path_) != saved_text_;
    } catch (const Error&) {
        return true;  // something is there that cannot be read
    }
}

SceneDocument::Disk SceneDocument::look_at_disk() {
    if (!has_file_) return Disk::same;
    std::error_code error;
    const auto time = fs::last_write_time(path_, error);
    if (error) return Disk::gone;
    if (time == file_time_) return Disk::same;
    std::string now;
    try {
        now = read_file(path_);
    } catch (const Error&) {
        return Disk::gone;
    }
    if (now == saved_text_) {
        note_file();
        return Disk::same;
    }
    if (is_modified()) return Disk::differs;
    take_from_disk(std::move(now));
    return Disk::reloaded;
}

void SceneDocument::reload() { take_from_disk(read_file(path_)); }

void SceneDocument::take_from_disk(std::string text) {
    saved_text_ = std::move(text);
    note_file();
    edit(saved_text_, "Change on disk");
}

fs::path SceneDocument::autosave_path(const fs::path& folder) const {
    const fs::path name = "." + path_.filename().string() + std::string(kAutosaveEnd);
    return has_file_ ? fs::absolute(path_).parent_path() / name : folder / name;
}

void SceneDocument::autosave(const fs::path& folder) {
    if (!is_modified()) return remove_autosave();
    if (version_ == autosaved_version_) return;
    const fs::path path = autosave_path(folder);
    write_atomically(path, text());
    autosaved_ = path;
    autosaved_version_ = version_;
}

void SceneDocument::remove_autosave() {
    if (autosaved_.empty()) return;
    std::error_code ignored;  // it may be gone
    fs::remove(autosaved_, ignored);
    autosaved_.clear();
    autosaved_version_ = 0;
}

std::optional<SceneDocument::Autosave> SceneDocument::found_autosave(const fs::path& folder) const {
    Autosave found;
    found.path = autosave_path(folder);
    std::error_code error;
    if (!fs::is_regular_file(found.path, error)) return std::nullopt;
    found.time = fs::last_write_time(found.path, error);
    if (error) return std::nullopt;
    try {
        if (read_file(found.path) == text()) return std::nullopt;  // they were saved after all
    } catch (const Error&) {
        return std::nullopt;
    }
    if (has_file_ && file_time_ && *file_time_ > found.time) found.file_is_newer = file_time_;
    return found;
}

fs::path keep_autosave(const fs::path& autosave) {
    const fs::path scene = autosave.stem().string().substr(1);  // ".sky.toml" without its point
    for (int number = 1;; ++number) {
        const std::string end = number == 1 ? "-recovered" : "-recovered-" + std::to_string(number);
        const fs::path kept =
            autosave.parent_path() / (scene.stem().string() + end + scene.extension().string());
        std::error_code error;
        if (fs::exists(fs::symlink_status(kept, error))) continue;
        fs::rename(autosave, kept, error);
        if (error) throw Error(ErrorCode::io, kept.string() + ": " + error.message());
        return kept;
    }
}

}  // namespace nephos
