// SPDX-License-Identifier: Apache-2.0
#pragma once

// Which splats touch which tile of a picture. Private to the module.

#include <cstdint>
#include <span>
#include <vector>

#include "render/shared/shared.h"

namespace nephos {

// A rectangle of pixels, half-open; may reach beyond the picture or be empty.
struct PixelBox {
    int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

struct TileGrid {
    int width = 0, height = 0;  // of the picture, pixels
    int columns() const { return (width + int(shader::kTileWidth) - 1) / int(shader::kTileWidth); }
    int rows() const { return (height + int(shader::kTileHeight) - 1) / int(shader::kTileHeight); }
    std::size_t tiles() const { return std::size_t(columns()) * std::size_t(rows()); }
};

// Push constants of a compute pass over all tiles of a picture or map that is drawn in one batch.
shader::TileStep step_over(const TileGrid& grid);

// The tiles that a box touches, half-open; empty when it lies outside.
PixelBox tiles_of(const PixelBox& box, const TileGrid& grid);

struct TileBins {
    std::vector<shader::TileRange> ranges;  // of `list`, one a tile, x fastest
    std::vector<std::uint32_t> list;        // indices into the boxes, rising in each tile
};

// In parallel; the result does not depend on the number of threads. `wanted`: 0 for tiles whose list stays
// empty; without it all are filled.
TileBins bin_into_tiles(std::span<const PixelBox> boxes, const TileGrid& grid,
                        std::span<const std::uint8_t> wanted = {});

// What is in memory at once.
struct BatchLimits {
    std::size_t boxes = std::size_t{1} << 22;
    std::size_t entries = std::size_t{1} << 26;  // of the tiles' lists: 256 MiB
};

// End of a batch that starts at `begin`: at most `max_boxes` boxes with at most `max_entries` entries in the
// list, but at least one box. A box has at most one entry a tile.
std::size_t end_of_batch(std::span<const PixelBox> boxes, std::size_t begin, const TileGrid& grid,
                         std::size_t max_boxes, std::size_t max_entries);

// Lists for the boxes from `begin` to `end`; less of them, and then a smaller `end`, where a tile's list
// would have more than `longest` >= 1 entries.
TileBins bin_batch(std::span<const PixelBox> boxes, std::size_t begin, std::size_t& end, const TileGrid& grid,
                   std::size_t longest);

}  // namespace nephos
