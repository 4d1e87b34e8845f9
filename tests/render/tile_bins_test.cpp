// SPDX-License-Identifier: Apache-2.0
// Binning into tiles against a search through all boxes.

#include "render/frame/tile_bins.h"

#include <random>

#include <gtest/gtest.h>

namespace nephos {
namespace {

bool touches(const PixelBox& box, const PixelBox& tile, const TileGrid& grid) {
    const int x0 = std::max({box.x0, tile.x0, 0}), x1 = std::min({box.x1, tile.x1, grid.width});
    const int y0 = std::max({box.y0, tile.y0, 0}), y1 = std::min({box.y1, tile.y1, grid.height});
    return x0 < x1 && y0 < y1;
}

std::vector<PixelBox> random_boxes(std::size_t count, const TileGrid& grid) {
    std::mt19937 random(17);
    const auto draw = [&](int low, int high) { return std::uniform_int_distribution(low, high)(random); };
    std::vector<PixelBox> boxes(count);
    for (PixelBox& box : boxes) {
        box.x0 = draw(-40, grid.width + 20);
        box.y0 = draw(-40, grid.height + 20);
        box.x1 = box.x0 + draw(0, 50);  // some are empty
        box.y1 = box.y0 + draw(0, 50);
    }
    boxes.push_back({-1000, -1000, 100000, 100000});
    return boxes;
}

TEST(TileBins, EveryTileHasTheBoxesThatTouchItInOrder) {
    for (const TileGrid grid : {TileGrid{1, 1}, TileGrid{8, 16}, TileGrid{9, 17}, TileGrid{131, 70}}) {
        const std::vector<PixelBox> boxes = random_boxes(700, grid);
        const TileBins bins = bin_into_tiles(boxes, grid);
        ASSERT_EQ(bins.ranges.size(), grid.tiles());
        for (std::size_t t = 0; t < grid.tiles(); ++t) {
            const int x = int(t) % grid.columns() * 8, y = int(t) / grid.columns() * 16;
            std::vector<std::uint32_t> expected;
            for (std::uint32_t i = 0; i < boxes.size(); ++i)
                if (touches(boxes[i], {x, y, x + 8, y + 16}, grid)) expected.push_back(i);
            const auto first = bins.list.begin();
            ASSERT_EQ(std::vector(first + bins.ranges[t].begin, first + bins.ranges[t].end), expected) << t;
        }
    }
}

// So many that they are counted in parts.
TEST(TileBins, PartsKeepTheOrder) {
    const TileGrid grid{64, 64};
    const std::vector<PixelBox> boxes = random_boxes(100000, grid);
    const TileBins bins = bin_into_tiles(boxes, grid);
    std::size_t entries = 0;
    for (const shader::TileRange& range : bins.ranges) {
        for (std::uint32_t i = range.begin + 1; i < range.end; ++i) ASSERT_LT(bins.list[i - 1], bins.list[i]);
        entries += range.end - range.begin;
    }
    std::size_t expected = 0;
    for (const PixelBox& box : boxes) {
        const PixelBox tiles = tiles_of(box, grid);
        expected += std::size_t(tiles.x1 - tiles.x0) * std::size_t(tiles.y1 - tiles.y0);
    }
    EXPECT_EQ(entries, expected);
}

TEST(TileBins, TilesThatAreNotWantedStayEmptyAndTheOthersAsTheyAre) {
    const TileGrid grid{131, 70};
    const std::vector<PixelBox> boxes = random_boxes(40000, grid);
    std::vector<std::uint8_t> wanted(grid.tiles());
    for (std::size_t t = 0; t < wanted.size(); ++t) wanted[t] = t % 3 == 1 ? 1 : 0;
    const TileBins all = bin_into_tiles(boxes, grid), some = bin_into_tiles(boxes, grid, wanted);
    ASSERT_EQ(some.ranges.size(), grid.tiles());
    std::size_t entries = 0;
    for (std::size_t t = 0; t < grid.tiles(); ++t) {
        const auto list_of = [&](const TileBins& bins) {
            return std::vector(bins.list.begin() + bins.ranges[t].begin,
                               bins.list.begin() + bins.ranges[t].end);
        };
        EXPECT_EQ(list_of(some), wanted[t] != 0 ? list_of(all) : std::vector<std::uint32_t>()) << t;
        entries += list_of(some).size();
    }
    EXPECT_EQ(some.list.size(), entries);
}

TEST(TileBins, BatchesRespectBothLimits) {
    const TileGrid grid{64, 64};
    const std::vector<PixelBox> boxes(10, PixelBox{0, 0, 16, 16});  // two entries each
    EXPECT_EQ(end_of_batch(boxes, 0, grid, 4, 1000), 4u);
    EXPECT_EQ(end_of_batch(boxes, 3, grid, 100, 6), 6u);
    EXPECT_EQ(end_of_batch(boxes, 3, grid, 100, 1), 4u);  // one at least
    EXPECT_EQ(end_of_batch(boxes, 8, grid, 100, 1000), 10u);
    EXPECT_EQ(end_of_batch({}, 0, grid, 100, 1000), 0u);
}

}  // namespace
}  // namespace nephos
