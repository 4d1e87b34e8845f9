// SPDX-License-Identifier: Apache-2.0
// Which voxels the metaballs of a cloud stand for.

#include "render/cloud/voxel_blocks.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/render/voxel_cloud.h"

namespace nephos {
namespace {

std::optional<VoxelBlocks> blocks_of(const std::vector<Metaball>& balls) {
    const PreparedCloud cloud = prepare({balls, 0.1, test::kVoxelNormalisation});
    EXPECT_EQ(cloud.visible.size(), balls.size());
    return voxel_blocks(cloud, test::kVoxelRadius);
}

// All metaballs are in one block each, at the place that they have in the world.
void expect_places(const std::vector<Metaball>& balls, const VoxelBlocks& blocks) {
    ASSERT_EQ(blocks.places.size(), balls.size());
    std::vector<int> seen(balls.size(), 0);
    std::uint64_t before = 0;
    for (std::size_t b = 0; b < blocks.size(); ++b) {
        const std::uint64_t number = blocks.of_block(b).front().block;
        EXPECT_TRUE(b == 0 || number > before);
        before = number;
        const VoxelLattice& lattice = blocks.lattices[lattice_of(number)];
        const std::array<int, 3> place = place_of(number);
        for (const BlockRun& run : blocks.of_block(b)) {
            EXPECT_EQ(run.block, number);
            for (std::uint32_t i = run.begin; i < run.end; ++i) {
                ++seen[i];
                const Metaball& ball = balls[i];
                const VoxelPlace& in = blocks.places[i];
                EXPECT_EQ(ball.radius, lattice.radius);
                const float within[3] = {in.x, in.y, in.z}, world[3] = {ball.x, ball.y, ball.z};
                unsigned pair = 0;
                for (std::size_t axis = 3; axis-- > 0;) {
                    ASSERT_GE(within[axis], 0) << i;
                    ASSERT_LT(within[axis], kBlockSide) << i;
                    const double voxels =
                        kBlockSide * place[axis] + lattice.phase[axis] + double(within[axis]);
                    EXPECT_NEAR(voxels * lattice.edge_m, world[axis], 1e-3 * lattice.edge_m) << i;
                    pair = 4 * pair + unsigned(within[axis]) / 2;
                }
                EXPECT_EQ(in.pair, pair) << i;
            }
        }
    }
    EXPECT_EQ(std::ranges::count(seen, 1), std::ptrdiff_t(balls.size()));
}

TEST(VoxelBlocks, HaveEveryMetaballAtItsPlace) {
    // Around the world's origin and far from it, on lattices that begin anywhere.
    for (const double origin : {0.0, -480.0, 13.7, -100003.3}) {
        const std::vector<Metaball> balls = test::ragged_cloud({.origin_m = {origin, -origin, 600 + origin}});
        const std::optional<VoxelBlocks> blocks = blocks_of(balls);
        ASSERT_TRUE(blocks) << origin;
        expect_places(balls, *blocks);
    }
}

TEST(VoxelBlocks, OfSeveralLatticesAreApart) {
    std::vector<Metaball> balls = test::ragged_cloud();
    const std::vector<Metaball> others = test::ragged_cloud({.origin_m = {-500, -470, 610}, .edge_m = 25});
    balls.insert(balls.end(), others.begin(), others.end());
    const std::optional<VoxelBlocks> blocks = blocks_of(balls);
    ASSERT_TRUE(blocks);
    EXPECT_EQ(blocks->lattices.size(), 2u);
    expect_places(balls, *blocks);
}

TEST(VoxelBlocks, AreNotFoundWhereThereAreNoVoxels) {
    EXPECT_FALSE(blocks_of({}));
    std::vector<Metaball> balls;
    for (int i = 0; i < 16; ++i) balls.push_back({0, 0, 0, 1.0f + float(i), 1});
    EXPECT_TRUE(blocks_of(balls));
    balls.push_back({0, 0, 0, 0.5f, 1});  // the 17th radius
    EXPECT_FALSE(blocks_of(balls));

    const float edge = float(1 / test::kVoxelRadius);  // of a radius of 1
    EXPECT_TRUE(blocks_of({{4e6f * edge, 0, 0, 1, 1}}));
    EXPECT_FALSE(blocks_of({{4.2e6f * edge, 0, 0, 1, 1}}));  // 2^22 = 4.19e6

    std::vector<Metaball> shuffled = test::ragged_cloud({.edge_m = 10, .x = 64, .y = 64, .z = 48});
    ASSERT_GT(shuffled.size(), 40000u);
    EXPECT_TRUE(blocks_of(shuffled));
    std::ranges::shuffle(shuffled, std::mt19937(1));
    EXPECT_FALSE(blocks_of(shuffled));
}

}  // namespace
}  // namespace nephos
