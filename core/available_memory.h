// SPDX-License-Identifier: Apache-2.0
#pragma once

// The memory that this process may still allocate; queried before a large allocation.

#include <cstddef>
#include <filesystem>
#include <string>

namespace nephos {

// The tightest of the limits on this process, and its name for messages.
struct AvailableMemory {
    std::size_t bytes = 0;
    std::string limit;  // "free memory of the machine", "memory limit of the control group", ...
};

// Returns the least of MemAvailable, the limits of the process's control groups (version 2 and 1) and
// RLIMIT_AS. Reclaimable page cache and memory that malloc holds after free() count as available. `root` is
// the root of the file system that /proc and /sys are read from, for tests. A limit that cannot be read does
// not count; if none can, bytes is the largest std::size_t. Thread-safe.
AvailableMemory available_memory(const std::filesystem::path& root = "/");

}  // namespace nephos
