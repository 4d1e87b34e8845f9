// SPDX-License-Identifier: Apache-2.0
#pragma once

// Folders that outlive a power cut, and paths without "..". Thread-safe.

#include <filesystem>

namespace nephos {

// Creates a folder and those above it that are missing, and flushes each into the one that holds it: files that are flushed
// later are not lost with their folder. Does nothing where the folder is there. Throws Error(io) naming `folder`.
void create_folders(const std::filesystem::path& folder);

// Flushes which files are in a folder to the device. Some file systems cannot, and a folder that may be written but not read
// cannot be opened: there nothing is done. Throws Error(io) naming `reported`.
void flush_folder(const std::filesystem::path& folder, const std::filesystem::path& reported);

// Returns the path without "." and "..": by its text where that leads to the same file as the system's way, otherwise, where
// ".." goes back through a link, with the links of its folder resolved. Where nothing is there it is by its text.
std::filesystem::path normal_path(const std::filesystem::path& path);

}  // namespace nephos
