// SPDX-License-Identifier: Apache-2.0
#pragma once

// Common start of all readers of OpenVDB files: a child process opens the archive and sends the results, so that this
// process never parses the file (not installed).

#include <cstddef>
#include <filesystem>
#include <functional>

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

// Returns limits.memory_bytes, or half of the free memory where that is 0.
std::size_t memory_limit(const VdbReadLimits& limits);

}  // namespace nephos
