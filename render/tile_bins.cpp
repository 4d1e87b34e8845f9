// SPDX-License-Identifier: Apache-2.0
#include "render/tile_bins.h"

#include <algorithm>

#include <tbb/parallel_for.h>

namespace nephos {
namespace {

std::size_t area(const PixelBox& box) {
    return std::size_t(std::max(0, box.x1 - box.x0)) * std::size_t(std::max(0, box.y1 - box.y0));
}

template <class Work>
void for_each_tile(const PixelBox& box, const TileGrid& grid, std::span<const std::uint8_t> wanted,
                   const Work& work) {
    const PixelBox tiles = tiles_of(box, grid);
    const auto columns = std::size_t(grid.columns());
    for (int y = tiles.y0; y < tiles.y1; ++y) {
        for (int x = tiles.x0; x < tiles.x1; ++x) {
            const std::size_t tile = std::size_t(y) * columns + std::size_t(x);
            if (wanted.empty() || wanted[tile] != 0) work(tile);
        }
    }
}

}  // namespace

PixelBox tiles_of(const PixelBox& box, const TileGrid& grid) {
    constexpr int kWidth = shader::kTileWidth, kHeight = shader::kTileHeight;
    const int x0 = std::max(0, box.x0), y0 = std::max(0, box.y0);
    const int x1 = std::min(grid.width, box.x1), y1 = std::min(grid.height, box.y1);
    if (x0 >= x1 || y0 >= y1) return {};
    return {x0 / kWidth, y0 / kHeight, (x1 + kWidth - 1) / kWidth, (y1 + kHeight - 1) / kHeight};
}

std::size_t end_of_batch(std::span<const PixelBox> boxes, std::size_t begin, const TileGrid& grid,
                         std::size_t max_boxes, std::size_t max_entries) {
    std::size_t end = begin, entries = 0;
    while (end < boxes.size() && end - begin < max_boxes) {
        entries += area(tiles_of(boxes[end], grid));
        if (entries > max_entries && end > begin) break;
        ++end;
    }
    return end;
}

// A counting sort by tile. Each part of the boxes counts for itself; its entries of a tile follow those of
// the parts before it.
TileBins bin_into_tiles(std::span<const PixelBox> boxes, const TileGrid& grid,
                        std::span<const std::uint8_t> wanted) {
    constexpr std::size_t kPart = 16384;
    const std::size_t parts = std::max<std::size_t>(1, std::min<std::size_t>(16, boxes.size() / kPart));
    const auto part = [&](std::size_t p) {
        const std::size_t begin = boxes.size() * p / parts, end = boxes.size() * (p + 1) / parts;
        return std::pair(begin, end);
    };
    std::vector<std::vector<std::uint32_t>> next(parts);
    tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t p) {
        next[p].assign(grid.tiles(), 0);
        const auto [begin, end] = part(p);
        for (std::size_t i = begin; i < end; ++i)
            for_each_tile(boxes[i], grid, wanted, [&](std::size_t tile) { ++next[p][tile]; });
    });

    TileBins bins;
    bins.ranges.resize(grid.tiles());
    std::uint32_t sum = 0;
    for (std::size_t tile = 0; tile < grid.tiles(); ++tile) {
        bins.ranges[tile].begin = sum;
        for (std::size_t p = 0; p < parts; ++p) {
            const std::uint32_t count = next[p][tile];
            next[p][tile] = sum;
            sum += count;
        }
        bins.ranges[tile].end = sum;
    }
    bins.list.resize(sum);
    tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t p) {
        const auto [begin, end] = part(p);
        for (std::size_t i = begin; i < end; ++i)
            for_each_tile(boxes[i], grid, wanted,
                          [&](std::size_t tile) { bins.list[next[p][tile]++] = std::uint32_t(i); });
    });
    return bins;
}

}  // namespace nephos
