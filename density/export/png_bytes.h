// SPDX-License-Identifier: Apache-2.0
#pragma once

// PNG files in memory (not installed).

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>

namespace nephos {

// A picture that is encoded row by row.
struct PngShape {
    std::uint32_t width = 0, height = 0;
    int bits = 8;      // of a sample, 8 or 16 (in this machine's order of bytes)
    int channels = 1;  // 1 grey, 4 red, green, blue and alpha
};

// Returns the bytes of a file whose rows `fill` makes, from the top one down; `fill` must not throw. The rows are stored as
// differences between neighbours, whose runs alone are packed: of voxels of clouds that is smaller and four times as fast
// as zlib's search for repetitions with a filter chosen for each row. Throws Error(io) naming `path`,
// std::bad_alloc where libpng has no memory.
std::string png_bytes(const std::filesystem::path& path, const PngShape& shape,
                      const std::function<void(std::uint32_t y, std::span<std::byte> row)>& fill);

}  // namespace nephos
