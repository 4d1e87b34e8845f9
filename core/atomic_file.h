// SPDX-License-Identifier: Apache-2.0
#pragma once

// Atomic replacement of files: the content is written under a temporary name in the same folder, flushed to
// the device (fsync), renamed, and the folder flushed. A full disk, a kill or a power cut leaves the old file
// or none, never a part of the new one. All functions are thread-safe for different paths.

#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>

namespace nephos {

// Calls `write` with the path of the temporary file, which `write` must create and close; then renames it to
// `path`. Creates missing parent folders and writes through a symbolic link. Throws Error(io) that names
// `path` and the reason, also where a device, a pipe or a folder is in the place of the file; exceptions of
// `write` pass through. Every failure removes the temporary file.
void write_atomically(const std::filesystem::path& path,
                      const std::function<void(const std::filesystem::path& temporary)>& write);

// Writes content that is in memory; errors as above.
void write_atomically(const std::filesystem::path& path, std::span<const std::byte> content);
void write_atomically(const std::filesystem::path& path, std::string_view content);

// Writes content that is never in memory as a whole: `fill` calls `append` with one piece after the other.
// Errors as above.
using AppendPiece = std::function<void(std::string_view piece)>;
void write_pieces_atomically(const std::filesystem::path& path,
                             const std::function<void(const AppendPiece& append)>& fill);

// Returns the final name of a temporary file of the functions above ("cloud.vdb" for
// ".cloud.part123-456.vdb"), or "" for any other name. A killed process leaves such files behind.
std::string published_name(std::string_view temporary);

}  // namespace nephos
