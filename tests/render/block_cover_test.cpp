// SPDX-License-Identifier: Apache-2.0
// How much cloud covers an octant, against a naive twin on a dense grid.

#include "render/cloud/block_cover.h"

#include <algorithm>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "render/cloud/voxel_blocks.h"

namespace nephos {
namespace {

constexpr int kBlocks = 5, kOctants = 2 * kBlocks;  // on each axis

std::uint64_t number_of(int x, int y, int z) {
    const auto place = [](int at) { return std::uint64_t(at + 1000); };
    return (place(z) << kBlockPlaceBits | place(y)) << kBlockPlaceBits | place(x);
}

// Octants of kBlocks x kBlocks x kBlocks blocks.
struct Grid {
    std::vector<float> depth = std::vector<float>(kOctants * kOctants * kOctants, 0.0f);
    static bool is_inside(int x, int y, int z) {
        return std::min({x, y, z}) >= 0 && std::max({x, y, z}) < kOctants;
    }
    static std::size_t index(int x, int y, int z) { return std::size_t((z * kOctants + y) * kOctants + x); }

    // Bellman and Ford's: once around for as long as anything changes.
    std::vector<float> cover(float most) const {
        std::vector<float> cover(depth.size());
        for (std::size_t i = 0; i < depth.size(); ++i) cover[i] = std::min(most, 2 * depth[i]);
        for (bool changed = true; changed;) {
            changed = false;
            for (int n = 0; n < int(depth.size()); ++n) {
                const int x = n % kOctants, y = n / kOctants % kOctants, z = n / (kOctants * kOctants);
                for (int k = 0; k < 27; ++k) {
                    const int a = x + k % 3 - 1, b = y + k / 3 % 3 - 1, c = z + k / 9 - 1;
                    const float through =
                        is_inside(a, b, c) ? cover[index(a, b, c)] + depth[index(a, b, c)] : 0;
                    changed = changed || through < cover[std::size_t(n)];
                    cover[std::size_t(n)] = std::min(cover[std::size_t(n)], through);
                }
            }
        }
        return cover;
    }
};

struct Blocks {
    std::vector<std::uint64_t> numbers;
    std::vector<OfOctants> depths;
};

// Those of a grid in which there is anything.
Blocks blocks_of(const Grid& grid) {
    Blocks blocks;
    for (int n = 0; n < kBlocks * kBlocks * kBlocks; ++n) {
        const int x = n % kBlocks, y = n / kBlocks % kBlocks, z = n / (kBlocks * kBlocks);
        OfOctants depths;
        for (int o = 0; o < 8; ++o)
            depths[std::size_t(o)] =
                grid.depth[Grid::index(2 * x + (o & 1), 2 * y + (o >> 1 & 1), 2 * z + (o >> 2))];
        if (std::ranges::count(depths, 0.0f) == 8) continue;
        blocks.numbers.push_back(number_of(x, y, z));
        blocks.depths.push_back(depths);
    }
    return blocks;
}

void expect_cover_of_twin(const Grid& grid, float most) {
    const Blocks blocks = blocks_of(grid);
    const std::vector<OfOctants> cover = cover_of_octants(blocks.numbers, blocks.depths, most);
    const std::vector<float> expected = grid.cover(most);
    ASSERT_EQ(cover.size(), blocks.numbers.size());
    for (std::size_t b = 0; b < cover.size(); ++b) {
        const auto place = [&](int axis) {
            return 2 *
                   (int(blocks.numbers[b] >> axis * kBlockPlaceBits & ((1u << kBlockPlaceBits) - 1)) - 1000);
        };
        for (int o = 0; o < 8; ++o)
            EXPECT_EQ(cover[b][std::size_t(o)],
                      expected[Grid::index(place(0) + (o & 1), place(1) + (o >> 1 & 1), place(2) + (o >> 2))])
                << b << ' ' << o;
    }
}

TEST(BlockCover, EqualsTheNaiveTwin) {
    for (unsigned seed = 0; seed < 20; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        std::mt19937 random(seed);
        std::uniform_real_distribution<float> depth(0, 2), hole(0, 1);
        Grid grid;
        for (float& value : grid.depth) value = hole(random) < 0.02f * float(seed) ? 0 : depth(random);
        expect_cover_of_twin(grid, 4);
    }
}

// One hole in the middle of a solid cube uncovers what is around it.
TEST(BlockCover, HolesUncover) {
    Grid grid;
    std::ranges::fill(grid.depth, 4.0f);
    const std::size_t middle = Grid::index(5, 5, 5), beside = Grid::index(4, 5, 5),
                      next = Grid::index(3, 5, 5);
    for (const std::size_t at : {middle, beside, next}) EXPECT_EQ(grid.cover(9)[at], 8);
    expect_cover_of_twin(grid, 9);
    grid.depth[middle] = 0;
    EXPECT_EQ(grid.cover(9)[middle], 0);
    EXPECT_EQ(grid.cover(9)[beside], 0);
    EXPECT_EQ(grid.cover(9)[next], 4);
    expect_cover_of_twin(grid, 9);
}

TEST(BlockCover, NothingIsCoveredWithoutBlocks) { EXPECT_TRUE(cover_of_octants({}, {}, 1).empty()); }

}  // namespace
}  // namespace nephos
