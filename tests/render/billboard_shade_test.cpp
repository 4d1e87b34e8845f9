// SPDX-License-Identifier: Apache-2.0
// The shade of billboards: what they hide when they are looked at from the sun.

#include "render/frame/billboard_row.h"
#include "render/frame/billboard_shade.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "core/error.h"
#include "render/cloud/cloud_volume.h"
#include "render/frame/billboard_textures.h"
#include "render/rain/precipitation_light.h"
#include "tests/render/picture_checks.h"
#include "tests/render/random_billboards.h"
#include "tests/render/voxel_cloud.h"

namespace nephos {
namespace {

constexpr Vec3 kZenith{0, 0, 1};

// A picture of one opacity everywhere.
std::shared_ptr<const BillboardPictures> even_picture(float opacity) {
    const AlphaImage image{8, 8, std::vector<float>(64, opacity), std::vector<float>(64, opacity)};
    return billboard_pictures(1, [&](std::size_t) { return image; });
}

// Flat: what is 100 m below it is behind all of it.
CloudBillboard plate(const Vec3& centre_m, float size_m, std::uint32_t cloud = 0) {
    CloudBillboard billboard;
    billboard.centre_m = centre_m;
    billboard.width_m = size_m;
    billboard.height_m = 200;
    billboard.picture = 0;
    billboard.cloud = cloud;
    return billboard;
}

// All turns and levels; rows of any length, which begin and end beyond the rim.
TEST(BillboardShade, RowsAreTheirPlaces) {
    for (const unsigned turn : {0u, 1u, 2u, 3u, 4u, 5u, 6u, 7u}) {
        for (unsigned level = 0; level < unsigned{kBillboardLevels}; ++level) {
            const TurnedTexture texture(billboard_texels(nullptr), level, 3 + turn % 4, turn);
            const int count = 5 + int(13 * turn + level);
            const PlacesInRow places{.first = -1.04f, .step = 2.1f / float(count)};
            const float up = -0.9f + 0.23f * float(turn);
            std::vector<float> light(static_cast<std::size_t>(count), 0.5f);
            shade_row(texture, places, up, 0.8f, light);
            for (int i = 0; i < count; ++i) {
                const float right = places.first + float(i) * places.step;
                ASSERT_NEAR(light[std::size_t(i)], 0.5f * (1 - 0.8f * texture.opacity(right, up)), 2e-5f)
                    << "turn " << turn << ", level " << level << ", place " << i;
            }
        }
    }
}

// Bytes of a picture hold opacities in steps of 1/255.
float in_bytes(float opacity) { return std::round(255 * opacity) / 255; }

TEST(BillboardShade, LeavesOneMinusOpacityBehindEach) {
    const float opacity = in_bytes(0.3f);
    const std::vector<CloudBillboard> plates{plate({0, 0, 1000}, 400, 0), plate({0, 0, 2000}, 400, 1)};
    const BillboardShade shade(plates, {}, even_picture(0.3f), kZenith);
    const auto at = [&](double z, std::uint32_t but_for = BillboardShade::kNoCloud) {
        return shade.sunlight_at({20, -30, z}, but_for);
    };
    EXPECT_EQ(at(3000), 1.0f);
    EXPECT_NEAR(at(1500), 1 - opacity, 1e-6f);
    EXPECT_NEAR(at(0), (1 - opacity) * (1 - opacity), 1e-6f);
    EXPECT_NEAR(at(0, 1), 1 - opacity, 1e-6f) << "but for the upper cloud";
    EXPECT_EQ(at(1500, 1), 1.0f);
    EXPECT_NEAR(at(2000), 1 - 0.5f * opacity, 1e-6f) << "in the middle of an ellipsoid, half of its shade";
    EXPECT_NEAR(at(1950), 1 - 0.75f * opacity, 1e-6f);
    EXPECT_EQ(shade.sunlight_at({201, 0, 0}), 1.0f) << "beside it";
}

// An ellipsoid of 1200 m x 300 m: from the zenith a circle, from the horizon an ellipse.
TEST(BillboardShade, HasTheOutlineOfAnEllipsoid) {
    CloudBillboard flat = plate({0, 0, 1000}, 1200);
    flat.height_m = 300;
    const auto picture = even_picture(1);
    for (const double elevation : {90.0, 50.0, 20.0, 0.0}) {
        const double angle = elevation * std::numbers::pi / 180;
        const Vec3 to_sun{0, -std::cos(angle), std::sin(angle)};
        const BillboardShade shade({&flat, 1}, {}, picture, to_sun);
        const Vec3 right = shadow_axes(to_sun).right, up = shadow_axes(to_sun).up;
        const double half = std::hypot(150 * std::cos(angle), 600 * std::sin(angle));
        const auto left = [&](double u, double v) {
            return shade.sunlight_at(flat.centre_m - 3000.0 * to_sun + u * right + v * up);
        };
        // The texture is clear at its rim, a texel of 32.
        EXPECT_LT(left(0, 0.85 * half), 0.01f) << elevation;
        EXPECT_EQ(left(0, 1.01 * half), 1.0f) << elevation;
        EXPECT_LT(left(0.85 * 600, 0), 0.01f) << elevation;
        EXPECT_EQ(left(1.01 * 600, 0), 1.0f) << elevation;
    }
}

TEST(BillboardShade, MapAndPlacesAgreeInTheMean) {
    std::vector<CloudBillboard> billboards = test::random_billboards(3, 60, 2);
    for (const double elevation : {90.0, 40.0}) {
        RenderOptions options;
        options.sun.elevation_deg = elevation;
        const Vec3 to_sun = direction_to_sun(options.sun);
        const BillboardShade shade(billboards, {}, nullptr, to_sun);
        constexpr int kSize = 128;
        const ShadowFrame frame = shadow_frame({}, to_sun, kSize, shade.casters());
        std::vector<float> map(std::size_t{kSize} * kSize, 1.0f);
        shade.cast(frame, kSize, map);
        double cast = 0, found = 0, apart = 0;
        for (int row = 0; row < kSize; ++row) {
            for (int column = 0; column < kSize; ++column) {
                const Vec3 place = frame.origin_m + (column + 0.5) / kSize * frame.u_axis_m +
                                   (row + 0.5) / kSize * frame.v_axis_m + 5000.0 * frame.direction;
                const double a = double(map[std::size_t(row) * kSize + std::size_t(column)]),
                             b = double(shade.sunlight_at(place));
                cast += 1 - a;
                found += 1 - b;
                apart += std::abs(a - b);
            }
        }
        EXPECT_NEAR(cast, found, 0.02 * found) << elevation;
        EXPECT_LT(apart, 0.25 * found) << elevation;  // textures of 32 texels against finer ones
    }
}

TEST(BillboardShade, DependsOnNoOrder) {
    std::vector<CloudBillboard> billboards = test::random_billboards(7, 300, 2);
    RenderOptions options;
    options.sun.elevation_deg = 35;
    const Vec3 to_sun = direction_to_sun(options.sun);
    constexpr int kSize = 64;
    std::vector<float> first(std::size_t{kSize} * kSize, 1.0f), second = first;
    const BillboardShade before(billboards, {}, nullptr, to_sun);
    const ShadowFrame frame = shadow_frame({}, to_sun, kSize, before.casters());
    before.cast(frame, kSize, first);
    std::shuffle(billboards.begin(), billboards.end(), std::mt19937(4));
    const std::span<const CloudBillboard> all = billboards;
    const BillboardShade after(all.first(100), all.subspan(100), nullptr, to_sun);
    after.cast(frame, kSize, second);
    EXPECT_EQ(first, second);
    EXPECT_EQ(before.sunlight_at({10, 20, 0}), after.sunlight_at({10, 20, 0}));
}

// Much smaller than a texel, a billboard takes as much light from the map as its area is.
TEST(BillboardShade, SmallOnesKeepTheirShade) {
    const auto picture = even_picture(0.5f);
    constexpr int kPlates = 60;
    const auto taken_m2 = [&](float size_m) {
        std::vector<CloudBillboard> many;
        for (int n = 0; n < kPlates; ++n)
            many.push_back(plate({n * 377 % 1000 + 0.1 * n, n * 613 % 1000 + 0.17 * n, 500}, size_m));
        const BillboardShade shade(many, {}, picture, kZenith);
        constexpr int kSize = 64;
        const ShadowFrame frame = shadow_frame({}, kZenith, kSize, shade.casters());
        std::vector<float> map(std::size_t{kSize} * kSize, 1.0f);
        shade.cast(frame, kSize, map);
        double sum = 0;
        for (const float left : map) sum += 1 - double(left);
        return sum * length(frame.u_axis_m) * length(frame.v_axis_m) / (kSize * kSize);
    };
    EXPECT_NEAR(taken_m2(4) / taken_m2(2), 4, 0.1);
    EXPECT_NEAR(taken_m2(4) / (kPlates * 16 * 0.5), 1, 0.25);  // of the few texels that each has on the map
}

// What is no cloud of voxels darkens the corners of cells, and is not counted as the volume's own.
TEST(DepthOfOthers, IsAddedToAVolumesOwn) {
    const Extent extent{32, 32, 16};
    std::vector<float> values(std::size_t{32} * 32 * 16, 0.0f);
    for (int z = 4; z < 12; ++z)
        for (int y = 8; y < 24; ++y)
            for (int x = 8; x < 24; ++x) values[linear_index(extent, x, y, z)] = 0.5f;
    DetailedVoxels part{.density = DensityGrid::from_dense(values, extent, {{0, 0, 0}, 50})};
    part.setting.extinction_per_m = 0.01;
    part.setting.options.strength = part.setting.options.thermals = 0;
    std::vector<CloudVolume> plain, shaded;
    plain.emplace_back(part);
    shaded.emplace_back(part);
    light_volumes(plain, kZenith, {}, true);
    light_volumes(shaded, kZenith, {}, true, [](const Vec3&) { return 0.7f; });
    ASSERT_EQ(plain[0].sun_depths.size(), shaded[0].sun_depths.size());
    const auto depth = [](std::uint16_t packed) {
        const double root = packed / 65535.0;
        return root * root * double(kMostMarchedDepth);
    };
    for (std::size_t i = 0; i + 1 < plain[0].sun_depths.size(); i += 7)
        EXPECT_NEAR(depth(shaded[0].sun_depths[i]), depth(plain[0].sun_depths[i]) + 0.7, 0.01);
    for (const double z : {100.0, 300.0, 500.0})
        EXPECT_NEAR(sun_depth_at(shaded[0], {800, 800, z}), sun_depth_at(plain[0], {800, 800, z}), 1e-3);
}

class ShadeOfBillboards : public test::AllBackends {
  protected:
    // Ground at 0 below a sun in the zenith, without air.
    static RenderOptions above(Vec3 from, double fov, int size) {
        RenderOptions options = test::view(from, {from.x, from.y, 0}, fov, size, size, 128);
        options.sun.elevation_deg = 90;
        options.air.extinction_per_m = {0, 0, 0};
        return options;
    }
};

// The ground's shade is the transmittance of the cloud as it is seen from the sun, pixel by pixel.
TEST_P(ShadeOfBillboards, OnTheGroundIsTheTransmittanceSeenFromTheSun) {
    std::vector<CloudBillboard> billboards = test::random_billboards(3, 40, 2);
    for (CloudBillboard& each : billboards) each.height_m = each.width_m = 2 * each.width_m;
    const Splats cloud = test::scene_of(test::kBillboardClouds, billboards);
    constexpr int kSide = 96;
    // Both see 2 km of ground: from 100 km, and from below the clouds.
    RenderOptions far = above({0, 0, 100000}, 2 * std::atan(0.01) * 180 / std::numbers::pi, kSide);
    RenderOptions near = above({0, 0, 400}, 2 * std::atan(2.5) * 180 / std::numbers::pi, kSide);
    std::vector<CloudBillboard> high = billboards;
    for (CloudBillboard& each : high) each.centre_m.z += 500;  // above the near camera
    const Splats above_camera = test::scene_of(test::kBillboardClouds, high);
    const Picture seen = renderer_.draw_splats(cloud, far),
                  shaded = renderer_.draw_splats(above_camera, near);
    const Picture open = renderer_.draw_splats({}, near);
    RenderOptions night = near;
    night.sun.colour = {0, 0, 0};
    const Picture dark = renderer_.draw_splats({}, night);
    double apart = 0, covered = 0, taken = 0;
    for (std::size_t i = 0; i < seen.pixels(); ++i) {
        ASSERT_EQ(shaded.transmittance[i], 1.0f) << "the camera sees a cloud: the test proves nothing";
        const double left = double(shaded.beauty[3 * i + 1] - dark.beauty[3 * i + 1]) /
                            double(open.beauty[3 * i + 1] - dark.beauty[3 * i + 1]);
        apart += std::abs(left - double(seen.transmittance[i]));
        covered += 1 - double(seen.transmittance[i]);
        taken += 1 - left;
    }
    EXPECT_GT(covered, 0.1 * double(seen.pixels()));
    EXPECT_LT(apart, 0.1 * covered);  // texels of both are filtered otherwise
    EXPECT_NEAR(taken, covered, 0.03 * covered);
    RecordProperty("mean_difference", std::to_string(apart / double(seen.pixels())));
}

// A metaball below a plate has 1 - opacity of the light that it has in the open, above it all of it.
TEST_P(ShadeOfBillboards, FallsOnVoxelClouds) {
    const std::vector<CloudBillboard> plates{plate({0, 0, 2000}, 3000)};
    const std::vector<Metaball> balls{{0, 0, 900, 100, 1}, {50, 0, 3500, 100, 1}};
    Splats alone, both = test::scene_of(test::kBillboardClouds, plates);
    alone.metaballs = both.metaballs = {balls, 0.004, 1.0};
    both.pictures = even_picture(0.4f);
    RenderOptions options = above({0, -6000, 2000}, 40, 48);
    options.camera.target_m = {0, 0, 1500};
    for (const Lighting lighting : {Lighting::light_pass, Lighting::cfa}) {
        options.light.lighting = lighting;
        options.light.light_distance_m = 5000;
        const Picture open = renderer_.draw_splats(alone, options),
                      shaded = renderer_.draw_splats(both, options);
        const float below = shaded.light[0] / open.light[0], above = shaded.light[1] / open.light[1];
        EXPECT_NEAR(below, 1 - in_bytes(0.4f), 0.002f);
        EXPECT_NEAR(above, 1.0f, 1e-5f);
        // Rain and snow take it from the picture's map.
        const float open_below = sunlight_at(open, {1000, 900, 100}),
                    rain = sunlight_at(shaded, {1000, 900, 100});
        EXPECT_EQ(open_below, 1.0f);
        EXPECT_NEAR(rain, 1 - in_bytes(0.4f), 0.002f);
    }
}

// A billboard below others, and below voxels, has what these leave; its own cloud does not shade it but by T's factor.
TEST_P(ShadeOfBillboards, FallsOnBillboardsOfOtherClouds) {
    CloudBillboard low = plate({0, 0, 1000}, 600, 0);
    low.height_m = 600;
    const CloudBillboard own = plate({0, 0, 2500}, 900, 0), other = plate({0, 0, 2500}, 900, 1);
    const std::vector<Metaball> balls{{0, 0, 2500, 400, 1}};
    RenderOptions options = test::view({0, -3000, 1000}, {0, 0, 1000}, 8, 33, 33, 256);
    options.sun.elevation_deg = 90;
    const auto light = [&](const std::vector<CloudBillboard>& billboards, const MetaballCloud& voxels,
                           double sun) {
        Splats splats = test::scene_of(test::kBillboardClouds, billboards);
        splats.metaballs = voxels;
        splats.pictures = even_picture(0.5f);
        options.sun.colour = {sun, sun, sun};
        return double(renderer_.draw_splats(splats, options).beauty[3 * (5 * 33 + 16) + 1]);
    };
    const double dark = light({low}, {}, 0), open = light({low}, {}, 1) - dark;
    ASSERT_GT(open, 0.02);
    EXPECT_NEAR((light({low, own}, {}, 1) - dark) / open, 1, 0.01);
    EXPECT_NEAR((light({low, other}, {}, 1) - dark) / open, 1 - in_bytes(0.5f), 0.01);
    const MetaballCloud voxels{balls, 0.002, 1.0};
    const double line = 2 * (1 - 22.0 / 27 + 17.0 / 45 - 4.0 / 63);  // the integral of f from -1 to 1
    const double through = std::exp(-0.002 * 400 * line);
    EXPECT_NEAR((light({low}, voxels, 1) - dark) / open, through, 0.01);
    EXPECT_NEAR((light({low, other}, voxels, 1) - dark) / open, through * double(1 - in_bytes(0.5f)), 0.01);
}

// Fog below a ceiling of opaque billboards is as dark as below closed clouds.
TEST_P(ShadeOfBillboards, FallsOnAir) {
    const std::vector<CloudBillboard> ceiling{plate({0, 0, 1500}, 12000)};
    RenderOptions options = test::view({0, 0, 1}, {0, 100, 1.5}, 5, 4, 4, 256);
    options.light.ambient_base = options.light.ambient_top = {0, 0, 0};
    options.air.extinction_per_m = {0, 0, 0};
    options.sun.elevation_deg = 60;
    options.fog = {0.1, 0, 1000, 0, 300, {}, 1};
    options.shells = {40, 10, 1.1};
    Splats closed = test::scene_of(test::kBillboardClouds, ceiling);
    closed.pictures = even_picture(1);
    const double open = double(renderer_.draw_splats({}, options).beauty[1]);
    ASSERT_GT(open, 0.001);
    EXPECT_LT(double(renderer_.draw_splats(closed, options).beauty[1]), 0.03 * open);
}

// What is out of sight casts its shadow as if it were seen; below the horizon the sun casts none.
TEST_P(ShadeOfBillboards, ComesFromUnseenBillboardsToo) {
    const std::vector<CloudBillboard> billboards = test::random_billboards(9, 80, 2);
    Splats listed = test::scene_of(test::kBillboardClouds, billboards), unseen;
    unseen.unseen = billboards;
    RenderOptions options =
        test::view({0, -100, 300}, {0, 0, 0}, 60, 48, 48, 128);  // clouds are behind the camera
    options.sun.elevation_deg = 70;
    const Picture a = renderer_.draw_splats(listed, options), b = renderer_.draw_splats(unseen, options),
                  none = renderer_.draw_splats({}, options);
    EXPECT_EQ(a.beauty, b.beauty);
    EXPECT_NE(b.beauty, none.beauty);
    options.sun.elevation_deg = -3;
    EXPECT_EQ(renderer_.draw_splats(unseen, options).beauty, renderer_.draw_splats({}, options).beauty);
}

INSTANTIATE_TEST_SUITE_P(Ways, ShadeOfBillboards,
                         ::testing::Values(Splatting::cpu, Splatting::vulkan, Splatting::blended),
                         test::way_name);

}  // namespace
}  // namespace nephos
