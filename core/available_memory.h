// SPDX-License-Identifier: Apache-2.0
#pragma once

// How much memory this process may still take, asked before something large is allocated.

#include <cstddef>
#include <filesystem>
#include <string>

namespace nephos {

// The tightest of what limits this process, and its name for messages.
struct AvailableMemory {
    std::size_t bytes = 0;
    std::string limit;  // "free memory of the machine", "memory limit of the control group", ...
};

// Reads MemAvailable, the limits of the control groups that the process is in (version 2 and 1, what can be
// reclaimed counts as free) and RLIMIT_AS; what malloc keeps of freed memory counts as free. `root` is where
// the file system starts, for tests. What cannot be read does not limit; with nothing to read, bytes is the
// largest std::size_t. Thread-safe.
AvailableMemory available_memory(const std::filesystem::path& root = "/");

}  // namespace nephos
