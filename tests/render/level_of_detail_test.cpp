// SPDX-License-Identifier: Apache-2.0
// What level of detail keeps: optical mass, optical depth along rays, bits for any threads; and that it is
// continuous.

#include "render/cloud/level_of_detail.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/vec.h"
#include "tests/reference/with_threads.h"
#include "tests/render/reference_render.h"
#include "tests/render/voxel_cloud.h"

namespace nephos {
namespace {

constexpr double kExtinction = 0.15;
constexpr DetailView kNear{{0, -6000, 800}, 515};

MetaballCloud cloud_of(const std::vector<Metaball>& balls) {
    return {balls, kExtinction, test::kVoxelNormalisation};
}

std::optional<MergedCloud> merge(const MetaballCloud& cloud, const DetailView& view,
                                 const LevelOfDetailOptions& options) {
    const PreparedCloud given = prepare(cloud);
    const std::optional<DetailBlocks> blocks = detail_blocks(given, cloud);
    return blocks ? merge_voxels(given, cloud, *blocks, view, options) : std::nullopt;
}

// The metaballs that are drawn: the given ones if none are merged.
std::vector<Metaball> drawn(const std::vector<Metaball>& balls, const DetailView& view,
                            const LevelOfDetailOptions& options = {}) {
    const MetaballCloud cloud = cloud_of(balls);
    const std::optional<MergedCloud> merged = merge(cloud, view, options);
    return merged ? merged->metaballs : balls;
}

struct Moments {
    double mass = 0;
    Vec3 centre{};
};

Moments moments_of(const std::vector<Metaball>& balls) {
    Moments sum;
    for (const Metaball& ball : balls) {
        const double mass = double(ball.density) * ball.radius * ball.radius * ball.radius;
        sum.mass += mass;
        sum.centre = sum.centre + mass * Vec3{ball.x, ball.y, ball.z};
    }
    sum.centre = (1 / sum.mass) * sum.centre;
    return sum;
}

std::vector<reference::Ray> random_rays(int count) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> place(-450, 450), height(620, 1200);
    std::vector<reference::Ray> rays;
    for (int i = 0; i < count; ++i) {
        const Vec3 from{place(random), -2000, height(random)}, to{place(random), 2000, height(random)};
        rays.push_back({from, glm::normalize(to - from)});
    }
    return rays;
}

// At full sharpness, from afar and where everything is one ball for 512 voxels.
TEST(LevelOfDetail, MassAndItsCentreStay) {
    const std::vector<Metaball> balls = test::ragged_cloud();
    const Moments before = moments_of(balls);
    for (const double y : {-1000.0, -6000.0, -20000.0, -60000.0, -1e6}) {
        const std::vector<Metaball> merged = drawn(balls, {{0, y, 800}, 515});
        const Moments after = moments_of(merged);
        EXPECT_NEAR(after.mass / before.mass, 1, 1e-5) << y;
        EXPECT_LT(length(after.centre - before.centre), 0.01) << y;
        std::printf("eye at %.0f m: %zu of %zu metaballs\n", -y, merged.size(), balls.size());
    }
    EXPECT_LE(drawn(balls, {{0, -1e6, 800}, 515}).size(), 48u);  // 4 x 4 x 3 blocks
}

// The naive twin: every ball's field integrated along a ray.
TEST(LevelOfDetail, OpticalDepthAlongRaysStays) {
    const std::vector<Metaball> balls = test::ragged_cloud(), merged = drawn(balls, kNear);
    ASSERT_LT(merged.size(), balls.size() * 3 / 4);
    double transmittance = 0, depth = 0, depths = 0, bias = 0;
    const std::vector<reference::Ray> rays = random_rays(400);
    for (const reference::Ray& ray : rays) {
        const double full = reference::transmittance(cloud_of(balls), ray),
                     less = reference::transmittance(cloud_of(merged), ray);
        transmittance += std::abs(less - full);
        depth += std::abs(std::log(full) - std::log(less));
        bias += std::log(full) - std::log(less);
        depths -= std::log(full);
    }
    std::printf("%zu of %zu metaballs: transmittance %.5f, depth %.4f of %.3f, bias %.5f (means)\n",
                merged.size(), balls.size(), transmittance / 400, depth / 400, depths / 400, bias / 400);
    EXPECT_LT(transmittance / 400, 0.015);
    EXPECT_LT(depth, 0.05 * depths);
    EXPECT_LT(std::abs(bias), 0.005 * depths);
}

TEST(LevelOfDetail, ThreadsDoNotChangeTheBits) {
    const std::vector<Metaball> balls = test::ragged_cloud({.x = 64, .y = 56, .z = 24});
    const auto merge = [&] { return drawn(balls, kNear); };
    const std::vector<Metaball> expected = merge();
    ASSERT_LT(expected.size(), balls.size());
    for (const int threads : {1, 2, 7}) EXPECT_EQ(test::with_threads(std::size_t(threads), merge), expected);
}

// Of every ray the optical depth, for each of a row of pictures: from one to the next it must not jump.
double largest_jump(const std::vector<std::vector<Metaball>>& pictures) {
    std::vector<reference::Ray> rays = random_rays(25);
    std::vector<double> before;
    double largest = 0;
    for (const std::vector<Metaball>& balls : pictures) {
        std::vector<double> now;
        for (const reference::Ray& ray : rays)
            now.push_back(-std::log(reference::transmittance(cloud_of(balls), ray)));
        for (std::size_t i = 0; i < before.size(); ++i)
            largest = std::max(largest, std::abs(now[i] - before[i]));
        before = now;
    }
    return largest;
}

// An eye that moves away: the cloud's voxels become blocks of 8, of 64 and of 512 on its way, and between
// neighbouring places a ray through it changes by no more than its share of the whole way.
TEST(LevelOfDetail, MovingAwayDoesNotPop) {
    const std::vector<Metaball> balls = test::ragged_cloud({.x = 16, .y = 16, .z = 16});
    std::vector<std::vector<Metaball>> coarse, fine;
    for (int step = 0; step <= 40; ++step)
        coarse.push_back(drawn(balls, {{0, -1000 * std::pow(1.12, step), 800}, 515}));
    for (int step = 0; step <= 800; ++step)
        fine.push_back(drawn(balls, {{0, -1000 * std::pow(1.12, 0.05 * step), 800}, 515}));
    ASSERT_LT(coarse.back().size(), coarse.front().size() / 10);
    const double of_coarse = largest_jump(coarse), of_fine = largest_jump(fine);
    std::printf(
        "largest change of a ray's optical depth: %.4f in steps of 12 %%, %.4f in twentieths of that\n",
        of_coarse, of_fine);
    EXPECT_LT(of_fine, 0.2 * of_coarse);
}

// The same for a cloud that grows denser.
TEST(LevelOfDetail, GrowingDoesNotPop) {
    std::vector<std::vector<Metaball>> coarse, fine;
    const test::VoxelBox box{.x = 16, .y = 16, .z = 16};
    for (int step = 0; step <= 40; ++step)
        coarse.push_back(drawn(test::ragged_cloud(box, 1, 0.02 * step + 0.1), kNear));
    for (int step = 0; step <= 400; ++step)
        fine.push_back(drawn(test::ragged_cloud(box, 1, 0.002 * step + 0.1), kNear));
    const double of_coarse = largest_jump(coarse), of_fine = largest_jump(fine);
    std::printf("largest change of a ray's optical depth: %.4f, %.4f in tenths of the steps\n", of_coarse,
                of_fine);
    EXPECT_LT(of_fine, 0.2 * of_coarse);
}

// A solid cube that hides its inside; so close that nothing is merged for being small.
std::vector<Metaball> solid_cube(double density) {
    return test::voxel_metaballs({.origin_m = {-480, -480, 640}, .x = 40, .y = 40, .z = 40},
                                 [&](int, int, int) { return density; });
}
constexpr LevelOfDetailOptions kHardlyAny{.pixels = 0.05};

TEST(LevelOfDetail, HiddenVoxelsAreMerged) {
    const std::vector<Metaball> balls = solid_cube(1), merged = drawn(balls, kNear, kHardlyAny);
    const Moments before = moments_of(balls), after = moments_of(merged);
    EXPECT_NEAR(after.mass / before.mass, 1, 1e-5);
    EXPECT_LT(length(after.centre - before.centre), 0.01);
    // Within 8 voxels of the outside all stay as they were; of the rest, 24^3, one stands for 4^3 at least.
    EXPECT_LE(merged.size(), 40u * 40 * 40 - 24 * 24 * 24 + 6 * 6 * 6);
    const auto is_near_outside = [](const Metaball& ball) {
        return std::max({std::abs(ball.x - 320), std::abs(ball.y - 320), std::abs(ball.z - 1440)}) > 12 * 40;
    };
    const auto outer = [&](std::vector<Metaball> some) {
        std::erase_if(some, [&](const Metaball& ball) { return !is_near_outside(ball); });
        std::ranges::sort(some, {}, [](const Metaball& b) { return std::tuple(b.x, b.y, b.z); });
        return some;
    };
    EXPECT_EQ(outer(merged), outer(balls));
}

// Tubes through a solid cube stay open, whatever their width and place.
TEST(LevelOfDetail, OpeningsStayOpen) {
    const test::VoxelBox box{.origin_m = {-1280, -480, 640}, .x = 64, .y = 24, .z = 64};
    for (const int width : {1, 2, 3, 4, 6}) {
        for (const int from : {28, 30, 31}) {
            const auto is_tube = [&](int at) { return at >= from && at < from + width; };
            const std::vector<Metaball> balls = test::voxel_metaballs(
                box, [&](int x, int, int z) { return is_tube(x) && is_tube(z) ? 0.0 : 1.0; });
            const std::vector<Metaball> merged = drawn(balls, kNear, kHardlyAny);
            ASSERT_LT(merged.size(), balls.size());
            const double middle = (from + 0.5 * width) * 40;
            const reference::Ray ray{{-1280 + middle, -6000, 640 + middle}, {0, 1, 0}};
            const double full = -std::log(reference::transmittance(cloud_of(balls), ray)),
                         less = -std::log(reference::transmittance(cloud_of(merged), ray));
            EXPECT_NEAR(less, full, 0.02 + 0.02 * full) << width << " voxels from " << from;
        }
    }
}

double extinction_at(const std::vector<Metaball>& balls, const Vec3& at) {
    double sum = 0;
    for (const Metaball& ball : balls)
        sum += ball.density * reference::field(length(Vec3{ball.x, ball.y, ball.z} - at) / ball.radius);
    return kExtinction * test::kVoxelNormalisation * sum;
}

// What is in a hollow within a solid cube stays as it is while it fills: an eye may be there.
TEST(LevelOfDetail, HollowsStayAsTheyAre) {
    const test::VoxelBox box{.origin_m = {-1280, -1280, 640}, .x = 64, .y = 64, .z = 64};
    const auto is_hollow = [](int at) { return at >= 26 && at < 38; };
    for (const double density : {0.0, 1e-7, 1e-3, 0.02, 0.05}) {
        const std::vector<Metaball> balls = test::voxel_metaballs(box, [&](int x, int y, int z) {
            return is_hollow(x) && is_hollow(y) && is_hollow(z) ? density : 1.0;
        });
        const std::vector<Metaball> merged = drawn(balls, {{0, 0, 1920}, 515}, kHardlyAny);
        ASSERT_LT(merged.size(), balls.size());
        for (double x = -230; x < 230; x += 20) {
            const double full = extinction_at(balls, {x, 0, 1920});
            EXPECT_NEAR(extinction_at(merged, {x, 0, 1920}), full, 1e-9 + 1e-4 * full)
                << density << " at " << x;
        }
    }
}

TEST(LevelOfDetail, GrowingOpaqueDoesNotPop) {
    std::vector<std::vector<Metaball>> coarse, fine;
    for (int step = 0; step <= 20; ++step)
        coarse.push_back(drawn(solid_cube(0.05 * step), kNear, kHardlyAny));
    for (int step = 0; step <= 200; ++step)
        fine.push_back(drawn(solid_cube(0.005 * step), kNear, kHardlyAny));
    ASSERT_LT(fine.back().size(), 40u * 40 * 40);
    const double of_coarse = largest_jump(coarse), of_fine = largest_jump(fine);
    std::printf("largest change of a ray's optical depth: %.4f, %.4f in tenths of the steps\n", of_coarse,
                of_fine);
    EXPECT_LT(of_fine, 0.2 * of_coarse);
}

// The lattice is the world's: without the first voxels, or with the box elsewhere by whole blocks, the others
// are merged as before, wherever in the world voxels begin.
TEST(LevelOfDetail, BlocksStayWhereTheyAre) {
    for (const double off : {0.0, 13.0, 20.0, 39.999}) {
        const test::VoxelBox box{.origin_m = {off - 320, 2 * off, 600}, .x = 32, .y = 8, .z = 8};
        const std::vector<Metaball> all = test::ragged_cloud(box);
        std::vector<Metaball> less = all;
        std::erase_if(less, [&](const Metaball& ball) { return ball.x < box.origin_m.x + 8 * 40; });
        ASSERT_LT(less.size(), all.size());
        const DetailView view{{0, -4000, 800}, 515};
        std::vector<Metaball> of_all = drawn(all, view), of_less = drawn(less, view);
        const auto beyond = [&](const Metaball& ball) { return ball.x > box.origin_m.x + 16.5 * 40; };
        EXPECT_GT(std::ranges::count_if(of_less, beyond), 10);
        for (const Metaball& ball : of_less)
            if (beyond(ball)) {
                EXPECT_EQ(std::ranges::count(of_all, ball), 1) << off;
            }
    }
}

TEST(LevelOfDetail, IsOffForNoPixelsAndWithoutVoxels) {
    const auto merges = [](const std::vector<Metaball>& balls, const LevelOfDetailOptions& options) {
        const MetaballCloud cloud = cloud_of(balls);
        return merge(cloud, {{0, -1e5, 800}, 515}, options).has_value();
    };
    const std::vector<Metaball> balls = test::ragged_cloud();
    EXPECT_TRUE(merges(balls, {}));
    EXPECT_FALSE(merges(balls, {.pixels = 0}));
    EXPECT_FALSE(merges({}, {}));
    EXPECT_FALSE(merges({balls.front()}, {}));
    EXPECT_FALSE(merges(reference::random_metaballs(3, 500), {})) << "of many sizes";
    std::vector<Metaball> far = balls;
    far.front().x = 1e12f;
    EXPECT_FALSE(merges(far, {})) << "too far away for a number of a block";
    // Layers with voxels of other sizes are merged each for itself.
    std::vector<Metaball> layers = balls;
    for (const Metaball& ball : test::ragged_cloud({.origin_m = {0, 0, 2000}, .edge_m = 25}))
        layers.push_back(ball);
    EXPECT_TRUE(merges(layers, {}));
    EXPECT_NEAR(moments_of(drawn(layers, kNear)).mass / moments_of(layers).mass, 1, 1e-5);
}

TEST(LevelOfDetail, OptionsOutOfRangeAreErrors) {
    const auto check_pixels = [](double pixels) {
        RenderOptions options;
        options.level_of_detail.pixels = pixels;
        check(options);
    };
    EXPECT_NO_THROW(check(RenderOptions{}));
    for (const double wrong : {-0.1, std::nan(""), 1001.0}) EXPECT_THROW(check_pixels(wrong), Error) << wrong;
}

}  // namespace
}  // namespace nephos
