// SPDX-License-Identifier: Apache-2.0
// The processor's light and view where they do not fit into one batch, without a Vulkan device.

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "render/processor_light.h"
#include "render/processor_view.h"
#include "tests/render/reference_render.h"

namespace nephos {
namespace {

struct Drawn {
    Picture picture;
    std::vector<float> light;
};

Drawn draw(const MetaballCloud& cloud, const RenderOptions& options, const BatchLimits& limits) {
    const PreparedCloud prepared = prepare(cloud);
    const CameraFrame camera = camera_frame(options.camera);
    Drawn drawn;
    Picture& picture = drawn.picture;
    picture.width = options.camera.width;
    picture.height = options.camera.height;
    picture.beauty.resize(3 * picture.pixels());
    picture.transmittance.resize(picture.pixels());
    picture.depth_m.resize(picture.pixels());
    picture.shadow_size = options.shadow_map_size;
    picture.shadow_frame = shadow_frame(prepared, direction_to_sun(options.sun), options.shadow_map_size);
    const SunOrder sun = order_from_sun(prepared, picture.shadow_frame, options.shadow_map_size);
    const std::vector<float> ordered = light_by_processor(sun, picture.shadow_size, picture.shadow, limits);
    drawn.light.resize(ordered.size());
    for (std::size_t i = 0; i < ordered.size(); ++i) drawn.light[sun.source[i]] = ordered[i];
    Splats splats;
    splats.metaballs = cloud;
    const EyeOrder eye = order_from_eye(prepared, {drawn.light, {}}, splats, camera,
                                        pixels_per_unit(options.camera, camera), options.ground);
    const Tile whole{0, 0, picture.width, picture.height};
    const shader::Frame frame = frame_data(options, camera, picture.shadow_frame, nullptr, whole);
    view_by_processor(options, camera, frame, whole, eye, picture, limits);
    return drawn;
}

void expect_near(const std::vector<float>& a, const std::vector<float>& b, float tolerance,
                 const char* what) {
    ASSERT_EQ(a.size(), b.size()) << what;
    for (std::size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i], b[i], tolerance) << what << ' ' << i;
}

// From outside, and from inside, where many metaballs are integrated. Batches may stop at another ball once a
// tile is opaque: what they leave out is below kOpaque.
TEST(Processor, BatchesDoNotShow) {
    const std::vector<Metaball> balls = reference::random_metaballs(11, 500);
    const MetaballCloud cloud{balls, 0.01, 0.7};
    for (const Vec3& eye : {Vec3{0, -4000, 800}, Vec3{50, 60, 1000}}) {
        RenderOptions options;
        options.camera.position_m = eye;
        options.camera.target_m = {300, 700, 1100};
        options.camera.width = 75;
        options.camera.height = 50;
        options.shadow_map_size = 128;
        const Drawn one = draw(cloud, options, {});
        const Drawn many = draw(cloud, options, {37, 1000});
        expect_near(one.light, many.light, 1e-6f, "light");
        expect_near(one.picture.shadow, many.picture.shadow, 1e-6f, "shadow");
        expect_near(one.picture.beauty, many.picture.beauty, 1e-3f, "beauty");
        expect_near(one.picture.transmittance, many.picture.transmittance, 1e-3f, "transmittance");
        // Not everything is white, and not everything is hidden.
        const auto [least, most] = std::ranges::minmax(one.picture.transmittance);
        EXPECT_LT(least, 0.5f);
        EXPECT_GT(most, least + 0.1f);
    }
}

}  // namespace
}  // namespace nephos
