// SPDX-License-Identifier: Apache-2.0
// Orders and lists that the device makes, against those of the host.

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
#include "render/renderer_test_access.h"
#include "tests/render/picture_checks.h"
#include "tests/render/reference_render.h"
#include "tests/render/renderer_views.h"
#include "tests/render/voxel_cloud.h"

namespace nephos {
namespace {

DeviceOptions with_lists(TileLists lists, int tile_size = 2048) {
    return {{}, true, tile_size, Splatting::vulkan, lists};
}

struct HostLists {
    ViewSortedSplats order;
    std::vector<PixelBox> boxes;
    TileBins bins;
    TileGrid grid;
};

HostLists host_lists(const MetaballCloud& cloud, const RenderOptions& options) {
    const CameraFrame camera = camera_frame(options.camera);
    Splats splats;
    splats.metaballs = cloud;
    HostLists lists;
    lists.order = sort_for_view(prepare(cloud), splats, camera, pixels_per_unit(options.camera, camera),
                                options.ground);
    const Tile whole{0, 0, options.camera.width, options.camera.height};
    lists.grid = {whole.width, whole.height};
    lists.boxes = screen_boxes(lists.order, camera, options.camera, whole);
    lists.bins = bin_into_tiles(lists.boxes, lists.grid);
    return lists;
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

// The same metaballs in the same order; in each tile the same splats, but for those whose box ends on the
// edge of a tile, of which there may be one in 1000.
TEST(DeviceLists, EqualThoseOfTheHost) {
    Renderer renderer(with_lists(TileLists::device));
    std::size_t entries = 0, others = 0;
    for (const test::View& view : test::views()) {
        const double radius = test::smallest_radius_m(view.options.camera);
        const std::vector<Metaball> balls =
            reference::random_metaballs(31, 3000, radius, std::max(200.0, 1.5 * radius));
        const MetaballCloud cloud{balls, 0.02, 0.7};
        renderer.draw(cloud, view.options);
        const HostLists expected = host_lists(cloud, view.options);
        const auto lists =
            RendererTestAccess::lists(renderer, view.options.camera.width, view.options.camera.height);
        ASSERT_EQ(lists.balls.size(), expected.order.balls.size()) << view.name;
        for (std::size_t i = 0; i < lists.balls.size(); ++i) {
            const shader::ViewBall& mine = lists.balls[i];
            const shader::ViewBall& host = expected.order.balls[lists.balls.size() - 1 - i];
            ASSERT_EQ(mine.x, host.x) << view.name << " " << i;
            ASSERT_EQ(mine.y, host.y) << view.name << " " << i;
            ASSERT_EQ(mine.z, host.z) << view.name << " " << i;
            ASSERT_EQ(mine.radius, host.radius) << view.name << " " << i;
            ASSERT_EQ(mine.depth_scale, host.depth_scale) << view.name << " " << i;
            ASSERT_EQ(mine.height, host.height) << view.name << " " << i;
            ASSERT_EQ(mine.flags, host.flags) << view.name << " " << i;
        }
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
                EXPECT_TRUE(at_the_edge(expected.boxes[splat], tile, expected.grid)) << view.name;
            entries += host.size();
            others += different.size();
        }
    }
    std::printf("%zu of %zu entries differ\n", others, entries);
    EXPECT_LE(others, entries / 1000);
    test::expect_no_messages(renderer);
}

// Of equal distances the metaball that is given first comes first; a lattice seen along its axis has four to
// eight of each.
TEST(DeviceLists, EqualDistancesStayInTheGivenOrder) {
    std::vector<Metaball> balls;
    for (int n = 0; n < 12 * 12 * 12; ++n)
        balls.push_back({float(n % 12) * 100 - 550, float(n / 12 % 12) * 100 - 550,
                         float(n / 144) * 100 + 450, 80, float(n + 1) / 2000});
    const MetaballCloud cloud{balls, 0.002, 0.7};
    RenderOptions options = test::view({0, -4000, 1000}, {0, 0, 1000});
    options.level_of_detail.pixels = 0;
    Renderer renderer(with_lists(TileLists::device));
    renderer.draw(cloud, options);
    const HostLists expected = host_lists(cloud, options);
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

class ListedPictures : public ::testing::Test {
  protected:
    void TearDown() override {
        for (const Renderer* each : {&listed_, &reference_}) test::expect_no_messages(*each);
    }

    // How far the two are from each other, relative where radiances are above 1.
    float difference(const Splats& splats, const RenderOptions& options) {
        const std::size_t before = RendererTestAccess::listed(listed_);
        const Picture mine = listed_.draw_splats(splats, options);
        EXPECT_GT(RendererTestAccess::listed(listed_), before) << "drawn from the host's lists";
        return difference(mine, reference_.draw_splats(splats, options));
    }

    static float difference(const Picture& mine, const Picture& other) {
        float worst = test::largest_difference(mine.transmittance, other.transmittance);
        for (std::size_t i = 0; i < mine.beauty.size(); ++i)
            worst =
                std::max(worst, std::abs(mine.beauty[i] - other.beauty[i]) / std::max(1.0f, other.beauty[i]));
        for (std::size_t i = 0; i < mine.depth_m.size(); ++i) {
            if (mine.transmittance[i] > 0.99f || other.transmittance[i] > 0.99f) continue;
            if (mine.depth_m[i] == other.depth_m[i]) continue;  // or both infinite
            EXPECT_NEAR(mine.depth_m[i] / other.depth_m[i], 1.0f, 1e-3f);
        }
        EXPECT_LE(test::largest_difference(mine.light, other.light), 1e-4f);
        EXPECT_LE(test::largest_difference(mine.shadow, other.shadow), 1e-4f);
        return worst;
    }

    static Splats splats_of(std::span<const Metaball> balls, double extinction) {
        Splats splats;
        splats.metaballs = {balls, extinction, 0.7};
        return splats;
    }

    static constexpr float kClose = 0.25f / 255;
    Renderer listed_{with_lists(TileLists::device)}, reference_{with_lists(TileLists::host)};
};

// From everywhere, also from within and with metaballs around the eye, that touch the ground, that are denser
// than the fit takes.
TEST_F(ListedPictures, AreThoseFromTheHostsLists) {
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

TEST_F(ListedPictures, WithAirBetweenTheSplats) {
    const std::vector<Metaball> balls = reference::random_metaballs(8, 700);
    for (const test::View& view : test::views()) {
        RenderOptions options = view.options;
        options.light_shafts.strength = 1;
        for (const double fog : {0.0, 0.0004}) {
            options.fog.extinction_per_m = fog;
            options.fog.height_m = 1500;
            EXPECT_LE(difference(splats_of(balls, 0.02), options), kClose) << view.name << ", fog " << fog;
        }
        options.atmosphere.model = AirModel::physical;
        EXPECT_LE(difference(splats_of(balls, 0.02), options), kClose) << view.name << ", physical sky";
    }
}

// As many shells as there may be, and that of the fog beyond them.
TEST_F(ListedPictures, WithTheMostShells) {
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
TEST_F(ListedPictures, LightOnALargeShadowMap) {
    std::mt19937 random(27);
    std::uniform_real_distribution<float> place(-1500, 1500), radius(1, 4);
    std::vector<Metaball> balls(48000);
    for (Metaball& ball : balls)
        ball = {place(random), place(random), 1000 + place(random) / 10, radius(random), 1};
    RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000});
    options.sun.elevation_deg = 80;
    for (const int size : {2048, 4096}) {
        options.shadow_map_size = size;
        const std::size_t before = RendererTestAccess::listed_light(listed_);
        EXPECT_LE(difference(splats_of(balls, 0.03), options), kClose);
        EXPECT_EQ(RendererTestAccess::listed_light(listed_), before + 1) << size;
    }
}

// Of one tile, longer than what the loops of lavapipe go through with lanes that fetch for themselves.
TEST_F(ListedPictures, LongListsOfTheHostComeInBatches) {
    std::vector<Metaball> balls = reference::random_metaballs(28, 60000, 5, 20);
    balls.push_back({9000, 9000, 1000, 20, 1});  // so that all others are in one tile of the shadow map
    RenderOptions options = test::view({-2000, -40000, 1000}, {-2000, 0, 1000}, 12, 16, 16, 16);
    options.sun.elevation_deg = 90;
    const Splats splats = splats_of(balls, 0.1);
    Renderer processor{DeviceOptions{.device = {}, .splatting = Splatting::cpu}};
    const Picture expected = processor.draw_splats(splats, options),
                  picture = reference_.draw_splats(splats, options);
    EXPECT_LE(difference(picture, expected), kClose);
    const auto [least, most] = std::ranges::minmax(expected.transmittance);
    std::printf("transmittance %g..%g\n", double(least), double(most));
    EXPECT_TRUE(least > 0.01f && least < 0.8f);
}

// Sums do not depend on the order, and lists only leave out what takes nothing; from every side, with maps
// and metaballs of many sizes, and with so many metaballs on a tile that their centres are several items of
// work.
TEST_F(ListedPictures, LightIsThatFromTheHostsLists) {
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
                const std::size_t before = RendererTestAccess::listed_light(listed_);
                const Picture mine = listed_.draw_splats(splats, options),
                              host = reference_.draw_splats(splats, options);
                EXPECT_EQ(RendererTestAccess::listed_light(listed_), before + 1);
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

TEST_F(ListedPictures, WithLightning) {
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
TEST_F(ListedPictures, FarFromTheOrigin) {
    std::vector<Metaball> balls = reference::random_metaballs(10, 400);
    for (Metaball& ball : balls) {
        ball.x += 300000;
        ball.y -= 700000;
    }
    const RenderOptions options = test::view({300000.3, -703000.7, 800.1}, {300000, -700000, 1000});
    EXPECT_LE(difference(splats_of(balls, 0.02), options), kClose);
}

// One cloud after the other, larger and smaller, and none.
TEST_F(ListedPictures, OfAnotherCloud) {
    const RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000}, 40, 90, 60);
    for (const int count : {1, 5000, 300, 2, 20000}) {
        const std::vector<Metaball> balls = reference::random_metaballs(unsigned(count), count);
        EXPECT_LE(difference(splats_of(balls, 0.01), options), kClose) << count;
    }
    EXPECT_EQ(difference(listed_.draw_splats({}, options), reference_.draw_splats({}, options)), 0.0f);
    const std::vector<Metaball> behind{{0, -9000, 800, 300, 1}};  // nothing is seen
    EXPECT_LE(difference(splats_of(behind, 0.01), options), kClose);
}

// From another eye level of detail merges other metaballs, which have other light.
TEST_F(ListedPictures, OfMergedMetaballs) {
    const std::vector<Metaball> voxels = test::ragged_cloud();
    Splats splats;
    splats.metaballs = {voxels, 0.15, test::kVoxelNormalisation};
    for (const bool light : {false, true}) {
        splats.light = light;
        for (const double y : {-9000, -1500, -9000}) {
            RenderOptions options = test::view({0, y, 900}, {0, 0, 800});
            options.level_of_detail.pixels = 8;
            EXPECT_LE(difference(splats, options), kClose) << y;
            Renderer fresh(with_lists(TileLists::device));
            const std::size_t passes = RendererTestAccess::light_passes(listed_);
            test::expect_same_bits(listed_.draw_splats(splats, options), fresh.draw_splats(splats, options));
            EXPECT_EQ(RendererTestAccess::light_passes(listed_), passes) << "the light was known";
        }
    }
}

// Metaballs that fill the picture have far more entries than the lists begin with.
TEST_F(ListedPictures, ListsGrow) {
    std::vector<Metaball> balls = reference::random_metaballs(12, 60);
    for (Metaball& ball : balls) ball.radius *= 3;
    RenderOptions options = test::view({100, 200, 1000}, {700, 300, 1100}, 60, 640, 480);
    EXPECT_LE(difference(splats_of(balls, 0.001), options), kClose);
    options.camera.position_m = {0, -4000, 800};
    EXPECT_LE(difference(splats_of(balls, 0.001), options), kClose);
}

// Beyond the limits of the device the host makes the lists.
TEST_F(ListedPictures, TooMuchForTheDevice) {
    const std::vector<Metaball> balls = reference::random_metaballs(13, 500);
    const RenderOptions options = test::view({100, 200, 1000}, {700, 300, 1100}, 60, 160, 120);
    const Splats splats = splats_of(balls, 0.001);
    const Picture expected = reference_.draw_splats(splats, options);
    RendererTestAccess::limit_lists(listed_, 499, 1 << 24);
    EXPECT_EQ(difference(listed_.draw_splats(splats, options), expected), 0.0f);
    EXPECT_EQ(RendererTestAccess::listed(listed_), 0u);
    RendererTestAccess::limit_lists(listed_, 500, 2048);
    EXPECT_EQ(difference(listed_.draw_splats(splats, options), expected), 0.0f);
    EXPECT_EQ(RendererTestAccess::listed(listed_), 1u) << "it was tried";
    EXPECT_EQ(RendererTestAccess::too_long(listed_), 1u);
    RendererTestAccess::limit_lists(listed_, 500, 1 << 24);
    EXPECT_LE(difference(splats, options), kClose);
}

// In tiles of 16 pixels and as a whole, twice.
TEST_F(ListedPictures, TilesOfThePictureHaveTheSameBits) {
    Renderer tiled(with_lists(TileLists::device, 16));
    const std::vector<Metaball> balls = reference::random_metaballs(14, 500);
    RenderOptions options = test::view({50, 60, 1000}, {700, 300, 1100}, 60, 75, 50);
    options.light_shafts.strength = 1;
    const Splats splats = splats_of(balls, 0.02);
    const Picture whole = listed_.draw_splats(splats, options);
    test::expect_same_bits(listed_.draw_splats(splats, options), whole);
    const Picture tiles = tiled.draw_splats(splats, options);
    EXPECT_LE(difference(tiles, whole), 2e-4f);
    test::expect_no_messages(tiled);
}

// Pictures from the host's lists on a card with memory of its own.
TEST_F(ListedPictures, OfACardWithItsOwnMemory) {
    Renderer divided(with_lists(TileLists::host));
    RendererTestAccess::divide_memory(divided);
    const std::vector<Metaball> balls = reference::random_metaballs(23, 500);
    for (const int width : {75, 40, 120}) {
        RenderOptions options = test::view({50, 60, 1000}, {700, 300, 1100}, 60, width, 50);
        options.light_shafts.strength = 1;
        Splats splats = splats_of(balls, 0.02);
        splats.depth = width != 40;
        test::expect_same_bits(divided.draw_splats(splats, options), reference_.draw_splats(splats, options));
    }
    test::expect_no_messages(divided);
}

// What a picture sends to the device when nothing has changed but the camera: the camera.
TEST_F(ListedPictures, NothingElseIsSentWhenTheCameraMoves) {
    const std::vector<Metaball> balls = reference::random_metaballs(15, 2000);
    const Splats splats = splats_of(balls, 0.02);
    const auto sent = [&](const RenderOptions& options) {
        const std::uint64_t before = RendererTestAccess::uploaded_bytes(listed_);
        EXPECT_LE(difference(splats, options), kClose);
        return RendererTestAccess::uploaded_bytes(listed_) - before;
    };
    constexpr std::size_t kCamera = sizeof(shader::Frame) + 11 * sizeof(shader::vec4);
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
TEST_F(ListedPictures, NoLargerShadowMapThanTheDeviceAllows) {
    RendererTestAccess::limit_storage(listed_, 1 << 20);
    RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000});
    const std::vector<Metaball> balls = reference::random_metaballs(29, 300);
    options.shadow_map_size = 512;
    EXPECT_LE(difference(splats_of(balls, 0.02), options), kClose);
    options.shadow_map_size = 513;
    try {
        listed_.draw_splats(splats_of(balls, 0.02), options);
        ADD_FAILURE() << "a map of 4 * 513^2 bytes";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::usage);
        EXPECT_NE(std::string(error.what()).find("at most 512"), std::string::npos) << error.what();
    }
}

// The shade of shells is kept with the light; another cloud has another.
TEST_F(ListedPictures, ShadeIsThatOfTheCloud) {
    Renderer processor{DeviceOptions{.device = {}, .splatting = Splatting::cpu}};
    RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000});
    options.light_shafts.strength = 1;
    for (const unsigned seed : {16u, 17u, 16u}) {
        const std::vector<Metaball> balls = reference::random_metaballs(seed, 400);
        for (const Splatting way : {Splatting::cpu, Splatting::vulkan}) {
            Renderer& kept = way == Splatting::cpu ? processor : listed_;
            Renderer fresh{DeviceOptions{.device = {}, .splatting = way, .lists = TileLists::device}};
            const Splats splats = splats_of(balls, 0.02);
            test::expect_same_bits(kept.draw_splats(splats, options), fresh.draw_splats(splats, options));
        }
    }
}

}  // namespace
}  // namespace nephos
