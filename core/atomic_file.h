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

// Creates an empty temporary file whose name nobody can foresee, calls `write` with its path, which `write` must
// open, fill and close; then publishes it. A file or link that somebody else put in its place meanwhile is refused.
// Missing parent folders are created. A symbolic link keeps pointing to the new file; a device, a pipe or a
// folder in the place of the file is refused. On any failure the temporary file is removed and Error(io)
// names `path` and the reason; what `write` throws passes through.
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
