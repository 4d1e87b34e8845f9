// SPDX-License-Identifier: Apache-2.0
// The renderer's transmittance and light against integrals along the rays (reference_render.h).

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "tests/render/picture_checks.h"
#include "tests/render/reference_render.h"
#include "tests/render/renderer_views.h"

namespace nephos {
namespace {

class RendererIntegrals : public test::AllBackends {};

reference::Difference compare_transmittance(const Picture& picture, const MetaballCloud& cloud,
                                            const RenderOptions& options) {
    reference::DifferenceSum sum;
    for (int y = 0; y < picture.height; ++y)
        for (int x = 0; x < picture.width; ++x)
            sum.add(
                double(picture.transmittance[std::size_t(y) * std::size_t(picture.width) + std::size_t(x)]),
                reference::transmittance(cloud, reference::pixel_ray(options, x, y)));
    return sum.result();
}

// The centre of the acceptance: thin, ordinary and opaque clouds from everywhere, the eye inside of metaballs
// too.
TEST_P(RendererIntegrals, TransmittanceEqualsNumericalIntegration) {
    reference::Difference worst;
    for (const unsigned seed : {1u, 2u}) {
        for (const test::View& each : test::views()) {
            const double radius = test::smallest_radius_m(each.options.camera);
            const std::vector<Metaball> balls =
                reference::random_metaballs(seed, 300, radius, std::max(200.0, 1.5 * radius));
            for (const double extinction : {0.0005, 0.01, 3.0}) {
                const MetaballCloud cloud{balls, extinction, 0.7};
                const Picture picture = renderer_.draw(cloud, each.options);
                const reference::Difference difference = compare_transmittance(picture, cloud, each.options);
                EXPECT_LT(difference.max, 0.02)
                    << each.name << ", seed " << seed << ", extinction " << extinction;
                EXPECT_LT(difference.mean, 0.002)
                    << each.name << ", seed " << seed << ", extinction " << extinction;
                worst.max = std::max(worst.max, difference.max);
                worst.mean = std::max(worst.mean, difference.mean);
            }
        }
    }
    std::printf("transmittance: largest error %.5f, largest mean %.6f\n", worst.max, worst.mean);
}

// A metaball of a tenth of a pixel takes about the same light out of the picture wherever it falls between
// pixels.
TEST_P(RendererIntegrals, MetaballsSmallerThanAPixelKeepTheirShadow) {
    const RenderOptions options = test::view({0, -10000, 1000}, {0, 0, 1000}, 20, 33, 33);
    const double pixel_m = 2 * 10000 * std::tan(10 * std::numbers::pi / 180) / 33;
    const double radius = 0.1 * pixel_m;
    // The integral of f over the ball, 4 pi R^3 * 184/2835, is that of its column over all rays.
    const double expected = 4 * std::numbers::pi * radius * radius * radius * (184.0 / 2835.0);
    for (const double shift : {0.0, 0.21, 0.5, 0.77}) {
        const std::vector<Metaball> ball{
            {float(shift * pixel_m), 0, float(1000 + 0.4 * shift * pixel_m), float(radius), 1}};
        const double extinction = 1e-3;
        const Picture picture = renderer_.draw({ball, extinction, 1.0}, options);
        double sum = 0;
        for (const float value : picture.transmittance) sum += -std::log(double(value)) * pixel_m * pixel_m;
        EXPECT_NEAR(sum / extinction / expected, 1.0, 0.08) << shift;
    }
}

// One metaball fills the picture: every level of the textures and the dense ones beyond, rim included.
TEST_P(RendererIntegrals, TransmittanceOfOneMetaballAtEveryDepthScale) {
    const std::vector<Metaball> ball{{0, 0, 1000, 100, 1}};
    const RenderOptions options = test::view({0, -1000, 1000}, {0, 0, 1000}, 12);
    for (double depth_scale = 1e-4; depth_scale < 1e6; depth_scale *= 1.9) {
        const MetaballCloud cloud{ball, depth_scale / 100.0, 1.0};
        const reference::Difference difference =
            compare_transmittance(renderer_.draw(cloud, options), cloud, options);
        EXPECT_LT(difference.max, 0.01) << depth_scale;
        EXPECT_LT(difference.mean, 0.001) << depth_scale;
    }
}

// Metaballs that reach into the ground end there.
TEST_P(RendererIntegrals, GroundHidesWhatLiesBelow) {
    std::vector<Metaball> balls = reference::random_metaballs(5, 200, 100, 300);
    for (Metaball& ball : balls) ball.z -= 700;
    const MetaballCloud cloud{balls, 0.01, 1.0};
    for (const RenderOptions& options :
         {test::view({0, -3000, 900}, {0, 0, 0}), test::view({0, -300, 100}, {0, 0, 0})}) {
        const reference::Difference difference =
            compare_transmittance(renderer_.draw(cloud, options), cloud, options);
        EXPECT_LT(difference.max, 0.02);
        EXPECT_LT(difference.mean, 0.002);
    }
}

TEST_P(RendererIntegrals, ShadowMapEqualsNumericalIntegration) {
    const std::vector<Metaball> balls = reference::random_metaballs(3, 300);
    const MetaballCloud cloud{balls, 0.01, 0.7};
    for (const double elevation : {90.0, 40.0, 5.0, -1.0}) {
        RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000}, 50, 8, 8);
        options.sun.elevation_deg = elevation;
        options.sun.azimuth_deg = 70;
        const Picture picture = renderer_.draw(cloud, options);
        const ShadowFrame& frame = picture.shadow_frame;
        const int size = picture.shadow_size;
        ASSERT_EQ(picture.shadow.size(), std::size_t(size) * std::size_t(size));
        reference::DifferenceSum sum;
        for (int v = 0; v < size; ++v) {
            for (int u = 0; u < size; ++u) {
                const double a = (u + 0.5) / size, b = (v + 0.5) / size;
                const auto at = [&](double o, double du, double dv, double d) {
                    return o + a * du + b * dv - 1e5 * d;
                };
                const reference::Ray ray{
                    {at(frame.origin_m.x, frame.u_axis_m.x, frame.v_axis_m.x, frame.direction.x),
                     at(frame.origin_m.y, frame.u_axis_m.y, frame.v_axis_m.y, frame.direction.y),
                     at(frame.origin_m.z, frame.u_axis_m.z, frame.v_axis_m.z, frame.direction.z)},
                    frame.direction};
                sum.add(double(picture.shadow[std::size_t(v) * std::size_t(size) + std::size_t(u)]),
                        reference::transmittance(cloud, ray));
            }
        }
        const reference::Difference difference = sum.result();
        EXPECT_LT(difference.max, 0.02) << elevation;
        EXPECT_LT(difference.mean, 0.002) << elevation;
        // The frame holds the whole cloud: the border is in full light, and light travels away from the sun.
        for (int i = 0; i < size; ++i) {
            EXPECT_EQ(picture.shadow[std::size_t(i)], 1.0f);
            EXPECT_EQ(picture.shadow[std::size_t(i) * std::size_t(size)], 1.0f);
            EXPECT_EQ(picture.shadow[std::size_t(i + 1) * std::size_t(size) - 1], 1.0f);
            EXPECT_EQ(picture.shadow[std::size_t(size - 1) * std::size_t(size) + std::size_t(i)], 1.0f);
        }
        const Vec3 sun = reference::to_sun(options.sun);
        EXPECT_NEAR(sun.x * frame.direction.x + sun.y * frame.direction.y + sun.z * frame.direction.z, -1,
                    1e-12);
    }
}

// The light of each metaball is the integral from its centre to the sun.
TEST_P(RendererIntegrals, LightAtTheCentresEqualsNumericalIntegration) {
    const std::vector<Metaball> balls = reference::lattice_cloud(20, 50);
    for (const double extinction : {0.002, 0.01}) {
        const MetaballCloud cloud{balls, extinction, reference::kNormalisationTwoCells};
        for (const double elevation : {90.0, 35.0, 3.0}) {
            RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000}, 50, 8, 8);
            options.shadow_map_size = 256;
            options.sun.elevation_deg = elevation;
            const Picture picture = renderer_.draw(cloud, options);
            ASSERT_EQ(picture.light.size(), balls.size());
            const Vec3 sun = reference::to_sun(options.sun);
            reference::DifferenceSum sum;
            double bias = 0;
            for (std::size_t i = 0; i < balls.size(); i += 7) {
                const double exact =
                    reference::transmittance(cloud, {{balls[i].x, balls[i].y, balls[i].z}, sun});
                sum.add(double(picture.light[i]), exact);
                bias += double(picture.light[i]) - exact;
            }
            bias /= double(balls.size() / 7);
            const reference::Difference difference = sum.result();
            std::printf("light: extinction %g, sun %g: max %.4f mean %.4f bias %.4f\n", extinction, elevation,
                        difference.max, difference.mean, bias);
            EXPECT_LT(difference.max, 0.002);
            EXPECT_LT(difference.mean, 0.0005);
            EXPECT_LT(std::abs(bias), 0.0005);
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Ways, RendererIntegrals,
                         ::testing::Values(Splatting::cpu, Splatting::vulkan, Splatting::blended),
                         test::way_name);

}  // namespace
}  // namespace nephos
