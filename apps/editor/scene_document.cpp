// SPDX-License-Identifier: Apache-2.0
#include "apps/editor/scene_document.h"

#include <algorithm>
#include <chrono>
#include <span>
#include <system_error>
#include <utility>

#include "core/atomic_file.h"
#include "core/digest.h"
#include "core/error.h"
#include "core/paths.h"
#include "scenes/format/reader.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostHistoryBytes = 256u << 20;
// Returns nothing where there is no file.
std::optional<FileStamp> stamp_of(const fs::path& path) {
    std::error_code error;
    if (!fs::is_regular_file(path, error)) return std::nullopt;
    const FileStamp stamp = file_stamp(path);
    return stamp == FileStamp{} ? std::nullopt : std::optional(stamp);
}

fs::path without_links(const fs::path& folder) {
    std::error_code error;
    const fs::path absolute = fs::absolute(folder, error);
    const fs::path path = fs::weakly_canonical(absolute, error);
    return error ? normal_path(absolute) : path;
}

// Returns a folder's path as a part of a file's name, or its checksum where that is too long. No two folders have the same.
std::string coded(const fs::path& folder) {
    constexpr std::size_t kLongest = 128;
    std::string out;
    for (const char letter : folder.string()) {
        if (letter == '/')
            out += "%2F";
        else if (letter == '%')
            out += "%25";
        else
            out += letter;
    }
    return out.size() > kLongest ? "%" + digest_of(std::as_bytes(std::span(out))) : out;
}

}  // namespace

SceneDocument::SceneDocument(std::string text, std::string name, fs::path folder)
    : path_(std::move(name)), folder_(std::move(folder)) {
    saved_text_ = text;
    real_folder_ = without_links(folder_);
    history_.push_back({std::move(text), "New"});
    read();
}

SceneDocument::SceneDocument(const fs::path& path) : path_(path), has_file_(true) {
    FileText now = read_file(path);
    saved_text_ = std::move(now.text);
    file_stamp_ = now.stamp;
    real_folder_ = without_links(this->folder());
    history_.push_back({saved_text_, "Open"});
    read();
}

std::unique_ptr<SceneDocument> SceneDocument::opened(const fs::path& path, const fs::path& folder) {
    try {
        return std::make_unique<SceneDocument>(path);
    } catch (const Error&) {
        std::error_code error;
        if (fs::symlink_status(path, error).type() != fs::file_type::not_found) throw;
        auto gone = std::make_unique<SceneDocument>(std::string(), path.string());
        gone->has_file_ = gone->is_gone_ = true;
        gone->real_folder_ = without_links(gone->folder());
        if (gone->left_autosaves(folder).empty()) throw;
        return gone;
    }
}

std::unique_ptr<SceneDocument> SceneDocument::copy_of_saved(std::string name) const {
    auto made = std::make_unique<SceneDocument>(saved_text_, std::move(name), folder());
    made->origin_ = has_file_ ? path_ : origin_;
    made->look_at_origin();
    return made;
}

void SceneDocument::read() {
    ++version_;
    problems_.clear();
    syntax_error_ = true;
    try {
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
        Scene scene = read_scene_text(text(), path_.filename().string(), folder());
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
        end_merging();
        const auto undone = history_.begin() + std::ptrdiff_t(at_) + 1;
        if (!merge.empty()) undone_.assign(undone, history_.end());
        history_.erase(undone, history_.end());
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

void SceneDocument::end_merging() {
    merge_.clear();
    undone_.clear();
}

bool SceneDocument::take_back(const std::string& merge) {
    if (merge.empty() || merge != merge_ || at_ == 0 || at_ + 1 != history_.size()) return false;
    history_bytes_ -= history_.back().text.size();
    history_.pop_back();
    --at_;
    history_.insert(history_.end(), undone_.begin(), undone_.end());
    end_merging();
    read();
    return true;
}

void SceneDocument::undo() {
    if (!can_undo()) return;
    --at_;
    end_merging();
    read();
}

void SceneDocument::redo() {
    if (!can_redo()) return;
    ++at_;
    end_merging();
    read();
}

fs::path SceneDocument::folder() const { return has_file_ ? fs::absolute(path_).parent_path() : folder_; }

// The stamp is taken before the text: a version that is written meanwhile has another one, and is read instead.
SceneDocument::FileText SceneDocument::read_file(const fs::path& path) {
    constexpr int kAttempts = 5;
    FileText now;
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
        now.stamp = stamp_of(path);
        now.text = read_text_file(path, kMaxSceneBytes);
        if (now.text.size() > kMaxSceneBytes)
            throw Error(ErrorCode::io, path.string() + ": too large for a scene");
        if (now.stamp && stamp_of(path) == now.stamp) return now;
    }
    now.stamp.reset();  // it is looked at again
    return now;
}

void SceneDocument::save() { save_as(path_); }

void SceneDocument::save_as(const fs::path& path) {
    write_atomically(path, text());
    const bool moved = !has_file_ || path != path_;
    remove_autosave();
    path_ = path;
    origin_.clear();
    has_file_ = true;
    real_folder_ = without_links(folder());
    is_gone_ = is_in_no_file_ = false;
    saved_text_ = text();
    file_stamp_.reset();
    try {
        const FileText now = read_file(path_);
        if (now.text == saved_text_) file_stamp_ = now.stamp;  // otherwise another program was as quick
    } catch (const Error&) {
        // It was saved; look_at_disk() says what became of it.
    }
    end_merging();
    if (moved) read();  // names of files in it are relative to its folder
}

bool SceneDocument::is_changed_on_disk() const {
    std::error_code error;
    if (!has_file_ || !fs::exists(path_, error)) return false;
    try {
        return read_file(path_).text != saved_text_;
    } catch (const Error&) {
        return true;  // something is there that cannot be read
    }
}

// Keeps in mind that what was saved is in no file any more, also when one is there again.
void SceneDocument::set_gone(bool is_gone) {
    is_gone_ = is_gone;
    is_in_no_file_ |= is_gone && !saved_text_.empty();
}

SceneDocument::Disk SceneDocument::look_at_disk() {
    if (!has_file_) {
        look_at_origin();
        return Disk::same;
    }
    const std::optional<FileStamp> stamp = stamp_of(path_);
    set_gone(!stamp);
    if (is_gone_) return Disk::gone;
    if (stamp == file_stamp_) {
        is_in_no_file_ = false;
        return Disk::same;
    }
    FileText now;
    try {
        now = read_file(path_);
    } catch (const Error&) {
        set_gone(true);
        return Disk::gone;
    }
    if (now.text == saved_text_) {
        is_in_no_file_ = false;
        file_stamp_ = now.stamp;
        return Disk::same;
    }
    if (is_modified()) return Disk::differs;
    take_from_disk(std::move(now));
    return Disk::reloaded;
}

// Looks, for a copy, whether the file of the original still has the text that was saved when it was made.
void SceneDocument::look_at_origin() {
    if (origin_.empty() || saved_text_.empty()) return;
    const std::optional<FileStamp> stamp = stamp_of(origin_);
    if (stamp && stamp == file_stamp_) {
        is_in_no_file_ = false;
        return;
    }
    is_in_no_file_ = true;
    try {
        const FileText now = read_file(origin_);
        if (now.text != saved_text_) return;
        file_stamp_ = now.stamp;
        is_in_no_file_ = false;
    } catch (const Error&) {
        // It is gone, or cannot be read: then no file is known to have it.
    }
}

void SceneDocument::look_whether_gone() {
    if (!has_file_) return look_at_origin();
    set_gone(!stamp_of(path_));
    if (!is_gone_ && is_in_no_file_) is_in_no_file_ = is_changed_on_disk();
}

void SceneDocument::reload() {
    FileText now = read_file(path_);
    const bool is_same = now.text == text();
    take_from_disk(std::move(now));
    if (is_same) read();  // the files that it names may be others
}

void SceneDocument::take_from_disk(FileText now) {
    saved_text_ = std::move(now.text);
    file_stamp_ = now.stamp;
    is_gone_ = is_in_no_file_ = false;
    edit(saved_text_, "Change on disk");
}

fs::path SceneDocument::autosave_folder(const fs::path& folder) const {
    if (has_file_) return this->folder();
    return folder_.empty() ? folder : folder_;
}

// Returns the name of the file of its edits in another folder.
std::string SceneDocument::name_elsewhere() const { return coded(real_folder_) + "%%" + title(); }

void SceneDocument::autosave(const fs::path& folder, const std::string& now) {
    look_whether_gone();
    const bool is_nothing = is_gone_ && now.empty();  // what was left of it was not taken
    if (is_nothing || (now == saved_text_ && !is_gone_ && !is_in_no_file_)) return remove_autosave();
    if (now == autosaved_text_ && autosave_.is_in_place()) return;
    const fs::path beside = autosave_folder(folder);
    try {
        if (beside == folder) create_folders(folder);
        autosave_.write(beside, title(), now);
    } catch (const Error&) {
        if (beside == folder) throw;
        // One cannot write beside it, as beside a scene that is installed or on a full disk.
        bool is_kept = false;
        try {
            create_folders(folder);
            AutosaveFile elsewhere;
            elsewhere.write(folder, name_elsewhere(), now);
            autosave_.remove();  // of earlier edits
            autosave_ = std::move(elsewhere);
            is_kept = true;
        } catch (const Error&) {  // the first one says more
        }
        if (!is_kept) throw;
    }
    autosaved_text_ = now;
}

std::vector<LeftAutosave> SceneDocument::left_autosaves(const fs::path& folder) const {
    const fs::path beside = autosave_folder(folder);
    std::vector<LeftAutosave> left = nephos::left_autosaves(beside, title());
    if (beside != folder) {
        const std::string name = name_elsewhere();
        const std::size_t before = name.size() - title().size();
        for (LeftAutosave& one : nephos::left_autosaves(folder, name)) {
            one.scene.erase(0, before);
            std::error_code error;  // one that has a file is asked about with that
            if (one.scene == title() || !fs::exists(beside / one.scene, error))
                left.push_back(std::move(one));
        }
    }
    std::erase_if(left,
                  [this](const LeftAutosave& one) { return one.problem.empty() && one.text == text(); });
    return left;
}

void SceneDocument::take_autosave(const LeftAutosave& left) {
    AutosaveFile taken;  // where reading fails it is let be
    taken.adopt(left);
    const std::string text = read_file(left.path).text;  // nobody else writes it now
    autosave_.remove();
    autosave_ = std::move(taken);
    autosaved_text_ = text;
    edit(text, "Recover");
}

std::optional<fs::file_time_type> SceneDocument::file_newer_than(const LeftAutosave& left) const {
    if (!has_file_ || !file_stamp_) return std::nullopt;
    const std::chrono::sys_time<std::chrono::nanoseconds> written{
        std::chrono::nanoseconds(file_stamp_->written_ns)};
    const fs::file_time_type time = std::chrono::file_clock::from_sys(written);
    return time > left.time ? std::optional(time) : std::nullopt;
}

}  // namespace nephos
