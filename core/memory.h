// SPDX-License-Identifier: Apache-2.0
#pragma once

// The memory that this process may still allocate, queried before a large allocation, and the memory that it
// retains.

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

// Raises malloc's trim threshold, so that up to 256 MiB of freed memory in each arena stay with the process:
// every frame and step allocates the same vectors again, and the kernel clears each page that it hands out
// (docs/speed.md). available_memory() counts this memory as free. For programs, not for libraries: it changes
// malloc for the whole process. Call it before any other function. Does nothing where malloc is not that of
// the GNU C library.
void keep_freed_memory();

}  // namespace nephos
