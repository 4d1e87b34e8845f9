// SPDX-License-Identifier: Apache-2.0
#pragma once

// NanoVDB files, which renderers on graphics cards read: one float grid `density` with the transform of our VDB files.
// NanoVDB has no metadata: what else is known of the grid is in the sidecar of an export.

#include <cstdint>
#include <filesystem>

#include "density/density_grid.h"

namespace nephos {

enum class NanoCodec { none, zip };           // compression of the file
enum class NanoQuantise { none, fp8, fp16 };  // bits of a value, by the range of its leaf

// Returns the largest code of a value; of fp8 or fp16.
constexpr int largest_code(NanoQuantise quantise) { return quantise == NanoQuantise::fp8 ? 255 : 65535; }

// Returns the bits of a value.
constexpr int bits_of(NanoQuantise quantise) {
    return quantise == NanoQuantise::none ? 32 : quantise == NanoQuantise::fp16 ? 16 : 8;
}

// Writes atomically. Throws Error(io) naming the file, std::bad_alloc where the library or zlib has no memory, and what it meets where
// no thread can be started (core/threads.h is_lack_of_threads()). Thread-safe for different files.
void write_nanovdb(const std::filesystem::path& path, const DensityGrid& density, NanoCodec codec,
                   NanoQuantise quantise);

// Returns about the memory that write_nanovdb() takes beside a grid of `grid_bytes`: the library's own, and its compressed bytes.
std::uint64_t nanovdb_work_bytes(std::uint64_t grid_bytes, NanoCodec codec, NanoQuantise quantise);

// Reads the float grid of a file, quantised or not, as a grid of this extent where the file places it. A confined child process
// parses it (density/vdb/sandbox.h). Throws Error(io) naming the file, also when it has voxels outside of the extent.
DensityGrid read_nanovdb(const std::filesystem::path& path, Extent extent);

}  // namespace nephos
