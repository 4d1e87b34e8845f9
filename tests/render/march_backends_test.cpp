// SPDX-License-Identifier: Apache-2.0
// Clouds with detail, marched by the shaders, against those of the processor.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "density/density_grid.h"
#include "density/metaballs.h"
#include "render/renderer.h"
#include "tests/render/renderer_test_access.h"
#include "tests/render/picture_checks.h"
#include "tests/render/random_billboards.h"
#include "tests/render/voxel_cloud.h"

namespace nephos {
namespace {

// Heaps of voxels with detail, with the metaballs that stand for them.
struct DetailedCloud {
    std::vector<Metaball> balls;
    std::vector<DetailedVoxels> detailed;
    double extinction_per_m = 0.15;

    void add(const Vec3& origin_m, int seed, const DetailOptions& options = {}) {
        const Extent extent{24, 20, 14};
        std::vector<float> values(extent.cells(), 0.0f);
        for (int z = 0; z < extent.z; ++z) {
            for (int y = 0; y < extent.y; ++y) {
                for (int x = 0; x < extent.x; ++x) {
                    const double dx = (x + 0.5) / extent.x - 0.5, dy = (y + 0.5) / extent.y - 0.5,
                                 dz = (z + 0.5) / extent.z - 0.3;
                    const double inside = 1 - 5 * (dx * dx + dy * dy + dz * dz);
                    if (inside > 0)
                        values[linear_index(extent, x, y, z)] =
                            float(0.6 * inside * test::voxel_noise(x, y, z, seed));
                }
            }
        }
        DetailedVoxels& part = detailed.emplace_back();
        part.density = DensityGrid::from_dense(values, extent, {origin_m, 40.0});
        part.setting = {.options = options, .extinction_per_m = extinction_per_m, .drift_m = {1234, -567, 0}};
        if (detailed.size() % 2 == 1) part.setting.bands = {140, {{-90, 10}, {0, 0}, {70, -5}, {300, 40}}};
        const std::vector<Metaball> own = metaballs(part.density, part.setting.metaball_radius_cells);
        part.first = balls.size();
        part.count = own.size();
        balls.insert(balls.end(), own.begin(), own.end());
    }

    Splats splats() const {
        Splats result;
        result.metaballs = {balls, extinction_per_m, metaball_normalisation(2), detailed};
        return result;
    }
};

// Pixels that differ by more than 1/255 in any channel, of pictures in which white is 1.
std::size_t different(const Picture& a, const Picture& b) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < a.pixels(); ++i) {
        float most = 0;
        for (std::size_t c = 0; c < 3; ++c)
            most = std::max(most, std::abs(a.beauty[3 * i + c] - b.beauty[3 * i + c]) /
                                      std::max(1.0f, b.beauty[3 * i + c]));
        if (most > 1.0f / 255.0f) ++count;
    }
    return count;
}

class MarchBackends : public ::testing::Test {
  protected:
    void TearDown() override { test::expect_no_messages(vulkan_); }

    // `every_depth`: otherwise single rays may pass an edge, which they meet in a picture of the other.
    void expect_same(const Splats& splats, const RenderOptions& options, const std::string& what,
                     bool every_depth = true) {
        const Picture slow = cpu_.draw_splats(splats, options), fast = vulkan_.draw_splats(splats, options);
        const std::size_t count = different(fast, slow);
        std::printf("%s: %zu of %zu pixels differ, beauty by up to %.5f, transmittance %.5f\n", what.c_str(), count,
                    slow.pixels(), double(test::largest_difference(fast.beauty, slow.beauty)),
                    double(test::largest_difference(fast.transmittance, slow.transmittance)));
        EXPECT_LE(count, slow.pixels() / 1000) << what;
        EXPECT_LE(test::largest_difference(fast.shadow, slow.shadow), 1e-6f) << what;
        std::size_t covered = 0;
        for (const float each : slow.transmittance) covered += each < 0.5f ? 1 : 0;
        EXPECT_GT(covered, slow.pixels() / 100) << what;
        if (every_depth) {
            test::expect_same_depths(fast, slow, 0.1f, 0.01f);
            return;
        }
        std::size_t apart = 0;
        for (std::size_t i = 0; i < slow.pixels(); ++i)
            apart += slow.transmittance[i] < 0.9f && std::abs(fast.depth_m[i] / slow.depth_m[i] - 1) > 0.01f ? 1 : 0;
        EXPECT_LE(apart, slow.pixels() / 1000) << what;
    }

    Renderer cpu_{test::validated(Splatting::cpu)}, vulkan_{test::validated(Splatting::vulkan)};
};

struct MarchView {
    const char* name;
    Vec3 from, to;
    double fov_deg;
};

// With 96 x 72 pixels the footprint of a pixel is about 12 m, 2 m, 6 m (rising to where rays end), 3 m and 20 m.
constexpr MarchView kViews[] = {{"from afar", {0, -2000, 500}, {480, 400, 1250}, 20},
                                {"near", {480, -350, 1250}, {480, 400, 1200}, 20},
                                {"from below", {300, -300, 400}, {480, 500, 1300}, 60},
                                {"from within", {480, 300, 1250}, {500, 2000, 1250}, 40},
                                {"where metaballs take over", {0, -2800, 800}, {480, 400, 1250}, 30}};

TEST_F(MarchBackends, Agree) {
    DetailedCloud cloud;
    cloud.add({0, 0, 1000}, 1);
    for (const MarchView& each : kViews)
        expect_same(cloud.splats(), test::view(each.from, each.to, each.fov_deg, 96, 72), each.name);
}

TEST_F(MarchBackends, AgreeOnSeveralVolumes) {
    DetailedCloud cloud;
    DetailOptions fibres;
    fibres.stretch = 8;
    fibres.size_m = 300;
    cloud.add({0, 0, 1000}, 1);
    cloud.add({300, 200, 1250}, 2, fibres);
    cloud.add({-900, 900, 1100}, 3);
    for (const MarchView& each : kViews)
        expect_same(cloud.splats(), test::view(each.from, each.to, each.fov_deg, 96, 72), each.name);
}

TEST_F(MarchBackends, AgreeOnCloudsToTheHorizon) {
    DetailedCloud cloud;
    cloud.add({0, 0, 1000}, 1);
    DetailOptions no_images;
    no_images.to_horizon = false;
    cloud.add({200, 300, 1900}, 2, no_images);
    for (DetailedVoxels& part : cloud.detailed)
        part.setting.boundaries.x = part.setting.boundaries.y = Boundary::periodic;
    for (const AirModel model : {AirModel::gradient, AirModel::physical}) {
        for (const MarchView& each : {MarchView{"over land", {0, -2000, 300}, {480, 4000, 1250}, 60},
                                      MarchView{"from above", {300, -3000, 6000}, {900, 9000, 0}, 50},
                                      MarchView{"within", {9480, 7300, 1250}, {9500, 9000, 1250}, 40}}) {
            RenderOptions options = test::view(each.from, each.to, each.fov_deg, 96, 72);
            options.atmosphere.model = model;
            options.shells.count = 24;
            options.light_shafts.strength = 1;
            options.ground.pattern = GroundPattern::country;
            expect_same(cloud.splats(), options, each.name, false);
        }
    }
}

TEST_F(MarchBackends, AgreeThroughAir) {
    DetailedCloud cloud;
    cloud.add({0, 0, 1000}, 1);
    for (const MarchView& each : kViews) {
        RenderOptions options = test::view(each.from, each.to, each.fov_deg, 96, 72);
        options.shells.count = 24;
        options.light_shafts.strength = 1;
        options.fog.extinction_per_m = 2e-4;
        options.fog.height_m = 900;
        expect_same(cloud.splats(), options, each.name);
    }
}

// Requires that cloud which dims the sun ten thousand times is not taken for opaque: the disc is brighter than all around it.
TEST_F(MarchBackends, TheSunShinesThroughThickCloud) {
    RenderOptions options = test::view({0, -2000, 500}, {480, 400, 1210}, 3, 96, 72);
    const Vec3 way = options.camera.target_m - options.camera.position_m;
    options.sun.azimuth_deg = std::atan2(way.x, way.y) * 180 / std::numbers::pi;
    options.sun.elevation_deg = std::atan2(way.z, std::hypot(way.x, way.y)) * 180 / std::numbers::pi;
    options.atmosphere.model = AirModel::physical;
    options.camera.glare = 0.1;  // the disc as bright as it is
    DetailedCloud detailed, plain;
    detailed.extinction_per_m = 0.05;
    plain.extinction_per_m = 0.065;
    for (DetailedCloud* cloud : {&detailed, &plain}) cloud->add({0, 0, 1000}, 1);
    Splats metaballs = plain.splats();
    metaballs.metaballs.detailed = {};
    for (const bool marched : {true, false}) {
        const Splats splats = marched ? detailed.splats() : metaballs;
        const Picture slow = cpu_.draw_splats(splats, options), fast = vulkan_.draw_splats(splats, options),
                      clear = cpu_.draw_splats({}, options);
        // Elsewhere rays and splats end here.
        const float opaque = marched ? 1.0f / 64.0f : 1.0f / 4096.0f;
        std::size_t dimmed = 0;
        for (std::size_t i = 0; i < slow.pixels(); ++i) {
            const float disc = clear.beauty[3 * i], left = slow.transmittance[i];
            if (disc < 1e4f) continue;
            EXPECT_NEAR(slow.beauty[3 * i], left * disc, 3) << "transmittance " << left;
            EXPECT_NEAR(fast.beauty[3 * i] / slow.beauty[3 * i], 1, 0.05) << "transmittance " << left;
            EXPECT_NEAR(std::log(fast.transmittance[i]), std::log(left), 0.05);
            dimmed += left > 1e-7f && left < opaque ? 1 : 0;
        }
        EXPECT_GT(dimmed, 20u);
    }
}

// The colours of a glory and a fogbow: the sun behind the eye.
TEST_F(MarchBackends, AgreeOnFogbowAndGlory) {
    DetailedCloud cloud;
    cloud.add({0, 0, 1000}, 1);
    RenderOptions options = test::view({480, -2000, 2400}, {480, 400, 1250}, 35, 96, 72);
    options.sun.azimuth_deg = 180;
    options.sun.elevation_deg = 26;
    options.light.phase = {Phase::hg_draine, 0, 10};
    const Picture plain = cpu_.draw_splats(cloud.splats(), options);
    options.light.bows = 1;
    expect_same(cloud.splats(), options, "glory");
    const Picture glory = vulkan_.draw_splats(cloud.splats(), options);
    EXPECT_GT(test::largest_difference(glory.beauty, plain.beauty), 0.02f);
    float reddest = 0;  // of what the bows add
    for (std::size_t i = 0; i < glory.beauty.size(); i += 3)
        reddest = std::max(reddest, (glory.beauty[i] - plain.beauty[i]) - (glory.beauty[i + 2] - plain.beauty[i + 2]));
    EXPECT_GT(reddest, 0.004f);
}

TEST_F(MarchBackends, AgreeBetweenBillboards) {
    DetailedCloud cloud;
    cloud.add({-480, -400, 800}, 1);
    const std::vector<CloudBillboard> billboards = test::random_billboards(5, 60, 2);
    for (MarchView each : kViews) {
        each.from.y -= 600;
        each.from.x -= 480;
        each.to = {0, 0, 1050};
        Splats splats = cloud.splats();
        splats.clouds = test::kBillboardClouds;
        splats.billboards = billboards;
        expect_same(splats, test::view(each.from, each.to, each.fov_deg, 96, 72), each.name);
    }
}

// Neither batches of splats nor parts of the picture show; nor do the clouds of another frame.
TEST_F(MarchBackends, PartsAreWholePictures) {
    Renderer parts(test::validated(Splatting::vulkan, 40));
    RendererTestAccess::limit_lists(parts, std::size_t{1} << 24, 37);
    for (const int seed : {1, 4}) {
        DetailedCloud cloud;
        cloud.add({0, 0, 1000}, seed);
        for (const double distance : {2400.0, 2800.0}) {
            RenderOptions options = test::view({0, -distance, 800}, {480, 400, 1250}, 30, 96, 72);
            if (seed == 4) options.light_shafts.strength = 1;
            const Picture whole = vulkan_.draw_splats(cloud.splats(), options),
                          other = parts.draw_splats(cloud.splats(), options);
            EXPECT_LE(different(other, whole), whole.pixels() / 1000);
            EXPECT_LE(test::largest_difference(whole.transmittance, other.transmittance), 0.5f / 255.0f);
        }
    }
    test::expect_no_messages(parts);
}

}  // namespace
}  // namespace nephos
