// SPDX-License-Identifier: Apache-2.0
#include "render/frame/tile_bins.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include <tbb/parallel_for.h>

#include "render/shared/half_floats.h"

namespace nephos {
namespace {

std::size_t area(const PixelBox& box) {
    return std::size_t(std::max(0, box.x1 - box.x0)) * std::size_t(std::max(0, box.y1 - box.y0));
}

// A box in tiles, half-open.
struct TileBox {
    std::uint16_t x0, y0, x1, y1;
};

// Calls work(number) for the tiles of a box, except those whose `requested` is 0.
template <bool kAll, class Work>
void for_each_tile(const TileBox& box, std::size_t columns, std::span<const std::uint8_t> requested,
                   const Work& work) {
    for (std::size_t y = box.y0; y < box.y1; ++y)
        for (std::size_t tile = y * columns + box.x0; tile < y * columns + box.x1; ++tile)
            if (kAll || requested[tile] != 0) work(tile);
}

// A counting sort by tile. Each part of the boxes counts for itself; its entries of a tile follow those of
// the parts before it.
template <bool kAll>
TileBins bin(std::span<const PixelBox> boxes, const TileGrid& grid, std::span<const std::uint8_t> requested) {
    constexpr std::size_t kPart = 16384;
    const std::size_t parts = std::max<std::size_t>(1, std::min<std::size_t>(16, boxes.size() / kPart));
    const auto columns = std::size_t(grid.columns());
    std::vector<TileBox> tiles(boxes.size());
    std::vector<std::vector<std::uint32_t>> next(parts);
    tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t p) {
        std::vector<std::uint32_t>& count = next[p];
        count.assign(grid.tiles(), 0);
        for (std::size_t i = boxes.size() * p / parts; i < boxes.size() * (p + 1) / parts; ++i) {
            const PixelBox box = tiles_of(boxes[i], grid);
            tiles[i] = {std::uint16_t(box.x0), std::uint16_t(box.y0), std::uint16_t(box.x1),
                        std::uint16_t(box.y1)};
            for_each_tile<kAll>(tiles[i], columns, requested, [&](std::size_t tile) { ++count[tile]; });
        }
    });

    TileBins bins;
    bins.ranges.resize(grid.tiles());
    std::uint32_t sum = 0;
    for (std::size_t tile = 0; tile < grid.tiles(); ++tile) {
        bins.ranges[tile].begin = sum;
        for (std::size_t p = 0; p < parts; ++p) sum += std::exchange(next[p][tile], sum);
        bins.ranges[tile].end = sum;
    }
    bins.list.resize(sum);
    tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t p) {
        std::uint32_t* const place = next[p].data();
        std::uint32_t* const list = bins.list.data();
        for (std::size_t i = boxes.size() * p / parts; i < boxes.size() * (p + 1) / parts; ++i)
            for_each_tile<kAll>(tiles[i], columns, requested,
                                [&](std::size_t tile) { list[place[tile]++] = std::uint32_t(i); });
    });
    return bins;
}

}  // namespace

shader::TileStep step_over(const TileGrid& grid) {
    return {.width = shader::uint(grid.width),
            .height = shader::uint(grid.height),
            .tiles_x = shader::uint(grid.columns()),
            .tile_count = shader::uint(grid.tiles()),
            .first_batch = 1,
            .last_batch = 1,
            .largest_radius = 0,
            .part = 0,
            .distances = 0};
}

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

TileBins bin_into_tiles(std::span<const PixelBox> boxes, const TileGrid& grid,
                        std::span<const std::uint8_t> requested) {
    return requested.empty() ? bin<true>(boxes, grid, requested) : bin<false>(boxes, grid, requested);
}

TileBins bin_batch(std::span<const PixelBox> boxes, std::size_t begin, std::size_t& end, const TileGrid& grid,
                   std::size_t longest) {
    for (;; end = begin + (end - begin + 1) / 2) {
        TileBins bins = bin_into_tiles(boxes.subspan(begin, end - begin), grid);
        const auto fits = [&](const shader::TileRange& range) { return range.end - range.begin <= longest; };
        if (std::ranges::all_of(bins.ranges, fits)) return bins;
    }
}

std::vector<PixelBox> light_boxes(std::span<const shader::LightSplat> splats) {
    std::vector<PixelBox> boxes(splats.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, splats.size(), 8192), [&](const auto& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
            const shader::LightSplat& s = splats[i];
            const auto [rx, ry] = unpack_halves(s.radii);
            boxes[i] = {floor_to_pixel(s.x - rx), floor_to_pixel(s.y - ry), ceil_to_pixel(s.x + rx),
                        ceil_to_pixel(s.y + ry)};
        }
    });
    return boxes;
}

TileBins bin_centres(std::span<const shader::LightSplat> splats, const TileGrid& grid,
                     std::span<const std::uint8_t> requested) {
    std::vector<PixelBox> centres(splats.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, centres.size(), 8192), [&](const auto& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
            if (!requested.empty() && requested[i] == 0) continue;
            const int x = std::clamp(int(splats[i].x), 0, grid.width - 1),
                      y = std::clamp(int(splats[i].y), 0, grid.height - 1);
            centres[i] = {x, y, x + 1, y + 1};
        }
    });
    return bin_into_tiles(centres, grid);
}

}  // namespace nephos
