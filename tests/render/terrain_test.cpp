// SPDX-License-Identifier: Apache-2.0

// Height maps: rays against small steps along them, the Earth's curve, drainage, files and what is wrong with them.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <limits>
#include <random>
#include <string>

#include <OpenEXR/ImfArray.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfOutputFile.h>
#include <gtest/gtest.h>
#include <png.h>

#include "core/error.h"
#include "render/options/camera.h"
#include "render/terrain/erosion.h"
#include "render/terrain/height_file.h"
#include "render/terrain/relief.h"
#include "render/terrain/terrain.h"
#include "render/terrain/terrain_ray.h"
#include "render/terrain/terrain_view.h"
#include "tests/render/temporary_folder.h"

namespace nephos {
namespace {

TerrainOptions small_options(double width_m = 1000, double length_m = 800) {
    TerrainOptions options;
    options.width_m = width_m;
    options.length_m = length_m;
    options.edge = 0;
    return options;
}

HeightImage random_heights(int columns, int rows, std::mt19937& random, double most_m) {
    HeightImage image{columns, rows, {}};
    std::uniform_real_distribution<float> height(0, float(most_m));
    for (int n = 0; n < columns * rows; ++n) image.heights.push_back(height(random));
    return image;
}

// Steps of a thirtieth of a cell, then halves the step in which the ray comes below the surface.
double distance_by_steps(const HeightMap& map, const TerrainRay& ray, double begin, double end) {
    const auto above = [&](double t) {
        return ray.height_m(t) - height_at(map, ray.from_m.x + t * ray.direction.x, ray.from_m.y + t * ray.direction.y);
    };
    const double step = std::min(map.step_x_m, map.step_y_m) / 30;
    if (above(begin) <= 0) return begin;
    for (double t = begin; t < end; t += step) {
        double low = t, high = std::min(t + step, end);
        if (above(high) > 0) continue;
        for (int n = 0; n < 60; ++n) (above(0.5 * (low + high)) > 0 ? low : high) = 0.5 * (low + high);
        return high;
    }
    return std::numeric_limits<double>::infinity();
}

TEST(TerrainRay, MeetsTheSurfaceWhereSmallStepsDo) {
    constexpr unsigned kSeed = 20261;
    std::mt19937 random(kSeed);
    std::uniform_real_distribution<double> place(-700, 700), way(-1, 1), up(0, 260);
    int hits = 0, misses = 0;
    for (const auto& [columns, rows] : {std::pair{2, 2}, {3, 17}, {33, 20}, {64, 65}}) {
        const HeightMap map = height_map(random_heights(columns, rows, random, 120), small_options(), 0);
        for (int n = 0; n < 150; ++n) {
            Vec3 direction{way(random), way(random), 0.4 * way(random)};
            if (n % 10 == 0) direction.x = 0;
            if (n % 15 == 0) direction.y = 0;
            if (n % 29 == 0) direction = {0, 0, -1};
            direction = direction / length(direction);
            const double bend = n % 3 == 0 ? 1e-4 : 0;  // a small planet
            const TerrainRay ray{{place(random), place(random), up(random)}, direction, bend};
            const double fast = terrain_distance(map, ray, 0, 2500), slow = distance_by_steps(map, ray, 0, 2500);
            if (std::isfinite(slow)) {
                // Small steps may overlook a crest that the ray grazes.
                EXPECT_LE(fast, slow + 1e-6) << "seed " << kSeed << ", " << columns << ", ray " << n;
            }
            if (!std::isfinite(fast)) {
                ++misses;
                continue;
            }
            ++hits;
            const double there = height_at(map, ray.from_m.x + fast * direction.x, ray.from_m.y + fast * direction.y);
            if (fast > 0 && there > -1e8) {
                EXPECT_LE(ray.height_m(fast), there + 1e-6) << "ray " << n;
            }
        }
    }
    EXPECT_GT(hits, 100);
    EXPECT_GT(misses, 100);
}

TEST(TerrainRay, MissesWhatTheEarthHides) {
    HeightImage image{3, 3, std::vector<float>(9, 100.0f)};
    TerrainOptions options = small_options(2000, 2000);
    options.y_m = 80'000;
    const HeightMap map = height_map(image, options, 0);
    const double bend = 0.5 / 6.36e6;
    // A level ray from 50 m is 503 m above a datum 80 km away, and 50 m over a plane.
    const TerrainRay round{{0, 0, 50}, {0, 1, 0}, bend}, plane{{0, 0, 50}, {0, 1, 0}, 0};
    EXPECT_TRUE(std::isinf(terrain_distance(map, round, 0, 2e5)));
    EXPECT_NEAR(terrain_distance(map, plane, 0, 2e5), 79'000, 1e-6);
    EXPECT_NEAR(round.height_m(80'000), 50 + 80'000.0 * 80'000.0 / (2 * 6.36e6), 1e-6);
}

TEST(HeightMap, HasNorthAtTheTopAndMeanSlopes) {
    HeightImage image{2, 3, {30, 40, 20, 30, 10, 20}};
    const HeightMap map = height_map(image, small_options(), 0);
    EXPECT_EQ(height_at(map, -500, 400), 30);
    EXPECT_EQ(height_at(map, 500, -400), 20);
    EXPECT_NEAR(height_at(map, 0, 0), 25, 1e-6);
    EXPECT_LT(height_at(map, 501, 0), -1e8);
    for (const double footprint : {1.0, 300.0, 5000.0}) {
        const MeanSlope slope = mean_slope(map, 20, 30, footprint);
        EXPECT_NEAR(slope.x, 10.0 / 1000, 1e-6);
        EXPECT_NEAR(slope.y, 20.0 / 800, 1e-6);
    }
}

TEST(HeightMap, GoesDownToTheGroundAtItsSides) {
    TerrainOptions options = small_options();
    options.edge = 0.25;
    const HeightMap map = height_map({21, 21, std::vector<float>(441, 300.0f)}, options, 40);
    EXPECT_EQ(height_at(map, 0, 0), 300);
    EXPECT_EQ(height_at(map, -500, 12), 40);
    EXPECT_EQ(height_at(map, 120, 400), 40);
}

TEST(HeightMap, SeesTheWholeSkyOnAPlaneAndLessInAPit) {
    HeightImage image{41, 41, std::vector<float>(41 * 41, 100.0f)};
    const TerrainExposure plane = height_map(image, small_options(1000, 1000), 0).exposure;
    for (const float sky : plane.sky) EXPECT_EQ(sky, 1);
    for (int j = 17; j < 24; ++j)
        for (int i = 17; i < 24; ++i) image.heights[std::size_t(41 * j + i)] = 0;
    const TerrainExposure pit = height_map(image, small_options(1000, 1000), 0).exposure;
    const std::size_t middle = 41 * 20 + 20;
    EXPECT_LT(pit.sky[middle], 0.65f);
    EXPECT_GT(pit.shelter[middle], 0.1f);
    EXPECT_EQ(pit.sky[41 * 5 + 5], 1);
    EXPECT_LT(pit.shelter[41 * 15 + 20], 0);
}

TEST(HeightMap, WaterRunsIntoHollowsAndFillsThoseWithoutOutlet) {
    // A valley from north down to south.
    HeightImage valley{41, 41, {}};
    for (int j = 0; j < 41; ++j)
        for (int i = 0; i < 41; ++i) valley.heights.push_back(float(4 * std::abs(i - 20) + (40 - j)));
    const TerrainExposure runs = height_map(valley, small_options(1000, 1000), 0).exposure;
    const auto row = [&](int j, int i) { return std::size_t(41 * j + i); };  // from the south
    EXPECT_GT(runs.gathers[row(5, 20)], 3 * runs.gathers[row(5, 8)]);
    EXPECT_GT(runs.gathers[row(5, 20)], 1.5f * runs.gathers[row(35, 20)]);  // more comes together further down
    double logs = 0;
    for (const float each : runs.gathers) logs += std::log(double(each));
    EXPECT_NEAR(logs / double(runs.gathers.size()), 0, 1e-4);
    for (const float depth : runs.pond_m) EXPECT_EQ(depth, 0);
    HeightImage pit{41, 41, std::vector<float>(41 * 41, 100.0f)};
    pit.heights[row(20, 20)] = 88;
    const TerrainExposure full = height_map(pit, small_options(1000, 1000), 0).exposure;
    EXPECT_EQ(full.pond_m[row(20, 20)], 12);
    EXPECT_EQ(full.pond_m[row(20, 22)], 0);
}

TEST(HeightMap, RefusesHeightsThatAreNone) {
    EXPECT_THROW(height_map({1, 5, std::vector<float>(5)}, small_options(), 0), Error);
    EXPECT_THROW(height_map({3, 3, std::vector<float>(8)}, small_options(), 0), Error);
    HeightImage image{2, 2, {0, 1, 2, std::numeric_limits<float>::quiet_NaN()}};
    EXPECT_THROW(height_map(image, small_options(), 0), Error);
}

TEST(HeightMap, RefusesSidesThatLeaveNothingOfIt) {
    TerrainOptions options = small_options();
    options.edge = 0.1;
    EXPECT_THROW(height_map({2, 5, std::vector<float>(10, 80.0f)}, options, 0), Error);
    EXPECT_EQ(height_at(height_map({3, 3, std::vector<float>(9, 80.0f)}, options, 0), 0, 0), 80);
}

// Options that no scene's reader has seen.
TEST(Terrain, RefusesOptionsBeyondTheirRanges) {
    const auto reason = [](const TerrainOptions& options) -> std::string {
        try {
            make_terrain(options, {});
        } catch (const Error& error) {
            return error.what();
        }
        return "";
    };
    TerrainOptions none = small_options(0, 0);
    none.relief = Relief::hills;
    EXPECT_NE(reason(none).find("terrain.width_m"), std::string::npos) << reason(none);
    EXPECT_THROW(height_map({3, 3, std::vector<float>(9)}, small_options(0, 0), 0), Error);
    TerrainOptions raw = small_options();
    raw.height_map = "alps.raw";
    raw.raw_columns = raw.raw_rows = 2'000'000'000;
    EXPECT_NE(reason(raw).find("terrain.raw_columns"), std::string::npos) << reason(raw);
}

TEST(StandingCamera, CountsHeightsFromTheGround) {
    const HeightMap map = height_map({2, 2, {100, 100, 100, 100}}, small_options(), 0);
    Ground ground;
    ground.height_m = 30;
    Camera camera;
    camera.position_m = {0, 0, 2};
    camera.target_m = {5000, 0, 10};
    camera.path = {{0, {10, 0, 5}, {0, 0, 6}}, {10, {9000, 0, 5}, {0, 0, 6}}};
    const std::array<double, 3> times_s{-1, 4.5, 20};
    EXPECT_EQ(standing_camera(camera, &map, ground, times_s), camera);
    EXPECT_EQ(standing_camera(camera, &map, ground, 5), camera_at(camera, 5));
    camera.above_ground = true;
    const Camera moving = standing_camera(camera, &map, ground, times_s);
    ASSERT_EQ(moving.path.size(), 3u);
    EXPECT_FALSE(moving.above_ground);
    EXPECT_EQ(moving.path[0].position_m.z, 105);
    EXPECT_EQ(moving.path[2].position_m.z, 35);
    for (const double time_s : times_s) {
        const Camera at = standing_camera(camera, &map, ground, time_s);
        EXPECT_TRUE(at.path.empty() && !at.above_ground);
        EXPECT_EQ(camera_at(moving, time_s), at);
    }
    camera.path.clear();
    const Camera still = standing_camera(camera, &map, ground, 0);
    EXPECT_EQ(still.position_m.z, 102);
    EXPECT_EQ(still.target_m.z, 40);  // beyond the map is the plane
    EXPECT_EQ(standing_camera(camera, nullptr, ground, 0).position_m.z, 32);
}

// A ridge between two key frames, both on the plain.
TEST(StandingCamera, DoesNotEnterARidgeOnItsWay) {
    const HeightMap map = height_map({3, 2, {0, 600, 0, 0, 600, 0}}, small_options(), 0);
    Camera camera;
    camera.above_ground = true;
    camera.path = {{0, {-600, 0, 20}, {0, 300, 5}}, {10, {600, 0, 40}, {0, 300, 5}}};
    for (double t = 0; t <= 10; t += 0.25) {
        const Vec3 eye = standing_camera(camera, &map, {}, t).position_m;
        const double above = eye.z - ground_height_at(&map, {}, eye.x, eye.y);
        EXPECT_GE(above, 20) << t;
        EXPECT_LE(above, 40) << t;
    }
    EXPECT_NEAR(standing_camera(camera, &map, {}, 5).position_m.z, 630, 1e-9);
}

TEST(TerrainView, RefusesACameraInTheGround) {
    const HeightMap map = height_map({2, 2, {100, 100, 100, 100}}, small_options(), 0);
    RenderOptions options;
    options.camera.position_m = {0, 0, 99};
    try {
        require_above_terrain(map, options);
        FAIL();
    } catch (const Error& error) {
        EXPECT_NE(std::string(error.what()).find("100.0 m high"), std::string::npos) << error.what();
    }
    options.camera.position_m = {0, 0, 101};
    EXPECT_NO_THROW(require_above_terrain(map, options));
}

// 3 m of ground below an eye at 10 km, and ground on the plane, which is the plane.
TEST(TerrainView, SeesLowGroundFromHighUp) {
    TerrainOptions wide = small_options(20'000, 20'000);
    RenderOptions options;
    options.camera.position_m = {0, 0, 10'000};
    options.camera.target_m = {0, 10, 0};
    options.camera.width = 16;
    options.camera.height = 12;
    const auto seen = [&](float z) {
        const HeightMap map = height_map({3, 3, std::vector<float>(9, z)}, wide, 0);
        return terrain_view(map, options, 0).distance_m;
    };
    for (const float distance : seen(3)) {
        EXPECT_GE(distance, 9996);
        EXPECT_LT(distance, 14'000);
    }
    for (const float distance : seen(0)) EXPECT_EQ(distance, kNoTerrain);
}

TEST(Drainage, LeadsAllWaterOutAndFillsHollows) {
    std::mt19937 random(7);
    constexpr int kColumns = 31, kRows = 24;
    const HeightImage image = random_heights(kColumns, kRows, random, 50);
    const Drainage drainage = drainage_of(image.heights, kColumns, kRows);
    ASSERT_EQ(drainage.order.size(), image.heights.size());
    std::vector<int> place(image.heights.size(), -1);
    for (std::size_t n = 0; n < drainage.order.size(); ++n) place[drainage.order[n]] = int(n);
    double out = 0;
    const std::vector<float> area = drained_cells(drainage);
    for (std::uint32_t node = 0; node < place.size(); ++node) {
        const std::uint32_t to = drainage.receiver[node];
        EXPECT_GE(drainage.filled_m[node], image.heights[node]);
        EXPECT_GE(drainage.filled_m[node], drainage.filled_m[to]);
        if (to == node)
            out += double(area[node]);
        else
            EXPECT_LT(place[to], place[node]);
    }
    EXPECT_EQ(out, kColumns * kRows);  // nothing is lost
}

TEST(Relief, IsAFunctionOfItsSeedAndFillsItsHeights) {
    for (const Relief kind : {Relief::hills, Relief::ridges}) {
        TerrainOptions options = small_options(20'000, 10'000);
        options.relief = kind;
        options.cells = 64;
        options.feature_m = 5000;
        const HeightImage image = relief_heights(options);
        EXPECT_EQ(image.columns, 64);
        EXPECT_EQ(image.rows, 33);
        const auto [low, high] = std::ranges::minmax(image.heights);
        EXPECT_EQ(low, 0);
        EXPECT_NEAR(high, 1, 1e-6);
        EXPECT_EQ(relief_heights(options).heights, image.heights);
        options.seed = 2;
        EXPECT_NE(relief_heights(options).heights, image.heights);
    }
}

// Files.

void write_png16(const std::filesystem::path& path, int columns, int rows, png_uint_32 format, const void* pixels) {
    png_image png{};
    png.version = PNG_IMAGE_VERSION;
    png.width = png_uint_32(columns);
    png.height = png_uint_32(rows);
    png.format = format;
    ASSERT_NE(png_image_write_to_file(&png, path.c_str(), 0, pixels, 0, nullptr), 0);
}

void write_exr_heights(const std::filesystem::path& path, int columns, int rows, const char* channel,
                       const std::vector<float>& values) {
    Imf::Header header(columns, rows);
    header.channels().insert(channel, Imf::Channel(Imf::FLOAT));
    Imf::OutputFile file(path.c_str(), header);
    Imf::FrameBuffer buffer;
    buffer.insert(channel, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(values.data())),
                                      sizeof(float), sizeof(float) * std::size_t(columns)));
    file.setFrameBuffer(buffer);
    file.writePixels(rows);
}

std::string reason_of(const std::filesystem::path& path, int columns = 0, int rows = 0) {
    try {
        read_height_file(path, columns, rows);
    } catch (const Error& error) {
        return error.what();
    }
    return "";
}

TEST(HeightFile, ReadsEachFormat) {
    const TemporaryFolder folder;
    const std::vector<std::uint16_t> numbers{0, 1, 256, 65535, 4660, 22136};
    const std::vector<float> expected(numbers.begin(), numbers.end());
    write_png16(folder.path() / "a.png", 3, 2, PNG_FORMAT_LINEAR_Y, numbers.data());
    const HeightFile png = read_height_file(folder.path() / "a.png", 0, 0);
    EXPECT_EQ(png.image.columns, 3);
    EXPECT_EQ(png.image.rows, 2);
    EXPECT_EQ(png.image.heights, expected);
    EXPECT_FALSE(png.metres);
    std::ofstream raw(folder.path() / "a.RAW", std::ios::binary);
    for (const std::uint16_t number : numbers) raw.put(char(number & 255)).put(char(number >> 8));
    raw.close();
    EXPECT_EQ(read_height_file(folder.path() / "a.RAW", 3, 2).image.heights, expected);
    const std::vector<float> metres{-12.5f, 0, 8848, 1, 2, 3};
    write_exr_heights(folder.path() / "a.exr", 2, 3, "height", metres);
    const HeightFile exr = read_height_file(folder.path() / "a.exr", 0, 0);
    EXPECT_EQ(exr.image.rows, 3);
    EXPECT_EQ(exr.image.heights, metres);
    EXPECT_TRUE(exr.metres);

    TerrainOptions options = small_options();
    options.height_map = folder.path() / "a.png";
    options.height_scale_m = 6553.5;
    options.offset_m = 100;
    const auto map = make_terrain(options, {});
    ASSERT_NE(map, nullptr);
    EXPECT_NEAR(map->highest_m, 6653.5, 1e-3);
    EXPECT_NEAR(map->lowest_m, 100, 1e-6);
    EXPECT_EQ(make_terrain({}, {}), nullptr);
}

TEST(HeightFile, SaysWhatIsWrong) {
    const TemporaryFolder folder;
    const std::vector<std::uint8_t> bytes(12, 7);
    write_png16(folder.path() / "grey8.png", 3, 4, PNG_FORMAT_GRAY, bytes.data());
    EXPECT_NE(reason_of(folder.path() / "grey8.png").find("8 bits"), std::string::npos) << reason_of(folder.path() / "grey8.png");
    const std::vector<std::uint16_t> colours(12, 7);
    write_png16(folder.path() / "rgb.png", 2, 2, PNG_FORMAT_LINEAR_RGB, colours.data());
    EXPECT_NE(reason_of(folder.path() / "rgb.png").find("colours"), std::string::npos);
    const std::vector<std::uint16_t> numbers(12, 7);
    write_png16(folder.path() / "row.png", 12, 1, PNG_FORMAT_LINEAR_Y, numbers.data());
    EXPECT_NE(reason_of(folder.path() / "row.png").find("12 x 1"), std::string::npos);
    write_png16(folder.path() / "cut.png", 3, 4, PNG_FORMAT_LINEAR_Y, numbers.data());
    std::filesystem::resize_file(folder.path() / "cut.png", 60);
    EXPECT_NE(reason_of(folder.path() / "cut.png").find("PNG"), std::string::npos);
    std::ofstream(folder.path() / "text.png") << "no picture";
    EXPECT_NE(reason_of(folder.path() / "text.png").find("text.png"), std::string::npos);
    std::ofstream(folder.path() / "text.exr") << "no picture";
    EXPECT_NE(reason_of(folder.path() / "text.exr").find("OpenEXR"), std::string::npos);
    write_exr_heights(folder.path() / "nan.exr", 2, 2, "Z", {0, 1, std::numeric_limits<float>::quiet_NaN(), 2});
    EXPECT_NE(reason_of(folder.path() / "nan.exr").find("column 1, row 2"), std::string::npos) << reason_of(folder.path() / "nan.exr");
    std::ofstream(folder.path() / "a.raw") << "12345678";
    EXPECT_NE(reason_of(folder.path() / "a.raw").find("raw_columns"), std::string::npos);
    EXPECT_NE(reason_of(folder.path() / "a.raw", 3, 2).find("has 8 bytes; expected 12"), std::string::npos);
    EXPECT_NE(reason_of(folder.path() / "a.raw", 4097, 2).find("2 to 4096, not 4097 x 2"), std::string::npos);
    EXPECT_NE(reason_of(folder.path() / "a.tif").find(".png, .exr, .raw or .r16"), std::string::npos);
    EXPECT_NE(reason_of(folder.path() / "none.png").find("none.png"), std::string::npos);
}

}  // namespace
}  // namespace nephos
