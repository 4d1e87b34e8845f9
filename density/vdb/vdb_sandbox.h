// SPDX-License-Identifier: Apache-2.0
#pragma once

// Common start of all readers of OpenVDB files: a child process opens the archive and sends the results, so that this
// process never parses the file (not installed).

#include <cstddef>
#include <filesystem>
#include <functional>
#include <span>

#include "density/vdb/sandbox.h"
#include "density/vdb/vdb_file.h"

namespace nephos {

class VdbArchive;

inline constexpr std::size_t kMaxMetadataText = 1000;  // characters of one text that the child sends

// Runs `child` on the opened archive in the child process and `parent` here on the values that it sends.
// Throws Error(io) naming the path when it is not a readable OpenVDB file, with the child's message.
void in_sandbox(const std::filesystem::path& path, const VdbReadLimits& limits,
                const std::function<void(VdbArchive&, SandboxWriter&)>& child,
                const std::function<void(SandboxReader&)>& parent);

// The same for several files by one child: it reads ahead while `parent` works, called for each file in order with its
// index. Limits of time are those of all files together, of memory that of the largest. Errors name the file that was
// being read. Precondition: at most kMostFilesOfAChild files.
void in_sandbox(std::span<const std::filesystem::path> paths, const VdbReadLimits& limits,
                const std::function<void(VdbArchive&, SandboxWriter&)>& child,
                const std::function<void(SandboxReader&, std::size_t)>& parent);
inline constexpr std::size_t kMostFilesOfAChild = 64;  // all are open at once

// Returns the most memory that reading a file of this size may take, however much its header promises.
std::size_t memory_bound(const std::filesystem::path& path);

// Returns limits.memory_bytes, or half of the free memory where that is 0.
std::size_t memory_limit(const VdbReadLimits& limits);

}  // namespace nephos
