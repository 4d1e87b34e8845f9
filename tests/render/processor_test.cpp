// SPDX-License-Identifier: Apache-2.0
// The processor's light and view in batches and for every kind of vector, without a Vulkan device.

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>
#include <hwy/highway.h>

#include "render/backend/processor_light.h"
#include "render/cpu/processor_view.h"
#include "render/frame/scattering_table.h"
#include "tests/render/random_billboards.h"
#include "tests/render/reference_render.h"

namespace nephos {
namespace {

struct Drawn {
    Picture picture;
    std::vector<float> light;
};

Drawn draw(const Splats& splats, const RenderOptions& options, const BatchLimits& limits) {
    const PreparedCloud prepared = prepare(splats.metaballs);
    const CameraFrame camera = camera_frame(options.camera);
    Drawn drawn;
    Picture& picture = drawn.picture = blank_picture(options);
    picture.shadow_frame = shadow_frame(prepared, direction_to_sun(options.sun), options.shadow_map_size);
    const LightSortedSplats sun = sort_for_light(prepared, picture.shadow_frame, options.shadow_map_size);
    std::vector<float> ordered;
    light_by_processor(sun, picture.shadow_size, {}, ordered, picture.shadow, limits);
    drawn.light.resize(ordered.size());
    for (std::size_t i = 0; i < ordered.size(); ++i) drawn.light[sun.source[i]] = ordered[i];
    ViewSortedSplats eye =
        sort_for_view(prepared, splats, camera, pixels_per_unit(options.camera, camera), options.ground);
    set_light(eye, {drawn.light, {}});
    const PicturePart whole{0, 0, picture.width, picture.height};
    PictureFrame frame = frame_data(options, camera, picture.shadow_frame, nullptr, whole);
    const std::vector<float> scattering = scattering_table(options.light);
    frame.scattering = scattering.data();
    ProcessorView(options, camera, frame, whole, eye, limits)
        .draw(picture, picture.shadow.data(), picture.shadow_size, AirShells{});
    for (float& each : drawn.light) each = std::exp(-each);
    return drawn;
}

void expect_near(const std::vector<float>& a, const std::vector<float>& b, float tolerance,
                 const char* what) {
    ASSERT_EQ(a.size(), b.size()) << what;
    for (std::size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i], b[i], tolerance) << what << ' ' << i;
}

// From outside, and from inside, where many metaballs are integrated.
std::vector<RenderOptions> outside_and_inside() {
    std::vector<RenderOptions> all;
    for (const Vec3& eye : {Vec3{0, -4000, 800}, Vec3{50, 60, 1000}}) {
        RenderOptions options;
        options.camera.position_m = eye;
        options.camera.target_m = {300, 700, 1100};
        options.camera.width = 75;
        options.camera.height = 50;
        options.shadow_map_size = 128;
        all.push_back(options);
    }
    return all;
}

void expect_near(const Drawn& a, const Drawn& b, float tolerance) {
    expect_near(a.light, b.light, tolerance, "light");
    expect_near(a.picture.shadow, b.picture.shadow, tolerance, "shadow");
    expect_near(a.picture.beauty, b.picture.beauty, tolerance, "beauty");
    expect_near(a.picture.transmittance, b.picture.transmittance, tolerance, "transmittance");
}

// Batches may stop at another ball once a tile is opaque: what they leave out is below kOpaque.
TEST(Processor, BatchesDoNotShow) {
    const std::vector<Metaball> balls = reference::random_metaballs(11, 500);
    const std::vector<CloudBillboard> billboards = test::random_billboards(11, 50, 2);
    Splats cloud = test::scene_of(test::kBillboardClouds, billboards);
    cloud.metaballs = {balls, 0.01, 0.7};
    for (const RenderOptions& options : outside_and_inside()) {
        const Drawn one = draw(cloud, options, {});
        expect_near(one, draw(cloud, options, {37, 1000}), 5e-4f);
        // Not everything is clear, and not everything is hidden.
        const auto [least, most] = std::ranges::minmax(one.picture.transmittance);
        EXPECT_LT(least, 0.5f);
        EXPECT_GT(most, least + 0.1f);
    }
}

// Vectors of 4, 8 and 16 lanes, with and without fused multiply-add, as far as this processor has them.
TEST(Processor, EveryTargetDrawsTheSamePicture) {
    const std::vector<Metaball> balls = reference::random_metaballs(12, 500);
    const std::vector<CloudBillboard> billboards = test::random_billboards(12, 50, 2);
    Splats cloud = test::scene_of(test::kBillboardClouds, billboards);
    cloud.metaballs = {balls, 0.01, 0.7};
    const std::int64_t all = hwy::SupportedTargets();
    for (const RenderOptions& options : outside_and_inside()) {
        const Drawn expected = draw(cloud, options, {});
        for (std::int64_t rest = all; rest != 0; rest &= rest - 1) {
            hwy::SetSupportedTargetsForTest(rest & -rest);
            hwy::GetChosenTarget().Update(hwy::SupportedTargets());
            SCOPED_TRACE(hwy::TargetName(rest & -rest));
            expect_near(expected, draw(cloud, options, {}), 1e-4f);
        }
        hwy::SetSupportedTargetsForTest(0);
        hwy::GetChosenTarget().DeInit();
    }
}

}  // namespace
}  // namespace nephos
