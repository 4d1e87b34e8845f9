// SPDX-License-Identifier: Apache-2.0
#pragma once

// Folders that outlive a power cut and what they hold, what stands at a path, and paths without "..". Thread-safe.

#include <compare>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace nephos {

// Creates a folder and those above it that are missing, and flushes each into the one that holds it: files that are flushed
// later are not lost with their folder. Does nothing where the folder is there. Throws Error(io) naming `folder`.
void create_folders(const std::filesystem::path& folder);

// Return what stands at a path, links not followed or followed; file_type::not_found for nothing, and behind links in a circle.
// Throw ReadFailure where the system cannot say: then nothing may be taken for missing, or for a file of another kind.
std::filesystem::file_type type_at(const std::filesystem::path& path);
std::filesystem::file_type type_behind(const std::filesystem::path& path);

// Returns whether something stands at a path, links not followed. Throws as these.
bool stands_there(const std::filesystem::path& path);

// Tells files and folders from each other, whatever they are called, as long as they are there.
struct FileIdentity {
    std::uint64_t device = 0, number = 0;
    auto operator<=>(const FileIdentity&) const = default;
};

// Returns the identity of what stands at a path, links followed; nothing as type_behind(). Throws as these.
std::optional<FileIdentity> identity_behind(const std::filesystem::path& path);

// Returns whether two paths, links followed, lead to one file or folder; false where either is not there. Throws as these.
bool is_same_place(const std::filesystem::path& a, const std::filesystem::path& b);

// Returns the names of what a folder holds, sorted; none where there is no folder. Throws ReadFailure, also for links in a circle,
// where it cannot be read to its end: what it holds is then not known, and none of it may be taken for missing.
std::vector<std::string> names_in_folder(const std::filesystem::path& folder);

// Returns the path without "." and "..": by its text where that leads to the same file as the system's way, otherwise, where
// ".." goes back through a link, with the links of its folder resolved. Where nothing is there it is by its text.
std::filesystem::path normal_path(const std::filesystem::path& path);

// Returns the path of a file, and what it becomes as one link after the other is followed, of its folders or of the file itself: all
// lead to it, through the folders that hold it or a link to it. Throws ReadFailure where a link cannot be read.
std::vector<std::filesystem::path> paths_to(const std::filesystem::path& file);

// Returns the folder that holds a file or folder, by the text of its path where that names it.
std::filesystem::path holder_of(const std::filesystem::path& path);

}  // namespace nephos
