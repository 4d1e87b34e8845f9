// SPDX-License-Identifier: Apache-2.0
#pragma once

// Unsaved edits in a file beside the scene's: ".sky.toml.autosave". The editor that writes it holds a lock on it (flock)
// as long as it lives, so that no other takes it for that of a crashed session. A name that another file has, whose ever
// it is, is left alone: then the file is ".sky.toml.PID.autosave". Not thread-safe.

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/descriptor.h"

namespace nephos {

// A file that an editor which has ended left behind.
struct LeftAutosave {
    std::filesystem::path path;
    std::filesystem::file_time_type time;
    std::string text;
    std::string problem;  // why it cannot be read; empty: it was
    std::string scene;    // file name of the scene, or of a copy of it that was never saved
    std::uint64_t device = 0, inode = 0;  // of the file, whose name another may get
};

// The file of a document while there are unsaved edits. Its end lets the file be, unlocked.
class AutosaveFile {
  public:
    AutosaveFile() = default;

    bool is_open() const { return file_.get() >= 0; }
    const std::filesystem::path& path() const { return path_; }
    // Returns whether the file is still where it was written.
    bool is_in_place() const;
    // Writes a text, atomically, into the file of this object; when there is none, or another has taken its place, into a
    // new one in `folder` for the scene file `name`. Throws Error(io).
    void write(const std::filesystem::path& folder, const std::string& name, std::string_view text);
    // Goes on with a file that was left behind. Throws Error(io) when another editor has it, or it is gone.
    void adopt(const LeftAutosave& left);
    // Removes the file, if it is still the one that was written.
    void remove();

  private:
    void claim(const std::filesystem::path& folder, const std::string& name);

    std::filesystem::path path_;
    Descriptor file_;
};

// Returns the files in `folder` that ended editors left for the scene file `name`, and for copies of it ("{NAME}-2.toml") that
// are no files themselves; the newest first. Locked and empty ones are none. One that cannot be read is one with a problem.
std::vector<LeftAutosave> left_autosaves(const std::filesystem::path& folder, const std::string& name);

// Returns the scene file ("*.toml") that edits in a file of one of these names are of; empty for other names.
std::string scene_of_autosave(const std::filesystem::path& file);

// Removes such a file. Throws Error(io) when another editor has it, or has written it anew.
void delete_autosave(const LeftAutosave& left);

// Moves it into a scene file of its own beside it, whose name no file has, and returns that name: "{NAME}-recovered.toml"
// for the scene file "{NAME}.toml". Throws Error(io).
std::filesystem::path keep_autosave(const LeftAutosave& left, const std::filesystem::path& name);

}  // namespace nephos
