// SPDX-License-Identifier: Apache-2.0

// Pictures of ground that is not level: what it hides, its shadow, and the three ways of drawing against each other.

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"
#include "density/density_grid.h"
#include "density/metaballs.h"
#include "render/renderer.h"
#include "render/terrain/height_map.h"
#include "tests/render/random_billboards.h"
#include "tests/render/renderer_test_access.h"
#include "tests/render/shared_renderers.h"

namespace nephos {
namespace {

// A wall from west to east, 400 m high, whose middle is 3 km in front of the eye, and the plane around it.
std::shared_ptr<const HeightMap> wall() {
    HeightImage image{41, 41, std::vector<float>(41 * 41, -10.0f)};
    for (int j = 18; j <= 22; ++j)
        for (int i = 5; i <= 35; ++i) image.heights[std::size_t(41 * j + i)] = 400;
    TerrainOptions options;
    options.y_m = 3000;
    options.width_m = options.length_m = 4000;
    options.edge = 0;
    return std::make_shared<const HeightMap>(height_map(image, options, 0));
}

RenderOptions view() {
    RenderOptions options;
    options.camera = {{0, 0, 150}, {0, 3000, 300}, 45, 96, 72, 0};
    options.shadow_map_size = 128;
    options.sun.elevation_deg = 35;
    options.sun.azimuth_deg = 180;  // behind the eye
    return options;
}

// A ball of cloud at a distance and height.
std::vector<Metaball> balls_at(double y_m, double z_m) {
    std::vector<Metaball> balls;
    for (int n = -3; n <= 3; ++n) balls.push_back({float(150 * n), float(y_m), float(z_m), 250.0f, 1.0f});
    return balls;
}

Picture draw(const RenderOptions& options, const std::vector<Metaball>& balls, Splatting way = Splatting::cpu,
             bool with_wall = true) {
    Splats splats;
    splats.metaballs = {balls, 0.02, 0.7};
    if (with_wall) splats.terrain = wall();
    return test::renderer(way).draw_splats(splats, options);
}

double difference(const Picture& a, const Picture& b) {
    double most = 0;
    for (std::size_t n = 0; n < a.beauty.size(); ++n)
        most = std::max(most, std::abs(double(a.beauty[n]) - double(b.beauty[n])));
    return most;
}

// Returns whether a pixel or a neighbour of it sees terrain: edges are smooth, so that level ground beside it is mixed with it.
bool is_beside_terrain(const Picture& picture, std::size_t n) {
    const int x = int(n) % picture.width, y = int(n) / picture.width;
    for (int j = std::max(y - 1, 0); j <= std::min(y + 1, picture.height - 1); ++j)
        for (int i = std::max(x - 1, 0); i <= std::min(x + 1, picture.width - 1); ++i)
            if (picture.terrain_m[std::size_t(j * picture.width + i)] < 1e30f) return true;
    return false;
}

TEST(TerrainPicture, HidesCloudsBehindIt) {
    const Picture without = draw(view(), {}), behind = draw(view(), balls_at(5000, 200)), before = draw(view(), balls_at(1500, 200));
    int on_wall = 0, hidden = 0, covered = 0;
    for (std::size_t n = 0; n < without.pixels(); ++n) {
        if (!(without.terrain_m[n] < 1e30f)) continue;
        ++on_wall;
        hidden += behind.transmittance[n] == 1 ? 1 : 0;
        covered += before.transmittance[n] < 0.5f ? 1 : 0;
        EXPECT_GT(without.terrain_m[n], 2500);
        EXPECT_LT(without.terrain_m[n], 4500);
    }
    EXPECT_GT(on_wall, 500);
    EXPECT_EQ(hidden, on_wall);
    EXPECT_GT(covered, 100);
}

TEST(TerrainPicture, LevelGroundIsAsWithoutIt) {
    const Picture with = draw(view(), {}), plain = draw(view(), {}, Splatting::cpu, false);
    EXPECT_TRUE(plain.terrain_m.empty());
    for (std::size_t n = 0; n < plain.pixels(); ++n) {
        if (is_beside_terrain(with, n)) continue;
        for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(with.beauty[3 * n + c], plain.beauty[3 * n + c]) << n;
    }
}

TEST(TerrainPicture, BackendsAgree) {
    for (const bool physical : {false, true}) {
        RenderOptions options = view();
        if (physical) options.atmosphere.model = AirModel::physical;
        options.light_shafts.strength = physical ? 1 : 0;
        options.fog.extinction_per_m = physical ? 2e-4 : 0;
        for (const double y : {1500.0, 5000.0}) {
            const std::vector<Metaball> balls = balls_at(y, 350);
            const Picture processor = draw(options, balls), tiles = draw(options, balls, Splatting::vulkan),
                          billboards = draw(options, balls, Splatting::blended);
            EXPECT_LE(difference(processor, tiles), 1.0 / 255) << y << physical;
            EXPECT_LE(difference(processor, billboards), 1.0 / 255) << y << physical;
        }
    }
}

// Billboards before and behind the wall, through it where their clouds stand in it, and pictures in parts.
TEST(TerrainPicture, BackendsAgreeAboutBillboards) {
    for (const double y : {1500.0, 3000.0, 5000.0}) {
        std::vector<CloudBillboard> billboards = test::random_billboards(4, 120, 1);
        for (CloudBillboard& each : billboards) each.centre_m = each.centre_m + Vec3{0, y, -700};
        const std::vector<BillboardCloud> clouds{{{0, y, 300}, -100, 700}};
        Splats splats = test::scene_of(clouds, billboards);
        splats.terrain = wall();
        const auto drawn = [&](Splatting way) { return test::renderer(way).draw_splats(splats, view()); };
        const Picture processor = drawn(Splatting::cpu);
        EXPECT_LE(difference(processor, drawn(Splatting::vulkan)), 1.0 / 255) << y;
        EXPECT_LE(difference(processor, drawn(Splatting::blended)), 1.0 / 255) << y;
        Splats open = splats;
        open.terrain = nullptr;
        if (y == 5000) {  // the wall hides some
            EXPECT_GT(difference(processor, test::renderer().draw_splats(open, view())), 0.05);
        }
    }
}

TEST(TerrainPicture, PartsDoNotShow) {
    RenderOptions options = view();
    options.atmosphere.model = AirModel::physical;
    Splats splats;
    const std::vector<Metaball> balls = balls_at(1500, 350);
    splats.metaballs = {balls, 0.02, 0.7};
    splats.terrain = wall();
    for (const Splatting way : {Splatting::cpu, Splatting::vulkan, Splatting::blended}) {
        Renderer parts(DeviceOptions{.part_size = 40, .splatting = way});
        EXPECT_LE(difference(test::renderer(way).draw_splats(splats, options), parts.draw_splats(splats, options)), 1e-4)
            << int(way);
    }
}

// Voxels with detail, which rays march through up to the wall.
TEST(TerrainPicture, BackendsAgreeAboutDetail) {
    const Extent extent{24, 16, 12};
    std::vector<float> values;
    for (std::size_t n = 0; n < extent.cells(); ++n) values.push_back(n % 7 == 0 ? 0.0f : 0.3f);
    for (const double y : {1200.0, 2600.0, 5000.0}) {
        std::vector<DetailedVoxels> detailed(1);
        DetailedVoxels& part = detailed[0];
        part.density = DensityGrid::from_dense(values, extent, {{-700, y, 80}, 40});
        part.setting = {.options = {}, .extinction_per_m = 0.1};
        const std::vector<Metaball> balls = metaballs(part.density, part.setting.metaball_radius_cells);
        part.count = balls.size();
        Splats splats;
        splats.metaballs = {balls, 0.1, metaball_normalisation(part.setting.metaball_radius_cells), detailed};
        splats.terrain = wall();
        const Picture processor = test::renderer().draw_splats(splats, view()),
                      tiles = test::renderer(Splatting::vulkan).draw_splats(splats, view());
        std::size_t apart = 0, covered = 0;
        for (std::size_t n = 0; n < processor.beauty.size(); ++n)
            apart += std::abs(processor.beauty[n] - tiles.beauty[n]) > 1.0f / 255 ? 1 : 0;
        for (const float left : processor.transmittance) covered += left < 0.5f ? 1 : 0;
        EXPECT_LE(apart, processor.beauty.size() / 1000) << y;
        EXPECT_EQ(covered > 100, y < 5000) << y;
    }
}

// More pixels than shaders see of a buffer.
TEST(TerrainPicture, RefusesMorePixelsThanTheDeviceSees) {
    Splats splats;
    splats.terrain = wall();
    RenderOptions options = view();
    options.shadow_map_size = 64;
    for (const Splatting way : {Splatting::vulkan, Splatting::blended}) {
        Renderer small(DeviceOptions{.splatting = way});
        const Picture before = small.draw_splats(splats, options);
        RendererTestAccess::limit_storage(small, 4 * 96 * 72 - 1);
        try {
            small.draw_splats(splats, options);
            FAIL() << int(way);
        } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::usage);
            EXPECT_NE(std::string(error.what()).find("at most 6911 pixels, but this one has 6912"), std::string::npos)
                << error.what();
        }
        RendererTestAccess::limit_storage(small, 1u << 27);
        EXPECT_EQ(small.draw_splats(splats, options).beauty, before.beauty);
    }
}

// Low hills from high up: nearer than the plane by less than a thousandth of the way, which is below what back-ends know of
// it in the distance.
TEST(TerrainPicture, LowHillsFromHighUpAreDrawnOnce) {
    HeightImage image{41, 41, std::vector<float>(41 * 41, 0.0f)};
    for (int j = 12; j < 30; ++j)
        for (int i = 12; i < 30; ++i) image.heights[std::size_t(41 * j + i)] = 8;
    TerrainOptions place;
    place.y_m = 20'000;
    place.width_m = place.length_m = 60'000;
    Splats splats;
    splats.terrain = std::make_shared<const HeightMap>(height_map(image, place, 0));
    RenderOptions options = view();
    options.camera.position_m = {0, 0, 10'000};
    options.camera.target_m = {0, 30'000, 0};
    for (const bool physical : {false, true}) {
        options.atmosphere.model = physical ? AirModel::physical : AirModel::gradient;
        const auto drawn = [&](Splatting way) { return test::renderer(way).draw_splats(splats, options); };
        const Picture processor = drawn(Splatting::cpu);
        EXPECT_GT(std::ranges::count_if(processor.terrain_m, [](float m) { return m < 1e30f; }), 1000);
        EXPECT_LE(difference(processor, drawn(Splatting::vulkan)), 1.0 / 255) << physical;
        EXPECT_LE(difference(processor, drawn(Splatting::blended)), 1.0 / 255) << physical;
        // About as bright as the plane: drawn neither twice nor not at all.
        Splats plane;
        const Picture level = test::renderer(Splatting::cpu).draw_splats(plane, options);
        EXPECT_LE(difference(processor, level), 0.1) << physical;
    }
}

TEST(TerrainPicture, SunAndCloudsShadeIt) {
    RenderOptions options = view();
    options.air.extinction_per_m = {0, 0, 0};
    const auto brightness = [&](const RenderOptions& of, const std::vector<Metaball>& balls) {
        const Picture picture = draw(of, balls);
        double sum = 0;
        int count = 0;
        for (std::size_t n = 0; n < picture.pixels(); ++n) {
            if (!(picture.terrain_m[n] < 1e30f) || picture.transmittance[n] < 1) continue;
            sum += double(picture.beauty[3 * n + 1]);
            ++count;
        }
        return count > 0 ? sum / count : 0.0;
    };
    const double lit = brightness(options, {});
    RenderOptions against = options;
    against.sun.azimuth_deg = 0;  // behind the wall
    const double dark = brightness(against, {});
    EXPECT_GT(lit, 2 * dark);
    EXPECT_GT(dark, 0);
    // A cloud between wall and sun, above the view.
    const double shaded = brightness(options, balls_at(1900, 900));
    EXPECT_LT(shaded, 0.9 * lit);
}

// Seen from above, the top of the wall is white above the snow line, but for its steep rims; its sides and the low ground keep their
// colour, but where smooth edges mix them with what is beside them.
TEST(TerrainPicture, SnowLiesOnHighAndGentleGround) {
    RenderOptions bare = view();
    bare.camera = {{0, 3000, 2500}, {0, 3000, 0}, 60, 96, 72, 0};
    RenderOptions snowy = bare;
    snowy.terrain.snow_line_m = 100;
    const Picture without = draw(bare, {}), with = draw(snowy, {});
    const auto sum = [](const Picture& picture, std::size_t n) {
        return double(picture.beauty[3 * n]) + double(picture.beauty[3 * n + 1]) + double(picture.beauty[3 * n + 2]);
    };
    const auto height_m = [&](std::size_t n) {
        const double u = (double(n % 96) + 0.5 - 48) / 36 * std::tan(0.5235987755982988),
                     v = (double(n / 96) + 0.5 - 36) / 36 * std::tan(0.5235987755982988);
        return 2500 - double(with.terrain_m[n]) / std::sqrt(1 + u * u + v * v);
    };
    // The rims are a row of pixels wide, and so are the smooth edges beside them.
    const auto is_within_top = [&](std::size_t n) {
        for (const std::size_t row : {n - 2 * 96, n, n + 2 * 96})
            for (const std::size_t at : {row - 2, row, row + 2})
                if (at >= with.pixels() || !(height_m(at) > 399)) return false;
        return true;
    };
    int top = 0, white = 0, side = 0, coloured = 0, low = 0;
    for (std::size_t n = 0; n < with.pixels(); ++n) {
        const double ratio = sum(with, n) / sum(without, n);
        if (!(with.terrain_m[n] < 1e30f)) {
            if (is_beside_terrain(with, n)) continue;
            ++low;
            EXPECT_EQ(ratio, 1);
            continue;
        }
        const double z_m = height_m(n);
        if (is_within_top(n)) {
            ++top;
            white += ratio > 1.5 ? 1 : 0;
        } else if (z_m > 150 && z_m < 350) {
            ++side;
            coloured += ratio < 1.25 ? 1 : 0;
        }
    }
    EXPECT_GT(top, 500);
    EXPECT_GT(white, 0.9 * top);
    EXPECT_GT(side, 30);
    EXPECT_GE(coloured, 0.95 * side);
    EXPECT_GT(low, 500);
}

// Level ground of 800 m at one height, seen from above: the bottom of a pit, open ground, and the top of a hill. Below the
// snow line hollows hold more snow, pixel by pixel, and the wind leaves less on tops.
TEST(TerrainPicture, SnowLiesInShelter) {
    constexpr float kGround_m = 400;
    RenderOptions bare = view();
    bare.camera = {{0, 3000, 1700}, {0, 3000, 0}, 15, 96, 72, 0};
    bare.sun.elevation_deg = 80;
    bare.air.extinction_per_m = {0, 0, 0};
    RenderOptions snowy = bare;
    snowy.terrain.snow_line_m = 420;
    // Compares how bright each pixel is with and without snow, where the ground around stands at a height.
    const auto brightened = [&](float around_m) {
        HeightImage image{41, 41, std::vector<float>(41 * 41, around_m)};
        for (int j = 16; j <= 24; ++j)
            for (int i = 16; i <= 24; ++i) image.heights[std::size_t(41 * j + i)] = kGround_m;
        TerrainOptions place;
        place.y_m = 3000;
        place.width_m = place.length_m = 4000;
        place.edge = 0;
        Splats splats;
        splats.terrain = std::make_shared<const HeightMap>(height_map(image, place, 0));
        const Picture without = test::renderer().draw_splats(splats, bare), with = test::renderer().draw_splats(splats, snowy);
        std::vector<double> ratios;
        for (std::size_t n = 0; n < with.pixels(); ++n)
            ratios.push_back(double(with.beauty[3 * n]) / double(without.beauty[3 * n]));
        return ratios;
    };
    const std::vector<double> pit = brightened(800), open = brightened(kGround_m), top = brightened(50);
    const auto mean = [](const std::vector<double>& of) { return std::reduce(of.begin(), of.end()) / double(of.size()); };
    for (std::size_t n = 0; n < open.size(); ++n) {
        EXPECT_GE(pit[n], open[n] - 1e-3) << n;
        EXPECT_LE(top[n], open[n] + 1e-3) << n;
    }
    EXPECT_GT(mean(pit), 1.3 * mean(open));
    EXPECT_LT(mean(top), 0.9 * mean(open));
    EXPECT_GT(mean(top), 1);
}

TEST(TerrainPicture, StandsInTheSeaUpsideDown) {
    RenderOptions options = view();
    options.ground.pattern = GroundPattern::water;
    options.water.wind_m_per_s = 0;
    options.camera.position_m = {0, 0, 30};
    options.camera.target_m = {0, 3000, 30};
    options.air.extinction_per_m = {0, 0, 0};
    const Picture with = draw(options, {}), without = draw(options, {}, Splatting::cpu, false);
    // As far below the horizon as the wall is above it.
    const auto green = [](const Picture& picture, int row) { return double(picture.beauty[3 * std::size_t(96 * row + 48) + 1]); };
    EXPECT_LT(green(with, 32), 0.8 * green(without, 32));
    EXPECT_LT(green(with, 40), 0.9 * green(without, 40));
    EXPECT_NEAR(green(with, 70), green(without, 70), 0.02);
}

TEST(TerrainPicture, RefusesACameraInIt) {
    RenderOptions options = view();
    options.camera.position_m = {0, 3000, 300};
    EXPECT_THROW(draw(options, {}), Error);
}

}  // namespace
}  // namespace nephos
