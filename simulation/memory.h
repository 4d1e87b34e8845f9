// SPDX-License-Identifier: Apache-2.0
#pragma once

// Whether a scene fits into memory, asked before anything is allocated: a run that is too large is refused
// with both figures, instead of being killed half-way.

#include <cstddef>
#include <string>

#include "core/memory.h"
#include "scenes/format/scene.h"

namespace nephos {

// Parts of a run that take memory; each includes those before it.
enum class RunParts {
    statistics,  // from the bits alone
    density,     // and density files
    pictures,
};

// Bytes that a run of a scene takes at its peak, by part; the largest std::size_t when they exceed it. Planes
// of bits are exact. Grids are reckoned with some cloud in every one of their blocks, as an overcast sky and
// scattered specks have it; no sky takes more. Metaballs are reckoned with half of all cells; a picture that
// takes more is refused before it is drawn, when its metaballs are counted.
struct MemoryEstimate {
    std::size_t program = 0;    // code, libraries and buffers that no key changes
    std::size_t automaton = 0;  // planes of bits and the work areas beside them
    // Planes of the time window, grids of two steps, of frames in flight to the files, and as written.
    std::size_t density = 0;
    std::size_t pictures = 0;  // metaballs, picture, shadow map and ffmpeg; 0 without pictures
    std::size_t total() const;
};

MemoryEstimate memory_estimate(const Scene& scene, RunParts parts = RunParts::pictures);

// Returns memory_estimate().total().
std::size_t memory_estimate_bytes(const Scene& scene, RunParts parts = RunParts::pictures);

// Throws Error(usage) that names both figures, the largest part and the keys that it depends on, when the
// scene needs more than is available.
void check_memory(const Scene& scene, const AvailableMemory& available, RunParts parts = RunParts::pictures);
void check_memory(const Scene& scene, RunParts parts = RunParts::pictures);

// Throws Error(usage) unless `bytes` of memory are available; `what` starts the sentence.
void require_memory(std::size_t bytes, const std::string& what);

}  // namespace nephos
