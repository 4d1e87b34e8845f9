// SPDX-License-Identifier: Apache-2.0
#pragma once

// How every reader of OpenVDB files begins: a child process opens the archive and sends what it finds, this
// process never parses the file (sandbox.h; not installed).

#include <cstddef>
#include <filesystem>
#include <functional>

#include "density/vdb/sandbox.h"
#include "density/vdb/vdb_archive.h"
#include "density/vdb/vdb_file.h"

namespace nephos {

inline constexpr std::size_t kMaxMetadataText = 1000;  // characters of one text that the child sends

// Runs the child's part on the opened archive and, in this process, the parent's on what the child sends.
// Throws Error(io) naming the path when it is not a readable OpenVDB file, with what the child threw, and
// with stream errors put into words.
void in_sandbox(const std::filesystem::path& path, const VdbReadLimits& limits,
                const std::function<void(VdbArchive&, SandboxWriter&)>& child,
                const std::function<void(SandboxReader&)>& parent);

}  // namespace nephos
