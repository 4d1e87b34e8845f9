// SPDX-License-Identifier: Apache-2.0
// Orders and lists that the device makes against those of the host, and pictures drawn from them against those of the
// processor.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/vec.h"
#include "render/cloud/cloud_preparation.h"
#include "render/frame/screen_box.h"
#include "render/frame/tile_bins.h"
#include "render/frame/view_sorting.h"
#include "render/options/camera.h"
#include "render/renderer.h"
#include "tests/render/renderer_test_access.h"
#include "tests/render/picture_checks.h"
#include "tests/render/random_billboards.h"
#include "tests/render/reference_render.h"
#include "tests/render/renderer_views.h"
#include "tests/render/voxel_cloud.h"

namespace nephos {
namespace {

struct HostLists {
    ViewSortedSplats order;
    std::vector<std::uint32_t> splats;  // nearest first, as screen_box.h numbers them
    std::vector<PixelBox> boxes;
    TileBins bins;
    TileGrid grid;
};

HostLists host_lists(const Splats& splats, const RenderOptions& options) {
    const CameraFrame camera = camera_frame(options.camera);
    HostLists lists;
    lists.order = sort_for_view(prepare(splats.metaballs), splats, camera,
                                pixels_per_unit(options.camera, camera), options.ground);
    const PicturePart whole{0, 0, options.camera.width, options.camera.height};
    lists.grid = {whole.width, whole.height};
    lists.splats = splats_near_to_far(lists.order);
    lists.boxes = screen_boxes(lists.order, camera, options.camera, whole, lists.splats);
    lists.bins = bin_into_tiles(lists.boxes, lists.grid);
    return lists;
}

Splats splats_of(std::span<const Metaball> balls, double extinction) {
    Splats splats;
    splats.metaballs = {balls, extinction, 0.7};
    return splats;
}

// Whether a box grown by a pixel touches a tile and one that is a pixel smaller does not: there rounding
// decides.
bool at_the_edge(const PixelBox& box, std::size_t tile, const TileGrid& grid) {
    const auto touches = [&](int more) {
        const PixelBox tiles = tiles_of({box.x0 - more, box.y0 - more, box.x1 + more, box.y1 + more}, grid);
        const int x = int(tile) % grid.columns(), y = int(tile) / grid.columns();
        return x >= tiles.x0 && x < tiles.x1 && y >= tiles.y0 && y < tiles.y1;
    };
    return touches(1) && !touches(-1);
}

// The same splats in the same order: metaballs with all that is known of them, and of billboards the centre.
void expect_same_order(const std::vector<shader::ViewBall>& seen, const HostLists& expected) {
    ASSERT_EQ(seen.size(), expected.splats.size());
    for (std::size_t i = 0; i < seen.size(); ++i) {
        const shader::ViewBall& mine = seen[i];
        const std::uint32_t splat = expected.splats[i];
        ASSERT_EQ((mine.flags & shader::kBillboardFlag) != 0, (splat & kBillboardSplat) != 0) << i;
        if ((splat & kBillboardSplat) != 0) {
            const shader::ViewBillboard& host = expected.order.billboards[splat & ~kBillboardSplat];
            ASSERT_EQ(mine.x, host.x) << i;
            ASSERT_EQ(mine.y, host.y) << i;
            ASSERT_EQ(mine.z, host.z) << i;
            continue;
        }
        const shader::ViewBall& host = expected.order.balls[splat];
        ASSERT_EQ(mine.x, host.x) << i;
        ASSERT_EQ(mine.y, host.y) << i;
        ASSERT_EQ(mine.z, host.z) << i;
        ASSERT_EQ(mine.radius, host.radius) << i;
        ASSERT_EQ(mine.depth_scale, host.depth_scale) << i;
        ASSERT_EQ(mine.height, host.height) << i;
        ASSERT_EQ(mine.flags, host.flags) << i;
    }
}

// Entries of the host's lists, and of them those that differ: whose box ends on the edge of a tile.
struct Entries {
    std::size_t all = 0, different = 0;
};

void compare_lists(const RendererTestAccess::Lists& lists, const HostLists& expected, Entries& entries) {
    ASSERT_EQ(lists.ranges.size(), expected.bins.ranges.size());
    for (std::size_t tile = 0; tile < lists.ranges.size(); ++tile) {
        const auto [begin, end] = lists.ranges[tile];
        const auto [host_begin, host_end] = expected.bins.ranges[tile];
        ASSERT_LE(begin, end);
        const std::vector mine(lists.list.begin() + begin, lists.list.begin() + end);
        const std::vector host(expected.bins.list.begin() + host_begin,
                               expected.bins.list.begin() + host_end);
        EXPECT_TRUE(std::ranges::is_sorted(mine)) << "nearest first";
        std::vector<std::uint32_t> different;
        std::ranges::set_symmetric_difference(mine, host, std::back_inserter(different));
        for (const std::uint32_t splat : different)
            EXPECT_TRUE(at_the_edge(expected.boxes[splat], tile, expected.grid));
        entries.all += host.size();
        entries.different += different.size();
    }
}

// In each tile the same splats, but for those whose box ends on the edge of a tile, of which there may be one
// in 1000.
TEST(DeviceLists, EqualThoseOfTheHost) {
    Renderer renderer(test::validated(Splatting::vulkan));
    Entries entries;
    for (const test::View& view : test::views()) {
        SCOPED_TRACE(view.name);
        const double radius = test::smallest_radius_m(view.options.camera);
        const std::vector<Metaball> balls =
            reference::random_metaballs(31, 3000, radius, std::max(200.0, 1.5 * radius));
        const Splats splats = splats_of(balls, 0.02);
        renderer.draw_splats(splats, view.options);
        const HostLists expected = host_lists(splats, view.options);
        const auto lists =
            RendererTestAccess::lists(renderer, view.options.camera.width, view.options.camera.height);
        expect_same_order(lists.balls, expected);
        compare_lists(lists, expected, entries);
    }
    std::printf("%zu of %zu entries differ\n", entries.different, entries.all);
    EXPECT_LE(entries.different, entries.all / 1000);
    test::expect_no_messages(renderer);
}

// Metaballs and billboards in one order and one list; and billboards alone. Not from 100 km away, where floats of
// distances are 8 mm apart: the device has those of the billboards from floats, one of which may be the next.
TEST(DeviceLists, OfMetaballsAndBillboardsEqualThoseOfTheHost) {
    Renderer renderer(test::validated(Splatting::vulkan));
    const std::vector<CloudBillboard> billboards = test::random_billboards(32, 2000, 2);
    Entries entries;
    for (const test::View& view : test::views()) {
        if (std::string(view.name) == "far") continue;
        SCOPED_TRACE(view.name);
        const double radius = test::smallest_radius_m(view.options.camera);
        const std::vector<Metaball> balls =
            reference::random_metaballs(33, 1500, radius, std::max(200.0, 1.5 * radius));
        for (const bool with_metaballs : {true, false}) {
            Splats splats = test::scene_of(test::kBillboardClouds, billboards);
            if (with_metaballs) splats.metaballs = {balls, 0.02, 0.7};
            renderer.draw_splats(splats, view.options);
            const HostLists expected = host_lists(splats, view.options);
            const auto lists =
                RendererTestAccess::lists(renderer, view.options.camera.width, view.options.camera.height);
            expect_same_order(lists.balls, expected);
            compare_lists(lists, expected, entries);
        }
    }
    std::printf("%zu of %zu entries differ\n", entries.different, entries.all);
    EXPECT_GT(entries.all, 10000u);
    EXPECT_LE(entries.different, entries.all / 1000);
    test::expect_no_messages(renderer);
}

// Of equal distances the metaball that is given first comes first; a lattice seen along its axis has four to
// eight of each.
TEST(DeviceLists, EqualDistancesStayInTheGivenOrder) {
    std::vector<Metaball> balls;
    for (int n = 0; n < 12 * 12 * 12; ++n)
        balls.push_back({float(n % 12) * 100 - 550, float(n / 12 % 12) * 100 - 550,
                         float(n / 144) * 100 + 450, 80, float(n + 1) / 2000});
    const Splats splats = splats_of(balls, 0.002);
    RenderOptions options = test::view({0, -4000, 1000}, {0, 0, 1000});
    options.level_of_detail.pixels = 0;
    Renderer renderer(test::validated(Splatting::vulkan));
    renderer.draw_splats(splats, options);
    const HostLists expected = host_lists(splats, options);
    const auto lists = RendererTestAccess::lists(renderer, options.camera.width, options.camera.height);
    ASSERT_EQ(lists.balls.size(), balls.size());
    std::size_t equal = 0;
    for (std::size_t i = 0; i < balls.size(); ++i) {
        const shader::ViewBall& mine = lists.balls[i];
        const shader::ViewBall& host = expected.order.balls[balls.size() - 1 - i];
        ASSERT_EQ(mine.depth_scale, host.depth_scale) << i;  // each has its own
        if (i > 0 && std::hypot(mine.x, mine.y, mine.z) ==
                         std::hypot(lists.balls[i - 1].x, lists.balls[i - 1].y, lists.balls[i - 1].z))
            ++equal;
    }
    EXPECT_GT(equal, balls.size() / 2);
    test::expect_no_messages(renderer);
}

class BinnedPictures : public ::testing::Test {
  protected:
    void TearDown() override { test::expect_no_messages(binned_); }

    // How far the two are from each other, relative where radiances are above 1.
    float difference(const Splats& splats, const RenderOptions& options) {
        const Picture mine = binned_.draw_splats(splats, options);
        return difference(mine, reference_.draw_splats(splats, options));
    }

    static float difference(const Picture& mine, const Picture& other) {
        float worst = test::largest_difference(mine.transmittance, other.transmittance);
        for (std::size_t i = 0; i < mine.beauty.size(); ++i)
            worst =
                std::max(worst, std::abs(mine.beauty[i] - other.beauty[i]) / std::max(1.0f, other.beauty[i]));
        // All are infinite where the depth was not requested.
        if (std::ranges::any_of(other.depth_m, [](float depth) { return std::isfinite(depth); }))
            test::expect_same_depths(mine, other, 0.1f, 0.01f);
        EXPECT_LE(test::largest_difference(mine.light, other.light), 1e-4f);
        EXPECT_LE(test::largest_difference(mine.shadow, other.shadow), 1e-4f);
        return worst;
    }

    static constexpr float kClose = 1.0f / 255;
    Renderer binned_{test::validated(Splatting::vulkan)}, reference_{test::validated(Splatting::cpu)};
};

// From everywhere, also from within and with metaballs around the eye, that touch the ground, that are denser
// than the fit takes.
TEST_F(BinnedPictures, AreThoseOfTheProcessor) {
    for (const test::View& view : test::views()) {
        const double radius = test::smallest_radius_m(view.options.camera);
        const std::vector<Metaball> balls =
            reference::random_metaballs(7, 600, radius, std::max(200.0, 1.5 * radius));
        for (const double extinction : {0.0005, 0.02, 0.3}) {
            Splats splats = splats_of(balls, extinction);
            EXPECT_LE(difference(splats, view.options), kClose) << view.name << ", extinction " << extinction;
            splats.depth = splats.light = false;
            EXPECT_LE(difference(splats, view.options), kClose) << view.name << " without depth";
        }
    }
}

TEST_F(BinnedPictures, WithAirBetweenTheSplats) {
    const std::vector<Metaball> balls = reference::random_metaballs(8, 700);
    for (const test::View& view : test::views()) {
        SCOPED_TRACE(view.name);
        RenderOptions options = view.options;
        options.light_shafts.strength = 1;
        for (const double fog : {0.0, 0.0004}) {
            options.fog.extinction_per_m = fog;
            options.fog.height_m = 1500;
            EXPECT_LE(difference(splats_of(balls, 0.02), options), kClose) << view.name << ", fog " << fog;
        }
        options.atmosphere.model = AirModel::physical;
        SCOPED_TRACE("physical sky");
        EXPECT_LE(difference(splats_of(balls, 0.02), options), kClose) << view.name;
    }
}

// As many shells as there may be, and that of the fog beyond them.
TEST_F(BinnedPictures, WithTheMostShells) {
    const std::vector<Metaball> balls = reference::random_metaballs(26, 400);
    RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000});
    options.light_shafts.strength = 1;
    options.shells = {128, 50, 1};
    options.fog.height_m = 1500;
    for (const double fog : {0.0, 0.0004}) {
        options.fog.extinction_per_m = fog;
        for (int n = 0; n < 2; ++n) EXPECT_LE(difference(splats_of(balls, 0.02), options), kClose) << fog;
    }
}

// A map with more tiles, and with more items of work, than there are work groups in a row.
TEST_F(BinnedPictures, LightOnALargeShadowMap) {
    std::mt19937 random(27);
    std::uniform_real_distribution<float> place(-1500, 1500), radius(1, 4);
    std::vector<Metaball> balls(48000);
    for (Metaball& ball : balls)
        ball = {place(random), place(random), 1000 + place(random) / 10, radius(random), 1};
    RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000});
    options.sun.elevation_deg = 80;
    for (const int size : {2048, 4096}) {
        options.shadow_map_size = size;
        EXPECT_LE(difference(splats_of(balls, 0.03), options), kClose) << size;
    }
}

// Of one tile, longer than what the loops of lavapipe go through with lanes that fetch for themselves.
TEST_F(BinnedPictures, LongListsComeInBatches) {
    std::vector<Metaball> balls = reference::random_metaballs(28, 60000, 5, 20);
    balls.push_back({9000, 9000, 1000, 20, 1});  // so that all others are in one tile of the shadow map
    RenderOptions options = test::view({-2000, -40000, 1000}, {-2000, 0, 1000}, 12, 16, 16, 16);
    options.sun.elevation_deg = 90;
    const Splats splats = splats_of(balls, 0.1);
    const Picture expected = reference_.draw_splats(splats, options),
                  picture = binned_.draw_splats(splats, options);
    EXPECT_LE(difference(picture, expected), kClose);
    const auto [least, most] = std::ranges::minmax(expected.transmittance);
    std::printf("transmittance %g..%g\n", double(least), double(most));
    EXPECT_TRUE(least > 0.01f && least < 0.8f);
}

// Sums do not depend on the order, and lists only leave out what takes nothing; from every side, with maps
// and metaballs of many sizes, and with so many metaballs on a tile that their centres are several items of
// work.
TEST_F(BinnedPictures, LightIsThatOfTheProcessor) {
    RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000});
    float light = 0, shadow = 0;
    for (const int size : {16, 130, 512}) {
        for (const double elevation : {3.0, 40.0, 90.0}) {
            for (const int count : {1, 40, 4000}) {
                options.shadow_map_size = size;
                options.sun.elevation_deg = elevation;
                options.sun.azimuth_deg = 5 * (count % 50) + elevation;
                const std::vector<Metaball> balls = reference::random_metaballs(unsigned(24 + count), count);
                const Splats splats = splats_of(balls, 0.002 + 0.1 / count);
                const Picture mine = binned_.draw_splats(splats, options),
                              host = reference_.draw_splats(splats, options);
                light = std::max(light, test::largest_difference(mine.light, host.light));
                shadow = std::max(shadow, test::largest_difference(mine.shadow, host.shadow));
                const auto [least, most] = std::ranges::minmax(mine.light);
                EXPECT_TRUE(least >= 0 && most <= 1 && (count == 1 || least < most));
            }
        }
    }
    std::printf("light %.6f, shadow %.6f\n", double(light), double(shadow));
    EXPECT_LE(light, 1e-4f);
    EXPECT_LE(shadow, 1e-4f);
}

TEST_F(BinnedPictures, WithLightning) {
    const std::vector<Metaball> balls = reference::random_metaballs(9, 300);
    Splats splats = splats_of(balls, 0.01);
    const RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000}, 40, 90, 60);
    for (int n = 0; n < 2; ++n) {  // and in the dark after it
        splats.flash.reset();
        EXPECT_LE(difference(splats, options), kClose);
        splats.flash = Flash{{300, 200, 1200}, {0.75, 0.8, 1.0}, 0.5 + n};
        EXPECT_LE(difference(splats, options), kClose);
    }
}

// Far out in the world single places are all that is left of floats; distances must still be right.
TEST_F(BinnedPictures, FarFromTheOrigin) {
    std::vector<Metaball> balls = reference::random_metaballs(10, 400);
    for (Metaball& ball : balls) {
        ball.x += 300000;
        ball.y -= 700000;
    }
    const RenderOptions options = test::view({300000.3, -703000.7, 800.1}, {300000, -700000, 1000});
    EXPECT_LE(difference(splats_of(balls, 0.02), options), kClose);
}

// One cloud after the other, larger and smaller, and none.
TEST_F(BinnedPictures, OfAnotherCloud) {
    const RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000}, 40, 90, 60);
    for (const int count : {1, 5000, 300, 2, 20000}) {
        const std::vector<Metaball> balls = reference::random_metaballs(unsigned(count), count);
        EXPECT_LE(difference(splats_of(balls, 0.01), options), kClose) << count;
    }
    EXPECT_LE(difference({}, options), kClose);
    const std::vector<Metaball> behind{{0, -9000, 800, 300, 1}};  // nothing is seen
    EXPECT_LE(difference(splats_of(behind, 0.01), options), kClose);
}

// From another eye level of detail merges other metaballs, which have other light.
TEST_F(BinnedPictures, OfMergedMetaballs) {
    const std::vector<Metaball> voxels = test::ragged_cloud();
    Splats splats;
    splats.metaballs = {voxels, 0.15, test::kVoxelNormalisation};
    for (const bool light : {false, true}) {
        splats.light = light;
        for (const double y : {-9000, -1500, -9000}) {
            RenderOptions options = test::view({0, y, 900}, {0, 0, 800});
            options.level_of_detail.pixels = 8;
            EXPECT_LE(difference(splats, options), kClose) << y;
            Renderer fresh(test::validated(Splatting::vulkan));
            const std::size_t passes = RendererTestAccess::light_passes(binned_);
            test::expect_same_bits(binned_.draw_splats(splats, options), fresh.draw_splats(splats, options));
            EXPECT_EQ(RendererTestAccess::light_passes(binned_), passes) << "the light was known";
        }
    }
}

// Metaballs that fill the picture have far more entries than the lists begin with.
TEST_F(BinnedPictures, ListsGrow) {
    std::vector<Metaball> balls = reference::random_metaballs(12, 60);
    for (Metaball& ball : balls) ball.radius *= 3;
    RenderOptions options = test::view({100, 200, 1000}, {700, 300, 1100}, 60, 640, 480);
    EXPECT_LE(difference(splats_of(balls, 0.001), options), kClose);
    options.camera.position_m = {0, -4000, 800};
    EXPECT_LE(difference(splats_of(balls, 0.001), options), kClose);
}

// Batches of a few splats, of which each adds to the sums of those before it, with and without air between them and
// with billboards among them.
TEST_F(BinnedPictures, BatchesDoNotShow) {
    Renderer batches(test::validated(Splatting::vulkan));
    RendererTestAccess::limit_lists(batches, std::size_t{1} << 24, 37);
    const std::vector<Metaball> balls = reference::random_metaballs(13, 500);
    const std::vector<CloudBillboard> billboards = test::random_billboards(14, 300, 2);
    for (const bool with_billboards : {false, true}) {
        for (const double strength : {0.0, 1.0}) {
            RenderOptions options = test::view({100, 200, 1000}, {700, 300, 1100}, 60, 80, 60);
            options.light_shafts.strength = strength;
            options.fog.extinction_per_m = strength * 0.0004;
            Splats splats = with_billboards ? test::scene_of(test::kBillboardClouds, billboards) : Splats();
            splats.metaballs = {balls, 0.002, 0.7};
            EXPECT_LE(difference(batches.draw_splats(splats, options), binned_.draw_splats(splats, options)),
                      5e-4f);
        }
    }
    test::expect_no_messages(batches);
}

// Lists with more entries than there may be: pictures are drawn again, light is computed again, in smaller batches.
TEST_F(BinnedPictures, TooManyEntriesComeInBatches) {
    Renderer limited(test::validated(Splatting::vulkan));
    RendererTestAccess::limit_lists(limited, 2048);
    const std::vector<Metaball> balls = reference::random_metaballs(13, 500);
    const RenderOptions options = test::view({100, 200, 1000}, {700, 300, 1100}, 60, 160, 120);
    const Splats splats = splats_of(balls, 0.001);
    const Picture expected = binned_.draw_splats(splats, options);
    EXPECT_LE(difference(limited.draw_splats(splats, options), expected), 5e-4f);
    const std::size_t overflows = RendererTestAccess::overflows(limited);
    EXPECT_TRUE(overflows > 0 && overflows < 5) << overflows;
    EXPECT_LE(difference(limited.draw_splats(splats, options), expected), 5e-4f);
    EXPECT_EQ(RendererTestAccess::overflows(limited), overflows) << "the size of the batches is known by now";
    test::expect_no_messages(limited);
}

TEST_F(BinnedPictures, TooManySplatsAreRefused) {
    const std::vector<Metaball> balls = reference::random_metaballs(13, 500);
    const RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000});
    RendererTestAccess::limit_splats(binned_, 499);
    try {
        binned_.draw_splats(splats_of(balls, 0.001), options);
        ADD_FAILURE() << "500 metaballs were drawn";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::usage);
        EXPECT_NE(std::string(error.what()).find("at most 499"), std::string::npos) << error.what();
    }
    RendererTestAccess::limit_splats(binned_, 500);
    EXPECT_LE(difference(splats_of(balls, 0.001), options), kClose);
}

// Squares of distances must be numbers.
TEST_F(BinnedPictures, NothingIsDrawnBeyondTheFarthest) {
    std::vector<Metaball> balls{{3e12f, 0, 0, 1e11f, 1}};
    RenderOptions options = test::view({3e12, -4e11, 0}, {3e12, 0, 0});
    options.ground.height_m = -1e12;
    Splats splats = splats_of(balls, 1e-11);
    splats.depth = false;  // beyond the largest distance of a SplatTail
    EXPECT_LE(difference(splats, options), kClose);
    balls.push_back({0, 2e15f, 0, 1e11f, 1});
    try {
        binned_.draw_splats(splats_of(balls, 1e-11), options);
        ADD_FAILURE() << "a metaball at 2e15 m was drawn";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::usage);
        EXPECT_NE(std::string(error.what()).find("1e15 m"), std::string::npos) << error.what();
    }
}

// In tiles of 16 pixels and as a whole, twice.
TEST_F(BinnedPictures, TilesOfThePictureHaveTheSameBits) {
    Renderer tiled(test::validated(Splatting::vulkan, 16));
    const std::vector<Metaball> balls = reference::random_metaballs(14, 500);
    RenderOptions options = test::view({50, 60, 1000}, {700, 300, 1100}, 60, 75, 50);
    options.light_shafts.strength = 1;
    const Splats splats = splats_of(balls, 0.02);
    const Picture whole = binned_.draw_splats(splats, options);
    test::expect_same_bits(binned_.draw_splats(splats, options), whole);
    const Picture tiles = tiled.draw_splats(splats, options);
    EXPECT_LE(difference(tiles, whole), 2e-4f);
    test::expect_no_messages(tiled);
}

// Pictures of a card with memory of its own.
TEST_F(BinnedPictures, OfACardWithItsOwnMemory) {
    Renderer divided(test::validated(Splatting::vulkan));
    RendererTestAccess::divide_memory(divided);
    const std::vector<Metaball> balls = reference::random_metaballs(23, 500);
    for (const int width : {75, 40, 120}) {
        RenderOptions options = test::view({50, 60, 1000}, {700, 300, 1100}, 60, width, 50);
        options.light_shafts.strength = 1;
        Splats splats = splats_of(balls, 0.02);
        splats.depth = width != 40;
        test::expect_same_bits(divided.draw_splats(splats, options), binned_.draw_splats(splats, options));
    }
    test::expect_no_messages(divided);
}

// What a picture sends to the device when nothing has changed but the camera: the camera.
TEST_F(BinnedPictures, NothingElseIsSentWhenTheCameraMoves) {
    const std::vector<Metaball> balls = reference::random_metaballs(15, 2000);
    const Splats splats = splats_of(balls, 0.02);
    const auto sent = [&](const RenderOptions& options) {
        const std::uint64_t before = RendererTestAccess::uploaded_bytes(binned_);
        EXPECT_LE(difference(splats, options), kClose);
        return RendererTestAccess::uploaded_bytes(binned_) - before;
    };
    constexpr std::size_t kCamera = sizeof(shader::FrameUniforms) + 12 * sizeof(shader::vec4);
    RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000});
    EXPECT_GE(sent(options), balls.size() * 32);
    options.camera.position_m = {2000, -3000, 500};
    EXPECT_EQ(sent(options), kCamera);
    options.sun.elevation_deg += 5;
    EXPECT_EQ(sent(options), kCamera + 5 * sizeof(shader::vec4)) << "the light is made there";
    options.light_shafts.strength = 1;
    options.fog.extinction_per_m = 0.0004;
    options.atmosphere.model = AirModel::physical;
    EXPECT_GT(sent(options), kCamera + sizeof(shader::Shells)) << "shade, fog and sky";
    options.camera.position_m = {-2000, -3000, 500};  // at the same height: the sky looks the same
    EXPECT_EQ(sent(options), kCamera + sizeof(shader::Shells));
    options.fog.seed = 2;
    EXPECT_GT(sent(options), kCamera + sizeof(shader::Shells)) << "other fog";
    options.light.phase.g = 0.3;
    EXPECT_GT(sent(options), kCamera + sizeof(shader::Shells)) << "another table of scattering";
    EXPECT_EQ(sent(options), kCamera + sizeof(shader::Shells));
    options.sun.elevation_deg += 5;
    EXPECT_GT(sent(options), kCamera + sizeof(shader::Shells)) << "other light has another shade";
    EXPECT_EQ(sent(options), kCamera + sizeof(shader::Shells));
}

// Shaders may see no more of a buffer than the device says.
TEST_F(BinnedPictures, NoLargerShadowMapThanTheDeviceAllows) {
    RendererTestAccess::limit_storage(binned_, 1 << 20);
    RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000});
    const std::vector<Metaball> balls = reference::random_metaballs(29, 300);
    options.shadow_map_size = 512;
    EXPECT_LE(difference(splats_of(balls, 0.02), options), kClose);
    options.shadow_map_size = 513;
    try {
        binned_.draw_splats(splats_of(balls, 0.02), options);
        ADD_FAILURE() << "a map of 4 * 513^2 bytes";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::usage);
        EXPECT_NE(std::string(error.what()).find("at most 512"), std::string::npos) << error.what();
    }
}

// The shade of shells is cached with the light; another cloud has another.
TEST_F(BinnedPictures, ShadeIsThatOfTheCloud) {
    RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000});
    options.light_shafts.strength = 1;
    for (const unsigned seed : {16u, 17u, 16u}) {
        const std::vector<Metaball> balls = reference::random_metaballs(seed, 400);
        for (const Splatting backend : {Splatting::cpu, Splatting::vulkan}) {
            Renderer& cached = backend == Splatting::cpu ? reference_ : binned_;
            Renderer fresh(test::validated(backend));
            const Splats splats = splats_of(balls, 0.02);
            test::expect_same_bits(cached.draw_splats(splats, options), fresh.draw_splats(splats, options));
        }
    }
}

}  // namespace
}  // namespace nephos
