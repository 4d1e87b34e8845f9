// SPDX-License-Identifier: Apache-2.0
// T's absorption factor over voxel clouds against numerical integration along the rays, and the pictures that
// it lights.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "render/cloud/voxel_absorption.h"
#include "render/renderer.h"
#include "tests/render/picture_checks.h"
#include "tests/render/reference_render.h"

namespace nephos {
namespace {

constexpr double kCell_m = 50;
// A saturated lattice of metaballs of two cells' radius has density 1 (density/metaballs.h).
const double kNormalisation = 2835.0 / (736.0 * std::numbers::pi * 8.0);

// Metaballs as the automaton's: one on each point of a lattice inside of three overlapping balls of cloud, of
// densities that vary, of two cells' radius.
std::vector<Metaball> voxel_cloud() {
    std::vector<Metaball> balls;
    for (int k = 0; k < 30; ++k) {
        for (int j = -20; j < 20; ++j) {
            for (int i = -20; i < 20; ++i) {
                const double x = kCell_m * (i + 0.5), y = kCell_m * (j + 0.5), z = 500 + kCell_m * (k + 0.5);
                const auto inside = [&](double cx, double cy, double cz, double r) {
                    return std::hypot(x - cx, y - cy, z - cz) < r;
                };
                if (!inside(0, 0, 1100, 500) && !inside(450, 100, 900, 350) && !inside(-300, 300, 1500, 250))
                    continue;
                const double density = 0.55 + 0.45 * std::sin(0.011 * x) * std::cos(0.013 * y + 0.007 * z);
                balls.push_back({float(x), float(y), float(z), float(2 * kCell_m), float(density)});
            }
        }
    }
    return balls;
}

MetaballCloud cloud_of(const std::vector<Metaball>& balls) { return {balls, 0.02, kNormalisation}; }

// The integral of density along a ray, by Simpson's rule in each metaball.
double column_m(const MetaballCloud& cloud, const reference::Ray& ray) {
    double sum = 0;
    for (const Metaball& ball : cloud.metaballs) sum += double(ball.density) * reference::column_m(ball, ray);
    return cloud.normalisation * sum;
}

Vec3 centre(const Metaball& ball) { return {ball.x, ball.y, ball.z}; }

TEST(VoxelAbsorption, EqualsNumericalIntegrationAlongTheRays) {
    const std::vector<Metaball> balls = voxel_cloud();
    const MetaballCloud cloud = cloud_of(balls);
    const PreparedCloud prepared = prepare(cloud);
    const DensityBlocks blocks(prepared, cloud.extinction_per_m);
    EXPECT_NEAR(blocks.edge_m(), kCell_m, 1e-3);
    constexpr double kLightDistance_m = 600;
    double worst = 0, squares = 0;
    int count = 0;
    const auto compare = [&](double found, double column) {
        const double expected = std::clamp(column / kLightDistance_m, 0.0, 1.0);
        worst = std::max(worst, std::abs(found - expected));
        squares += (found - expected) * (found - expected);
        ++count;
    };
    // Above, low, and below the horizon; and a place at which lightning strikes.
    for (const Sun& sun : {Sun{60, 100, {}}, Sun{5, 230, {}}, Sun{-15, 20, {}}, Sun{90, 0, {}}}) {
        const Vec3 way = direction_to_sun(sun);
        for (std::size_t i = 0; i < balls.size(); i += 23)
            compare(blocks.absorbed_towards(centre(balls[i]), way, kLightDistance_m),
                    column_m(cloud, {centre(balls[i]), way}));
    }
    const Vec3 flash{900, -700, 400};
    for (std::size_t i = 0; i < balls.size(); i += 23) {
        const Vec3 from = centre(balls[i]);
        const double x = flash.x - from.x, y = flash.y - from.y, z = flash.z - from.z,
                     l = std::hypot(x, y, z);
        compare(blocks.absorbed_from(from, flash, kLightDistance_m),
                column_m(cloud, {from, {x / l, y / l, z / l}, l}));
    }
    std::printf("absorption of voxels: largest error %.4f, root mean square %.4f, of %d rays\n", worst,
                std::sqrt(squares / count), count);
    EXPECT_LT(worst, 2 * blocks.edge_m() / kLightDistance_m);  // what the header promises
    EXPECT_LT(std::sqrt(squares / count), 0.03);
}

TEST(VoxelAbsorption, BoundsAreExact) {
    const std::vector<Metaball> balls = voxel_cloud();
    const MetaballCloud cloud = cloud_of(balls);
    const PreparedCloud prepared = prepare(cloud);
    const DensityBlocks blocks(prepared, cloud.extinction_per_m);
    const Vec3 deep{0, 0, 1100}, up{0, 0, 1};
    EXPECT_EQ(blocks.absorbed_towards(deep, up, std::numeric_limits<double>::infinity()), 0);
    EXPECT_EQ(blocks.absorbed_towards(deep, up, 1), 1);
    EXPECT_EQ(blocks.absorbed_towards({0, 0, 5000}, up, 100), 0);
    EXPECT_EQ(blocks.absorbed_from(deep, deep, 100), 0);
    // Beyond the light nothing counts.
    EXPECT_LT(blocks.absorbed_from(deep, {0, 0, 1150}, 1000), 0.06);
    // From far outside right through the cloud, the same in both directions.
    const double down = blocks.column_m({10, 20, 9000}, {0, 0, -1}, 1e9, 1e9);
    EXPECT_NEAR(blocks.column_m({10, 20, -9000}, up, 1e9, 1e9), down, 1e-9);
    EXPECT_GT(down, 500);
    const DensityBlocks none(prepare(MetaballCloud{}), 0.02);
    EXPECT_EQ(none.absorbed_towards(deep, up, 100), 0);
}

class AbsorptionPictureTest : public ::testing::Test {
  protected:
    void TearDown() override { test::expect_no_messages(renderer_); }
    Renderer renderer_{DeviceOptions{.device = {}, .validation = true}};
};

RenderOptions options_of(Lighting lighting) {
    RenderOptions options;
    options.camera.position_m = {0, -3500, 800};
    options.camera.target_m = {0, 0, 1100};
    options.camera.width = 96;
    options.camera.height = 72;
    options.shadow_map_size = 64;
    options.light.lighting = lighting;
    options.light.light_distance_m = 600;
    return options;
}

// The light of every metaball and the shadow map are 1 minus the absorption along the sun's rays.
TEST_F(AbsorptionPictureTest, LightAndShadowAreThatOfTheRays) {
    const std::vector<Metaball> balls = voxel_cloud();
    const MetaballCloud cloud = cloud_of(balls);
    const RenderOptions options = options_of(Lighting::cfa);
    const Picture picture = renderer_.draw(cloud, options);
    const Vec3 to_sun = direction_to_sun(options.sun);
    for (std::size_t i = 0; i < balls.size(); i += 41)
        EXPECT_NEAR(picture.light[i], 1 - std::min(column_m(cloud, {centre(balls[i]), to_sun}) / 600, 1.0),
                    0.17)
            << i;
    ASSERT_EQ(picture.shadow.size(), 64u * 64u);
    reference::DifferenceSum sum;
    const ShadowFrame& frame = picture.shadow_frame;
    for (int v = 0; v < 64; v += 3) {
        for (int u = 0; u < 64; u += 3) {
            const double a = (u + 0.5) / 64, b = (v + 0.5) / 64;
            const Vec3 start{frame.origin_m.x + a * frame.u_axis_m.x + b * frame.v_axis_m.x,
                             frame.origin_m.y + a * frame.u_axis_m.y + b * frame.v_axis_m.y,
                             frame.origin_m.z + a * frame.u_axis_m.z + b * frame.v_axis_m.z};
            sum.add(double(picture.shadow[std::size_t(64 * v + u)]),
                    1 - std::min(column_m(cloud, {start, frame.direction}) / 600, 1.0));
        }
    }
    EXPECT_LT(sum.result().max, 0.2);
    EXPECT_LT(sum.result().mean, 0.02);
    // What is seen through the cloud does not depend on how it is lit.
    const Picture passed = renderer_.draw(cloud, options_of(Lighting::light_pass));
    EXPECT_EQ(picture.transmittance, passed.transmittance);
}

// Lightning behind the cloud reaches its rear side more than the front, and falls off with the distance.
TEST_F(AbsorptionPictureTest, LightningLightsVoxelCloudsFromItsPlace) {
    const std::vector<Metaball> balls = voxel_cloud();
    RenderOptions options = options_of(Lighting::light_pass);
    options.sun.elevation_deg = -18;
    const auto brightness = [&](std::optional<Flash> flash) {
        Splats splats;
        splats.metaballs = cloud_of(balls);
        splats.flash = flash;
        const Picture picture = renderer_.draw_splats(splats, options);
        double sum = 0;
        for (std::size_t i = 0; i < picture.pixels(); ++i)
            if (picture.transmittance[i] < 0.01f) sum += double(picture.beauty[3 * i]);
        return sum;
    };
    const double dark = brightness({});
    const double before = brightness(Flash{{0, -1500, 1100}, {1, 1, 1}, 1});
    const double behind = brightness(Flash{{0, 1500, 1100}, {1, 1, 1}, 1});
    const double far = brightness(Flash{{0, -30000, 1100}, {1, 1, 1}, 1});
    EXPECT_GT(before, 20 * std::max(dark, 1.0));
    EXPECT_GT(before, 3 * behind);
    EXPECT_GT(behind, dark);
    EXPECT_LT(far - dark, 0.01 * before);
}

TEST(Lightning, TheBrightestThatBurnsLights) {
    const std::vector<LightningFlash> lightning{{{0, 0, 1}, 10, 2, {1, 1, 1}, 4},
                                                {{0, 0, 2}, 11, 2, {1, 1, 1}, 3},
                                                {{0, 0, 3}, 20, 0.5, {1, 1, 1}, 0}};
    EXPECT_FALSE(flash_at(lightning, 9.99));
    EXPECT_EQ(flash_at(lightning, 10)->intensity, 4);
    EXPECT_EQ(flash_at(lightning, 10.5)->intensity, 4 * 0.5625);
    EXPECT_EQ(flash_at(lightning, 11)->position_m.z, 2);  // the first one has faded to a quarter
    EXPECT_FALSE(flash_at(lightning, 13));
    EXPECT_FALSE(flash_at(lightning, 20)) << "a flash without light";
    EXPECT_FALSE(flash_at({}, 0));
}

}  // namespace
}  // namespace nephos
