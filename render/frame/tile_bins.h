// SPDX-License-Identifier: Apache-2.0
#pragma once

// Binning of splats into the tiles of an image, and of metaballs and their centres into those of the shadow map.
// Private to the module.

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "render/shared/shared.h"

namespace nephos {

// A rectangle of pixels, half-open; may extend beyond the image or be empty.
struct PixelBox {
    int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

struct TileGrid {
    int width = 0, height = 0;  // of the image, pixels
    int columns() const { return (width + int(shader::kTileWidth) - 1) / int(shader::kTileWidth); }
    int rows() const { return (height + int(shader::kTileHeight) - 1) / int(shader::kTileHeight); }
    std::size_t tiles() const { return std::size_t(columns()) * std::size_t(rows()); }
};

// Returns the push constants of a compute pass over all tiles of an image or map in one batch.
shader::TileStep step_over(const TileGrid& grid);

// Returns the tiles that a box touches, half-open; empty when it is outside.
PixelBox tiles_of(const PixelBox& box, const TileGrid& grid);

// The lists of all tiles.
struct TileBins {
    std::vector<shader::TileRange> ranges;  // of `list`, one a tile, x fastest
    std::vector<std::uint32_t> list;        // indices into the boxes, rising in each tile
};

// Bins boxes in parallel; the result does not depend on the number of threads. `requested`: 0 for tiles whose
// list remains empty; if it is empty, all lists are filled.
TileBins bin_into_tiles(std::span<const PixelBox> boxes, const TileGrid& grid,
                        std::span<const std::uint8_t> requested = {});

// Limits of one batch, for the memory of its lists.
struct BatchLimits {
    std::size_t boxes = std::size_t{1} << 22;
    std::size_t entries = std::size_t{1} << 26;  // of the tiles' lists: 256 MiB
};

// Returns the end of a batch that starts at `begin`: at most `max_boxes` boxes with at most `max_entries`
// list entries, but at least one box. A box has at most one entry a tile.
std::size_t end_of_batch(std::span<const PixelBox> boxes, std::size_t begin, const TileGrid& grid,
                         std::size_t max_boxes, std::size_t max_entries);

// Bins the boxes from `begin` to `end`. Reduces `end` where a tile's list would exceed `longest` >= 1
// entries.
TileBins bin_batch(std::span<const PixelBox> boxes, std::size_t begin, std::size_t& end, const TileGrid& grid,
                   std::size_t longest);

// Returns a bounding box in texels for each splat.
std::vector<PixelBox> light_boxes(std::span<const shader::LightSplat> splats);

// Bins the centres, in each tile in order from the sun. Every centre is in one tile, except those whose
// `requested` is 0; if `requested` is empty, none is excepted.
TileBins bin_centres(std::span<const shader::LightSplat> splats, const TileGrid& grid,
                     std::span<const std::uint8_t> requested = {});

// Far beyond any picture, and far from the limits of int.
inline constexpr double kFarthestPixel = 1e6;

// Rounds to whole pixels, four times per splat, for which calls of std::floor take too long where the
// processor that is compiled for has no instruction for it.
inline int floor_to_pixel(double value) {
    const double near = std::clamp(value, -kFarthestPixel, kFarthestPixel);
    const int towards_zero = int(near);
    return towards_zero - (near < towards_zero ? 1 : 0);
}

inline int ceil_to_pixel(double value) {
    const double near = std::clamp(value, -kFarthestPixel, kFarthestPixel);
    const int towards_zero = int(near);
    return towards_zero + (near > towards_zero ? 1 : 0);
}

}  // namespace nephos
