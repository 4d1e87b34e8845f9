// SPDX-License-Identifier: Apache-2.0
// The renderer against its naive twin, and the promises of renderer.h.

#include "render/renderer.h"

#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "automaton/error.h"
#include "tests/reference/with_threads.h"
#include "tests/render/reference_render.h"

namespace nephos {
namespace {

// Every test draws in every way, with the validation layer on, and fails when it says anything.
class RendererTest : public ::testing::TestWithParam<Splatting> {
  protected:
    static DeviceOptions validated(int tile_size = 2048) { return {{}, true, tile_size, GetParam()}; }
    void TearDown() override {
        for (const std::string& message : renderer_.validation_messages()) ADD_FAILURE() << message;
    }
    Renderer renderer_{validated()};
};

RenderOptions view(Vec3 from, Vec3 to, double fov = 50, int width = 64, int height = 48) {
    RenderOptions options;
    options.camera.position_m = from;
    options.camera.target_m = to;
    options.camera.vertical_fov_deg = fov;
    options.camera.width = width;
    options.camera.height = height;
    options.shadow_map_size = 128;
    return options;
}

struct View {
    const char* name;
    RenderOptions options;
};

std::vector<View> views() {
    return {{"side", view({0, -4000, 800}, {0, 0, 1000})},
            {"below", view({100, 200, 10}, {100, 900, 1200}, 70)},
            {"above", view({-800, -500, 4000}, {0, 0, 800})},
            {"inside", view({50, 60, 1000}, {700, 300, 1100}, 60)},
            {"straight up", view({30, 40, 5}, {30, 40, 1000}, 90)},
            {"straight down", view({30, 40, 3000}, {30, 40, 0}, 40)},
            {"wide", view({-900, -900, 600}, {0, 0, 1000}, 150, 80, 40)},
            {"tall", view({0, -3000, 1000}, {0, 0, 1000}, 40, 7, 65)},
            {"far", view({60000, 90000, 8000}, {0, 0, 1000}, 3)}};
}

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

// Smaller metaballs than this are widened (renderer.h); a ray through the middle of a pixel is then no
// measure.
double smallest_radius_m(const Camera& camera) {
    const double pixel = 2 * std::tan(camera.vertical_fov_deg * std::numbers::pi / 360) / camera.height;
    return 1.3 * pixel *
           (std::hypot(camera.position_m.x, camera.position_m.y, camera.position_m.z - 1000) + 1500);
}

// The centre of the acceptance: thin, ordinary and opaque clouds from everywhere, the eye inside of metaballs
// too.
TEST_P(RendererTest, TransmittanceEqualsNumericalIntegration) {
    reference::Difference worst;
    for (const unsigned seed : {1u, 2u}) {
        for (const View& each : views()) {
            const double radius = smallest_radius_m(each.options.camera);
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
TEST_P(RendererTest, MetaballsSmallerThanAPixelKeepTheirShadow) {
    const RenderOptions options = view({0, -10000, 1000}, {0, 0, 1000}, 20, 33, 33);
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
TEST_P(RendererTest, TransmittanceOfOneMetaballAtEveryDepthScale) {
    const std::vector<Metaball> ball{{0, 0, 1000, 100, 1}};
    const RenderOptions options = view({0, -1000, 1000}, {0, 0, 1000}, 12);
    for (double depth_scale = 1e-4; depth_scale < 1e6; depth_scale *= 1.9) {
        const MetaballCloud cloud{ball, depth_scale / 100.0, 1.0};
        const reference::Difference difference =
            compare_transmittance(renderer_.draw(cloud, options), cloud, options);
        EXPECT_LT(difference.max, 0.01) << depth_scale;
        EXPECT_LT(difference.mean, 0.001) << depth_scale;
    }
}

// Metaballs that reach into the ground end there.
TEST_P(RendererTest, GroundHidesWhatLiesBelow) {
    std::vector<Metaball> balls = reference::random_metaballs(5, 200, 100, 300);
    for (Metaball& ball : balls) ball.z -= 700;
    const MetaballCloud cloud{balls, 0.01, 1.0};
    for (const RenderOptions& options : {view({0, -3000, 900}, {0, 0, 0}), view({0, -300, 100}, {0, 0, 0})}) {
        const reference::Difference difference =
            compare_transmittance(renderer_.draw(cloud, options), cloud, options);
        EXPECT_LT(difference.max, 0.02);
        EXPECT_LT(difference.mean, 0.002);
    }
}

TEST_P(RendererTest, ShadowMapEqualsNumericalIntegration) {
    const std::vector<Metaball> balls = reference::random_metaballs(3, 300);
    const MetaballCloud cloud{balls, 0.01, 0.7};
    for (const double elevation : {90.0, 40.0, 5.0, -1.0}) {
        RenderOptions options = view({0, -4000, 800}, {0, 0, 1000}, 50, 8, 8);
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

// Metaballs on a lattice, as the automaton gives them.
std::vector<Metaball> lattice_cloud(int cells, float cell_m) {
    std::vector<Metaball> balls;
    for (int k = 0; k < cells; ++k)
        for (int j = 0; j < cells; ++j)
            for (int i = 0; i < cells; ++i) {
                const float x = float(i) + 0.5f - 0.5f * float(cells),
                            y = float(j) + 0.5f - 0.5f * float(cells),
                            z = float(k) + 0.5f - 0.5f * float(cells);
                const float density = 1.0f - (x * x + y * y + z * z) / (0.25f * float(cells * cells));
                if (density > 0)
                    balls.push_back({x * cell_m, y * cell_m, 1000 + z * cell_m, 2 * cell_m, density});
            }
    return balls;
}

constexpr double kNormalisationTwoCells = 2835.0 / (736.0 * std::numbers::pi * 8.0);

// The light of each metaball is the integral from its centre to the sun.
TEST_P(RendererTest, LightAtTheCentresEqualsNumericalIntegration) {
    const std::vector<Metaball> balls = lattice_cloud(20, 50);
    for (const double extinction : {0.002, 0.01}) {
        const MetaballCloud cloud{balls, extinction, kNormalisationTwoCells};
        for (const double elevation : {90.0, 35.0, 3.0}) {
            RenderOptions options = view({0, -4000, 800}, {0, 0, 1000}, 50, 8, 8);
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

void expect_same_bits(const std::vector<float>& a, const std::vector<float>& b, const char* what) {
    ASSERT_EQ(a.size(), b.size()) << what;
    EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(float)), 0) << what;
}

void expect_same_bits(const Picture& a, const Picture& b) {
    expect_same_bits(a.beauty, b.beauty, "beauty");
    expect_same_bits(a.transmittance, b.transmittance, "transmittance");
    expect_same_bits(a.depth_m, b.depth_m, "depth");
    expect_same_bits(a.shadow, b.shadow, "shadow");
    expect_same_bits(a.light, b.light, "light");
}

TEST_P(RendererTest, TwoRunsGiveTheSameBits) {
    const std::vector<Metaball> balls = lattice_cloud(20, 50);
    const MetaballCloud cloud{balls, 0.02, kNormalisationTwoCells};
    const RenderOptions options = view({0, -2000, 800}, {0, 0, 1000}, 50, 160, 120);
    const Picture first = renderer_.draw(cloud, options);
    renderer_.draw(
        {}, view({0, -2000, 800}, {0, 0, 1000}, 50, 32, 200));  // what is kept in between must not show
    expect_same_bits(first, renderer_.draw(cloud, options));
    Renderer other(validated());
    expect_same_bits(first, other.draw(cloud, options));
}

TEST_P(RendererTest, ThreadsDoNotChangeTheBits) {
    const std::vector<Metaball> balls = lattice_cloud(20, 50);
    const MetaballCloud cloud{balls, 0.02, kNormalisationTwoCells};
    for (const RenderOptions& options : {view({0, -2000, 800}, {0, 0, 1000}, 50, 160, 120),
                                         view({0, -300, 800}, {0, 0, 1000}, 80, 160, 120)}) {
        const auto draw = [&](std::size_t threads) {
            return test::with_threads(threads, [&] { return renderer_.draw(cloud, options); });
        };
        const Picture one = draw(1);
        expect_same_bits(one, draw(2));
        expect_same_bits(one, draw(7));
    }
}

// No metaballs, metaballs without density, and a cloud without extinction: all the bare background, bit for
// bit.
TEST_P(RendererTest, EmptyCloudGivesTheBareBackground) {
    for (const View& each : views()) {
        const Picture background = renderer_.draw({}, each.options);
        std::vector<Metaball> balls = reference::random_metaballs(4, 50);
        const Picture transparent = renderer_.draw({balls, 0.0, 1.0}, each.options);
        for (Metaball& ball : balls) ball.density = 0;
        const Picture empty = renderer_.draw({balls, 0.02, 1.0}, each.options);
        expect_same_bits(background.beauty, empty.beauty, each.name);
        expect_same_bits(background.beauty, transparent.beauty, each.name);
        for (const Picture* picture : {&background, &empty, &transparent}) {
            for (const float value : picture->transmittance) ASSERT_EQ(value, 1.0f) << each.name;
            for (const float value : picture->depth_m)
                ASSERT_EQ(value, std::numeric_limits<float>::infinity());
            for (const float value : picture->shadow) ASSERT_EQ(value, 1.0f) << each.name;
        }
        for (const float value : empty.light) ASSERT_EQ(value, 1.0f);
    }
}

float largest_difference(const std::vector<float>& a, const std::vector<float>& b) {
    EXPECT_EQ(a.size(), b.size());
    float largest = 0;
    for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
    return largest;
}

// Each way against the reference: the same picture within 1/255, from everywhere and at every thickness.
TEST_P(RendererTest, AgreesWithBillboards) {
    Renderer reference_renderer({{}, true, 2048, Splatting::billboards});
    float beauty = 0, transmittance = 0;
    for (const View& each : views()) {
        const double radius = smallest_radius_m(each.options.camera);
        const std::vector<Metaball> balls =
            reference::random_metaballs(7, 400, radius, std::max(200.0, 1.5 * radius));
        for (const double extinction : {0.0005, 0.01, 0.1}) {
            const MetaballCloud cloud{balls, extinction, 0.7};
            const Picture fast = renderer_.draw(cloud, each.options);
            const Picture slow = reference_renderer.draw(cloud, each.options);
            EXPECT_LE(largest_difference(fast.shadow, slow.shadow), 1e-4f) << each.name;
            EXPECT_LE(largest_difference(fast.light, slow.light), 1e-4f) << each.name;
            beauty = std::max(beauty, largest_difference(fast.beauty, slow.beauty));
            transmittance =
                std::max(transmittance, largest_difference(fast.transmittance, slow.transmittance));
            EXPECT_LE(beauty, 1.0f / 255.0f) << each.name << ", extinction " << extinction;
            EXPECT_LE(transmittance, 1.0f / 255.0f) << each.name << ", extinction " << extinction;
            for (std::size_t i = 0; i < fast.depth_m.size(); ++i) {
                if (slow.transmittance[i] > 0.99f || fast.transmittance[i] > 0.99f) continue;
                const float opacity = 1.0f - slow.transmittance[i];
                ASSERT_NEAR(fast.depth_m[i] / slow.depth_m[i], 1.0f, 0.005f / opacity) << each.name;
            }
        }
    }
    std::printf("against billboards: beauty %.5f, transmittance %.5f\n", double(beauty),
                double(transmittance));
    for (const std::string& message : reference_renderer.validation_messages()) ADD_FAILURE() << message;
}

struct NamedLight {
    std::string name;
    CloudLight light;
};

std::vector<NamedLight> every_light() {
    std::vector<NamedLight> all;
    for (const Phase kind : {Phase::isotropic, Phase::rayleigh, Phase::henyey_greenstein,
                             Phase::cornette_shanks, Phase::hg_draine}) {
        CloudLight light;
        light.phase = {kind, 0.8, 12};
        for (const MultipleScattering multiple :
             {MultipleScattering::diffusion, MultipleScattering::octaves}) {
            light.multiple = multiple;
            all.push_back(
                {"phase " + std::to_string(int(kind)) + ", multiple " + std::to_string(int(multiple)),
                 light});
        }
    }
    all.back().light.octaves = {8, 0.8, 0.3, 0.7};
    all.push_back({"absorbed", {}});
    all.back().light.lighting = Lighting::cfa;
    return all;
}

// Each way against the reference, for every phase function and kind of multiple scattering, before the sun
// and with the sun behind, and lit by lightning. Before the sun radiances are above 1: there the difference
// is relative, and the aureole of droplets is outside of the picture: there an opacity of 0.0005 shows.
TEST_P(RendererTest, AgreesWithBillboardsInEveryLight) {
    Renderer reference_renderer({{}, true, 2048, Splatting::billboards});
    const std::vector<Metaball> balls = reference::random_metaballs(9, 300);
    Splats splats;
    splats.metaballs = {balls, 0.01, 0.7};
    splats.flash = Flash{{300, 200, 1200}, {0.75, 0.8, 1.0}, 0.5};
    for (const auto& [name, light] : every_light()) {
        for (const double azimuth : {0.0, 160.0}) {
            RenderOptions options = view({0, -4000, 800}, {0, 0, 1000}, 40, 90, 60);
            options.sun.azimuth_deg = azimuth;
            options.sun.elevation_deg = 30;
            options.light = light;
            const Picture fast = renderer_.draw_splats(splats, options);
            const Picture slow = reference_renderer.draw_splats(splats, options);
            float worst = 0, brightest = 0;
            for (std::size_t i = 0; i < fast.beauty.size(); ++i) {
                const float scale = std::max(1.0f, slow.beauty[i]);
                worst = std::max(worst, std::abs(fast.beauty[i] - slow.beauty[i]) / scale);
                brightest = std::max(brightest, slow.beauty[i]);
            }
            EXPECT_LE(worst, 1.0f / 255.0f) << name << ", sun in " << azimuth;
            EXPECT_GT(brightest, 0.3f) << name;
        }
    }
    for (const std::string& message : reference_renderer.validation_messages()) ADD_FAILURE() << message;
}

// Octaves light what single scattering leaves dark, and no table is left over from another light.
TEST_P(RendererTest, OctavesBrightenThickClouds) {
    const std::vector<Metaball> balls = lattice_cloud(20, 50);
    const MetaballCloud cloud{balls, 0.1, kNormalisationTwoCells};
    RenderOptions options = view({0, -2000, 800}, {0, 0, 1000}, 50, 64, 48);
    options.light.multiple = MultipleScattering::octaves;
    options.light.ambient_base = options.light.ambient_top = {0, 0, 0};
    const auto total = [&](int octaves) {
        options.light.octaves.count = octaves;
        const Picture picture = renderer_.draw(cloud, options);
        double sum = 0;
        for (std::size_t i = 0; i < picture.pixels(); ++i)
            if (picture.transmittance[i] < 0.1f) sum += double(picture.beauty[3 * i]);
        return sum;
    };
    const double one = total(1), two = total(2), eight = total(8);
    EXPECT_GT(one, 0);
    EXPECT_GT(two, 1.1 * one);
    EXPECT_GT(eight, 1.1 * two);
    EXPECT_EQ(total(1), one);
}

// The background itself, against its formulas: sky gradient above, ground below, the horizon at the eye's
// height.
TEST_P(RendererTest, HorizonLiesAtTheHeightOfTheEye) {
    RenderOptions options = view({0, 0, 2}, {0, 1000, 2}, 40, 11, 400);
    options.air.extinction_per_m = {0, 0, 0};
    const Picture picture = renderer_.draw({}, options);
    const auto is_ground = [&](int row) {
        const float* pixel = &picture.beauty[3 * (std::size_t(row) * 11 + 5)];
        const double expected =
            options.ground.albedo[0] * 0.5 * (options.air.horizon[0] + options.air.zenith[0]) +
            options.ground.albedo[0] * options.sun.colour[0] *
                std::sin(options.sun.elevation_deg * std::numbers::pi / 180);
        return std::abs(double(pixel[0]) - expected) < 1e-5;
    };
    for (int row = 0; row < 200; ++row) ASSERT_FALSE(is_ground(row)) << row;
    for (int row = 200; row < 400; ++row) ASSERT_TRUE(is_ground(row)) << row;
    // Looking up, the sky's zenith is in the middle.
    RenderOptions up = view({0, 0, 2}, {0, 0, 1000}, 40, 33, 33);
    const Picture sky = renderer_.draw({}, up);
    for (std::size_t c = 0; c < 3; ++c)
        EXPECT_NEAR(double(sky.beauty[3 * (16 * 33 + 16) + c]), up.air.zenith[c], 1e-3);
    // With air, the ground takes on the horizon's colour, seamlessly.
    RenderOptions hazy = view({0, 0, 2}, {0, 1000, 2}, 0.1 * 50, 3, 401);
    hazy.air.extinction_per_m = {1e-2, 1e-2, 1e-2};
    const Picture haze = renderer_.draw({}, hazy);
    for (std::size_t c = 0; c < 3; ++c)
        EXPECT_NEAR(double(haze.beauty[3 * (202 * 3 + 1) + c]), hazy.air.horizon[c], 1e-2);
}

// Looking north, a metaball in the east is on the right, one above the axis in the upper half.
TEST_P(RendererTest, EastIsRightAndUpIsUp) {
    const auto centroid = [&](const std::vector<Metaball>& balls, const RenderOptions& options) {
        const Picture picture = renderer_.draw({balls, 0.05, 1.0}, options);
        double x = 0, y = 0, weight = 0;
        for (int row = 0; row < picture.height; ++row) {
            for (int column = 0; column < picture.width; ++column) {
                const double opacity =
                    1 - double(picture.transmittance[std::size_t(row * picture.width + column)]);
                x += opacity * (column + 0.5);
                y += opacity * (row + 0.5);
                weight += opacity;
            }
        }
        return Vec3{x / weight, y / weight, weight};
    };
    RenderOptions north = view({0, 0, 1000}, {0, 5000, 1000}, 90, 200, 100);
    const Vec3 east = centroid({{500, 1000, 1000, 50, 1}}, north);
    EXPECT_NEAR(east.x, 125, 0.5);  // tan = 1/2 of a half width of 2
    EXPECT_NEAR(east.y, 50, 0.5);
    const Vec3 high = centroid({{0, 1000, 1500, 50, 1}}, north);
    EXPECT_NEAR(high.x, 100, 0.5);
    EXPECT_NEAR(high.y, 25, 0.5);
    RenderOptions down = view({0, 0, 5000}, {0, 0, 0}, 90, 100, 100);
    const Vec3 north_east = centroid({{1000, 500, 3000, 50, 1}}, down);
    EXPECT_NEAR(north_east.x, 75, 0.5);
    EXPECT_NEAR(north_east.y, 37.5, 0.5);
}

// The shadow of a metaball lies on the ground where the sun's ray through its centre ends.
TEST_P(RendererTest, ShadowFallsAwayFromTheSun) {
    const std::vector<Metaball> ball{{300, -200, 1000, 150, 1}};
    RenderOptions options = view({0, 0, 6000}, {0, 0, 0}, 60, 121, 121);
    options.sun.elevation_deg = 45;
    options.sun.azimuth_deg = 90;  // in the east: the shadow moves 1000 m to the west
    const Picture with = renderer_.draw({ball, 0.05, 1.0}, options);
    const Picture without = renderer_.draw({}, options);
    double x = 0, y = 0, weight = 0;
    for (int row = 0; row < 121; ++row) {
        for (int column = 0; column < 121; ++column) {
            const std::size_t i = std::size_t(row * 121 + column);
            if (with.transmittance[i] < 1.0f) continue;
            const double darker = double(without.beauty[3 * i]) - double(with.beauty[3 * i]);
            ASSERT_GE(darker, -1e-6);
            x += darker * (column + 0.5);
            y += darker * (row + 0.5);
            weight += darker;
        }
    }
    const double pixels_per_m = 60.5 / (6000 * std::tan(30 * std::numbers::pi / 180));
    EXPECT_NEAR(x / weight, 60.5 - 700 * pixels_per_m, 0.5);
    EXPECT_NEAR(y / weight, 60.5 + 200 * pixels_per_m, 0.5);
}

TEST_P(RendererTest, DepthIsTheDistanceToTheCloud) {
    const RenderOptions options = view({0, 0, 1000}, {0, 3000, 1000}, 60, 33, 33);
    const std::vector<Metaball> near_and_far{{0, 1000, 1000, 100, 1}, {0, 2000, 1000, 100, 1}};
    const std::size_t middle = 16 * 33 + 16;
    // Opaque: the near one hides the far one. Thin: the mean of both.
    EXPECT_NEAR(renderer_.draw({near_and_far, 1.0, 1.0}, options).depth_m[middle], 1000, 1);
    EXPECT_NEAR(renderer_.draw({near_and_far, 1e-4, 1.0}, options).depth_m[middle], 1500, 10);
    EXPECT_EQ(renderer_.draw({near_and_far, 1.0, 1.0}, options).depth_m[0],
              std::numeric_limits<float>::infinity());
}

// A picture of many tiles is the picture of one.
TEST_P(RendererTest, TilesDoNotShow) {
    const std::vector<Metaball> balls = lattice_cloud(20, 50);
    const MetaballCloud cloud{balls, 0.02, kNormalisationTwoCells};
    const RenderOptions options = view({0, -1500, 800}, {0, 0, 1000}, 60, 150, 101);
    const Picture whole = renderer_.draw(cloud, options);
    Renderer tiled(validated(32));
    const Picture parts = tiled.draw(cloud, options);
    for (std::size_t i = 0; i < whole.beauty.size(); ++i)
        ASSERT_NEAR(whole.beauty[i], parts.beauty[i], 1e-4) << i;
    for (std::size_t i = 0; i < whole.pixels(); ++i)
        ASSERT_NEAR(whole.transmittance[i], parts.transmittance[i], 1e-4) << i;
    EXPECT_TRUE(tiled.validation_messages().empty());
}

// Flying into and through a cloud: the picture changes little between neighbouring frames, whatever metaballs
// the eye enters or leaves on the way.
TEST_P(RendererTest, FlyingThroughACloudDoesNotPop) {
    const std::vector<Metaball> balls = lattice_cloud(12, 50);
    const MetaballCloud cloud{balls, 0.01, kNormalisationTwoCells};
    Picture before;
    for (int step = 0; step < 60; ++step) {
        const double y = -270.0 + 1.0 * step;
        const Picture now = renderer_.draw(cloud, view({13, y, 1010}, {13, y + 100, 1015}, 60, 40, 30));
        if (step > 0) {
            for (std::size_t i = 0; i < now.pixels(); ++i)
                ASSERT_NEAR(now.transmittance[i], before.transmittance[i], 0.015) << step << ' ' << i;
            for (std::size_t i = 0; i < now.beauty.size(); ++i)
                ASSERT_NEAR(now.beauty[i], before.beauty[i], 0.015) << step << ' ' << i;
        }
        before = now;
    }
}

// White where the sun shines on it, grey-blue at its base, never black and never beyond the tone curve's
// reach.
TEST_P(RendererTest, ThickCloudIsWhiteAboveAndGreyBelow) {
    const std::vector<Metaball> balls = lattice_cloud(24, 50);
    const MetaballCloud cloud{balls, 0.02, kNormalisationTwoCells};
    const auto middle = [&](const RenderOptions& options) {
        const Picture picture = renderer_.draw(cloud, options);
        EXPECT_LT(picture.transmittance[12 * 25 + 12], 0.01f);
        const float* pixel = &picture.beauty[3 * (12 * 25 + 12)];
        return Vec3{pixel[0], pixel[1], pixel[2]};
    };
    RenderOptions above = view({0, -1500, 3500}, {0, 0, 1100}, 20, 25, 25);
    above.sun.azimuth_deg = 180;  // behind the camera
    const Vec3 top = middle(above);
    EXPECT_GT(top.x, 0.7);
    EXPECT_LT(top.x, 1.5);
    EXPECT_NEAR(top.z / top.x, 1.0, 0.2);
    const Vec3 base = middle(view({0, 0, 2}, {0, 0, 1000}, 20, 25, 25));
    EXPECT_GT(base.x, 0.15);
    EXPECT_LT(base.x, 0.5 * top.x);
    EXPECT_GT(base.z, base.x);
}

// The sun below the horizon: no direct light, a dark sky, but finite values everywhere.
TEST_P(RendererTest, NightIsDarkAndFinite) {
    const std::vector<Metaball> balls = lattice_cloud(12, 50);
    RenderOptions options = view({0, -1500, 800}, {0, 0, 1000});
    double brighter = std::numeric_limits<double>::infinity();
    for (const double elevation : {90.0, 5.0, 0.0, -6.0, -18.0}) {
        options.sun.elevation_deg = elevation;
        const Picture picture = renderer_.draw({balls, 0.02, kNormalisationTwoCells}, options);
        double sum = 0;
        for (const float value : picture.beauty) {
            ASSERT_TRUE(std::isfinite(value) && value >= 0);
            sum += double(value);
        }
        EXPECT_LT(sum, brighter) << elevation;
        brighter = sum;
    }
}

TEST_P(RendererTest, BadInputIsAnErrorAndTheRendererLivesOn) {
    const RenderOptions options = view({0, -4000, 800}, {0, 0, 1000});
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const auto fails = [&](const Metaball& ball) {
        const std::vector<Metaball> balls{ball};
        EXPECT_THROW(renderer_.draw({balls, 0.02, 1.0}, options), Error);
    };
    fails({0, 0, nan, 10, 1});
    fails({0, 0, 0, 0, 1});
    fails({0, 0, 0, -1, 1});
    fails({0, 0, 0, 10, nan});
    EXPECT_THROW(renderer_.draw({{}, -1.0, 1.0}, options), Error);
    RenderOptions wrong = options;
    wrong.camera.width = 0;
    EXPECT_THROW(renderer_.draw({}, wrong), Error);
    EXPECT_NO_THROW(renderer_.draw({}, options));
}

TEST_P(RendererTest, OnePixelAndExtremeShapes) {
    const std::vector<Metaball> balls = reference::random_metaballs(9, 20);
    for (const auto& [width, height] : {std::pair{1, 1}, {1, 300}, {5000, 1}}) {
        const Picture picture =
            renderer_.draw({balls, 0.02, 1.0}, view({0, -4000, 800}, {0, 0, 1000}, 50, width, height));
        EXPECT_EQ(picture.pixels(), std::size_t(width) * std::size_t(height));
        for (const float value : picture.beauty) ASSERT_TRUE(std::isfinite(value));
    }
}

std::string way_name(const ::testing::TestParamInfo<Splatting>& way) {
    const char* const names[] = {"automatic", "processor", "tiles", "billboards"};
    return names[std::size_t(way.param)];
}
INSTANTIATE_TEST_SUITE_P(Ways, RendererTest,
                         ::testing::Values(Splatting::processor, Splatting::tiles, Splatting::billboards),
                         way_name);

}  // namespace
}  // namespace nephos
