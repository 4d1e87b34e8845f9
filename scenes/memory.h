// SPDX-License-Identifier: Apache-2.0
#pragma once

// Whether a scene fits into memory, asked before anything is allocated: a run that is too large is refused
// with both figures, instead of being killed half-way.

#include <cstddef>
#include <filesystem>
#include <string>

#include "scenes/scene.h"

namespace nephos {

// Bytes that a run of a scene takes at its peak, by part; the largest std::size_t when they exceed it. Planes
// of bits are exact. What grows with the clouds is reckoned with half of all voxels being cloud, more than
// any sky that has gaps.
struct MemoryEstimate {
    std::size_t automaton = 0;  // planes of bits and the work areas beside them
    std::size_t density = 0;    // planes of the time window, grids of two steps and of the frame between them
    std::size_t pictures = 0;   // metaballs, picture and shadow map; 0 without pictures
    std::size_t total() const;
};

MemoryEstimate memory_estimate(const Scene& scene, bool with_pictures = true);

// memory_estimate().total()
std::size_t memory_estimate_bytes(const Scene& scene, bool with_pictures = true);

// The tightest of what limits this process, and its name for messages.
struct AvailableMemory {
    std::size_t bytes = 0;
    std::string limit;  // "free memory of the machine", "memory limit of the control group", ...
};

// Reads MemAvailable, the limits of the control groups that the process is in (version 2 and 1, what can be
// reclaimed counts as free) and RLIMIT_AS. `root` is where the file system starts, for tests. What cannot be
// read does not limit; with nothing to read, bytes is the largest std::size_t.
AvailableMemory available_memory(const std::filesystem::path& root = "/");

// Throws Error(usage) that names both figures, the largest part and the keys that it depends on, when the
// scene needs more than is available.
void check_memory(const Scene& scene, const AvailableMemory& available, bool with_pictures = true);
void check_memory(const Scene& scene, bool with_pictures = true);

// "3.2 GiB"
std::string bytes_text(std::size_t bytes);

}  // namespace nephos
