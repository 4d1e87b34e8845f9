// SPDX-License-Identifier: Apache-2.0
#pragma once

// Folders that outlive a power cut, and paths without "..". Thread-safe.

#include <filesystem>

namespace nephos {

// Creates a folder and those above it that are missing, and flushes each into the one that holds it: files that are flushed
// later are not lost with their folder. Does nothing where the folder is there. Throws Error(io) naming `folder`.
void create_folders(const std::filesystem::path& folder);

// Returns whether something stands at a path, links not followed. Throws ReadFailure where the system cannot say.
bool stands_there(const std::filesystem::path& path);

// Returns the path without "." and "..": by its text where that leads to the same file as the system's way, otherwise, where
// ".." goes back through a link, with the links of its folder resolved. Where nothing is there it is by its text.
std::filesystem::path normal_path(const std::filesystem::path& path);

}  // namespace nephos
