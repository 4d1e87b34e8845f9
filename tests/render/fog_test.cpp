// SPDX-License-Identifier: Apache-2.0
// Fog in the shells of air: the three ways of drawing it, its optical depth against integrals, its light.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/noise.h"
#include "render/renderer.h"
#include "tests/render/picture_checks.h"
#include "tests/render/reference_render.h"

namespace nephos {
namespace {

RenderOptions view(const Vec3& from, const Vec3& to, double fov = 60, int width = 96, int height = 64) {
    RenderOptions options = test::view(from, to, fov, width, height);
    options.sun.elevation_deg = 25;
    options.sun.azimuth_deg = 10;
    options.shells = {40, 10, 1.12};
    options.fog.extinction_per_m = 0.004;
    options.fog.height_m = 120;
    options.fog.patch_m = 300;
    return options;
}

std::vector<Metaball> clouds(unsigned seed) { return reference::broken_layer(seed, 300, 900); }

std::vector<RenderOptions> views() {
    std::vector<RenderOptions> all;
    all.push_back(view({0, -2500, 40}, {0, 0, 300}));      // in the fog
    all.push_back(view({0, -2500, 900}, {0, 0, 300}));     // from above, among clouds
    all.push_back(view({0, 0, 5000}, {10, 0, 0}, 90));     // straight down
    all.push_back(view({0, -2500, 40}, {0, -2400, 400}));  // up through it
    all.push_back(all[0]);
    all.back().light_shafts.strength = 1;
    all.push_back(all[1]);
    all.back().atmosphere.model = AirModel::physical;
    all.back().light_shafts.strength = 1;
    all.back().sun.elevation_deg = 5;
    all.push_back(all[0]);
    all.back().fog.patchiness = 1;
    all.push_back(view({0, -2500, 400}, {0, -1500, 0}));  // a glory on the fog
    all.back().sun.azimuth_deg = 180;
    all.back().light.phase = {Phase::hg_draine, 0, 10};
    all.back().light.bows = 1;
    return all;
}

// Relative to white, or to what is brighter: near the sun the sky is.
float largest_difference_of_light(const std::vector<float>& a, const std::vector<float>& b) {
    float largest = 0;
    for (std::size_t i = 0; i < a.size(); ++i)
        largest = std::max(largest, std::abs(a[i] - b[i]) / std::max(1.0f, b[i]));
    return largest;
}

TEST(Fog, BackendsAgree) {
    Renderer reference(test::validated(Splatting::blended));
    Renderer tiles(test::validated(Splatting::vulkan)), processor(test::validated(Splatting::cpu));
    const std::vector<Metaball> some = clouds(3);
    float worst = 0;
    for (const RenderOptions& options : views()) {
        for (const std::span<const Metaball> balls : {std::span<const Metaball>(some), {}}) {
            const MetaballCloud cloud{balls, 0.02, 0.7};
            const Picture expected = reference.draw(cloud, options);
            for (Renderer* renderer : {&tiles, &processor}) {
                const Picture picture = renderer->draw(cloud, options);
                const float difference = largest_difference_of_light(picture.beauty, expected.beauty);
                // Fog before a low sun under the physical sky is up to 0.0054 apart: samplers have 8 bits between texels.
                EXPECT_LE(difference, options.atmosphere.model == AirModel::physical ? 1.5f / 255.0f : 1.0f / 255.0f);
                EXPECT_LE(test::largest_difference(picture.transmittance, expected.transmittance),
                          1.0f / 255.0f);
                worst = std::max(worst, difference);
                for (std::size_t i = 0; i < picture.depth_m.size(); ++i)
                    if (expected.transmittance[i] < 0.5f) {
                        ASSERT_NEAR(picture.depth_m[i], expected.depth_m[i], 0.02f * expected.depth_m[i])
                            << i;
                    }
            }
        }
    }
    std::printf("fog: largest difference between ways %.5f\n", double(worst));
    for (const Renderer* each : {&reference, &tiles, &processor}) test::expect_no_messages(*each);
}

TEST(Fog, PartsOfThePictureDoNotShow) {
    const std::vector<Metaball> balls = clouds(5);
    const MetaballCloud cloud{balls, 0.02, 0.7};
    for (const Splatting way : {Splatting::cpu, Splatting::vulkan}) {
        Renderer whole(test::validated(way)), parts(test::validated(way, 16));
        EXPECT_LE(test::largest_difference(whole.draw(cloud, views()[0]).beauty,
                                           parts.draw(cloud, views()[0]).beauty),
                  2e-4f);
    }
}

// Without patches: the integral of an exponential along each ray, near and far, also seen from far above,
// where exp(-height) is below the smallest number.
TEST(Fog, TransmittanceIsThatOfTheExponentialLayer) {
    Renderer renderer(test::validated(Splatting::cpu));
    for (RenderOptions options : {view({0, 0, 40}, {0, 1000, 60}), view({0, 0, 900}, {0, 1000, 60}),
                                  view({0, 0, 9000}, {0, 9000, 60})}) {
        options.fog = {0.004, 30, 60, 0, 300, {}, 1};
        const Picture picture = renderer.draw(MetaballCloud{}, options);
        double mean = 0;
        for (int y = 0; y < picture.height; ++y) {
            for (int x = 0; x < picture.width; ++x) {
                const reference::Ray ray = reference::pixel_ray(options, x, y);
                const double end = std::min(ray.end_m, 1e6), slope = ray.direction.z;
                const double low = std::exp(-(ray.origin_m.z - 30) / 60),
                             high = std::exp(-(ray.origin_m.z + slope * end - 30) / 60);
                const double column = std::abs(slope) < 1e-9 ? low * end : 60 * (low - high) / slope;
                const double expected = std::exp(-0.004 * column);
                const float found = picture.transmittance[std::size_t(y * picture.width + x)];
                ASSERT_NEAR(found, expected, 0.002) << x << ' ' << y;
                mean += expected / double(picture.pixels());
            }
        }
        EXPECT_GT(mean, 0.05);
        EXPECT_LT(mean, 0.95);
    }
}

// The same noise, looked up by itself and marched in small steps.
class Patches {
  public:
    explicit Patches(const Fog& fog)
        : fog_(fog),
          values_(noise_volume({.seed = 1, .voxels = kEdge, .cells = 4, .octaves = 3, .persistence = 0.5})) {}

    double factor(const Vec3& p, double time_s) const {
        const double per_m = 1 / (4 * fog_.patch_m);
        const auto at = [&](double share, double fine) {
            return Vec3{fine * per_m * (p.x - share * time_s * fog_.velocity_m_per_s.x),
                        fine * per_m * (p.y - share * time_s * fog_.velocity_m_per_s.y),
                        fine * per_m * (p.z - share * time_s * fog_.velocity_m_per_s.z)};
        };
        const Vec3 coarse = at(1, 1), other = at(0.8, 1.618), fine{other.y, other.z, other.x};
        const double n = 0.5 * (noise(coarse) + noise(fine));
        return std::max(0.0, 1 + 4 * fog_.patchiness * (n - 0.5));
    }

  private:
    static constexpr int kEdge = 32;
    double noise(const Vec3& p) const {
        const auto wrap = [](int i) { return std::size_t(((i % kEdge) + kEdge) % kEdge); };
        const double x = p.x * kEdge, y = p.y * kEdge, z = p.z * kEdge;
        const int i = int(std::floor(x)), j = int(std::floor(y)), k = int(std::floor(z));
        double sum = 0;
        for (int n = 0; n < 8; ++n) {
            const int a = n & 1, b = n >> 1 & 1, c = n >> 2;
            const double share =
                (a != 0 ? x - i : 1 - x + i) * (b != 0 ? y - j : 1 - y + j) * (c != 0 ? z - k : 1 - z + k);
            sum += share * double(values_[(wrap(k + c) * kEdge + wrap(j + b)) * kEdge + wrap(i + a)]);
        }
        return sum;
    }
    Fog fog_;
    std::vector<float> values_;
};

TEST(Fog, PatchesAreThoseOfTheNoise) {
    Renderer renderer(test::validated(Splatting::cpu));
    RenderOptions options = view({100, -300, 20}, {100, 1000, 0}, 40, 64, 48);
    options.fog.patchiness = 1;
    options.fog.patch_m = 400;
    options.fog.velocity_m_per_s = {3, -2, 0};
    options.shells = {100, 15, 1};
    Splats splats;
    splats.time_s = 100;
    const Picture picture = renderer.draw_splats(splats, options);
    const Patches patches(options.fog);
    double error = 0, contrast = 0;
    int count = 0;
    constexpr int kBlock = 4;  // pixels differ by where their shells are looked up
    for (int by = 24; by < 48; by += kBlock) {
        for (int bx = 0; bx < 64; bx += kBlock, ++count) {
            double expected = 0, even = 0, found = 0;
            for (int n = 0; n < kBlock * kBlock; ++n) {
                const int x = bx + n % kBlock, y = by + n / kBlock;
                const reference::Ray ray = reference::pixel_ray(options, x, y);
                const double end = std::min(ray.end_m, 1500.0);
                double depth = 0, mean = 0;
                constexpr double kStep = 2;
                for (double s = kStep / 2; s < end; s += kStep) {
                    const Vec3 p{ray.origin_m.x + s * ray.direction.x, ray.origin_m.y + s * ray.direction.y,
                                 ray.origin_m.z + s * ray.direction.z};
                    const double dense = 0.004 * std::exp(-p.z / 120) * kStep;
                    depth += dense * patches.factor(p, 100);
                    mean += dense;
                }
                expected += std::exp(-depth) / (kBlock * kBlock);
                even += std::exp(-mean) / (kBlock * kBlock);
                found += double(picture.transmittance[std::size_t(y * 64 + x)]) / (kBlock * kBlock);
            }
            error += std::abs(found - expected);
            contrast += std::abs(even - expected);
        }
    }
    std::printf("fog: mean error of patches %.4f, their contrast %.4f\n", error / count, contrast / count);
    EXPECT_GT(contrast / count, 0.03);
    EXPECT_LT(error, 0.15 * contrast);
}

// Fog that hides everything has the light of a cloud: not black, not brighter than white in the sun behind
// the eye; darker below a cloud, and dark at night.
TEST(Fog, IsLitAsCloudsAre) {
    Renderer renderer(test::validated(Splatting::cpu));
    RenderOptions options = view({0, 0, 1}, {0, -100, 1}, 20, 8, 8);
    options.fog = {0.05, 0, 50, 0, 300, {}, 1};
    const auto green = [&](std::span<const Metaball> balls) {
        const Picture picture = renderer.draw(MetaballCloud{balls, 0.05, 1}, options);
        EXPECT_LT(picture.transmittance[2 * 8 + 4], 0.01f);
        return double(picture.beauty[3 * (2 * 8 + 4) + 1]);
    };
    const double open = green({});
    EXPECT_GT(open, 0.25);
    EXPECT_LT(open, 1.1);
    const std::vector<Metaball> above{{0, 0, 800, 700, 1}};
    options.sun.elevation_deg = 90;
    const double noon = green({});
    EXPECT_LT(green(above), 0.8 * noon);
    options.sun.elevation_deg = -18;
    EXPECT_LT(green({}), 0.02);
}

// Fog beyond the shells has the light, the shadows of clouds and the distance of where it is, and not of
// where the last shell begins.
TEST(Fog, BeyondTheShellsIsLitWhereItIs) {
    Renderer renderer({{}, true, 2048, Splatting::cpu});
    const std::vector<Metaball> balls = clouds(3);
    for (const Vec3& eye : {Vec3{0, -3000, 9000}, Vec3{0, -9000, 600}}) {
        RenderOptions options = view(eye, {0, 0, 0}, 30);
        options.fog = {0.01, 0, 60, 0, 300, {}, 1};
        options.shells = {128, 0.01 * std::hypot(eye.x, eye.y, eye.z), 1};
        const Picture expected = renderer.draw(MetaballCloud{balls, 0.05, 0.7}, options);
        options.shells = {40, 10, 1.12};                   // end at 7.7 km
        if (eye.z < 1000) options.shells = {40, 10, 1.1};  // at 4.4 km
        const Picture picture = renderer.draw(MetaballCloud{balls, 0.05, 0.7}, options);
        double error = 0, contrast = 0, mean = 0, far = 0;
        for (const float value : expected.beauty) mean += double(value) / double(expected.beauty.size());
        for (std::size_t i = 0; i < picture.beauty.size(); ++i) {
            error += std::abs(double(picture.beauty[i]) - double(expected.beauty[i]));
            contrast += std::abs(double(expected.beauty[i]) - mean);
        }
        for (std::size_t i = 0; i < picture.depth_m.size(); ++i) {
            const double apart = std::abs(picture.depth_m[i] / expected.depth_m[i] - 1);
            if (std::isfinite(apart)) far += apart / double(picture.depth_m.size());
        }
        std::printf("fog beyond the shells: mean error %.4f, contrast %.4f, distance %.4f\n",
                    error / double(picture.beauty.size()), contrast / double(picture.beauty.size()), far);
        EXPECT_LT(error, 0.25 * contrast);  // one look instead of a hundred
        EXPECT_LT(far, 0.02);
    }
}

// In shells much thicker than one sees far, distances are those of the fog, alike for neighbours.
TEST(Fog, DistanceIsThatOfTheFogAndHasNoGrain) {
    for (const Splatting way : {Splatting::cpu, Splatting::vulkan, Splatting::blended}) {
        Renderer renderer({{}, true, 2048, way});
        RenderOptions options = view({0, 0, 5}, {0, -100, 15}, 20, 32, 32);
        options.fog = {0.1, 0, 1e5, 0, 300, {}, 1};
        options.shells = {40, 500, 1};
        const Picture picture = renderer.draw(MetaballCloud{}, options);
        for (const float depth : picture.depth_m) ASSERT_NEAR(depth, std::log(2.0) / 0.1, 0.5);
    }
}

TEST(Fog, LightningLightsIt) {
    Renderer reference({{}, true, 2048, Splatting::blended});
    Renderer tiles({{}, true, 2048, Splatting::vulkan}), processor({{}, true, 2048, Splatting::cpu});
    RenderOptions options = view({0, 0, 20}, {0, 1000, 60});
    options.sun.elevation_deg = -18;
    Splats splats;
    const Picture dark = processor.draw_splats(splats, options);
    splats.flash = Flash{{0, 800, 300}, {1, 1, 1}, 4};
    const Picture expected = reference.draw_splats(splats, options);
    for (Renderer* renderer : {&tiles, &processor}) {
        const Picture lit = renderer->draw_splats(splats, options);
        EXPECT_LE(test::largest_difference(lit.beauty, expected.beauty), 1.0f / 255.0f);
        double more = 0;
        for (std::size_t i = 0; i < lit.beauty.size(); ++i) {
            EXPECT_GE(lit.beauty[i], dark.beauty[i] - 1e-5f);
            more += double(lit.beauty[i] - dark.beauty[i]) / double(lit.beauty.size());
        }
        EXPECT_GT(more, 0.05);
    }
}

// A walk through fog, in steps of half a metre: nothing appears at once.
TEST(Fog, WalkingThroughItDoesNotPop) {
    Renderer renderer(test::validated(Splatting::cpu));
    const std::vector<Metaball> balls = clouds(9);
    const MetaballCloud cloud{balls, 0.02, 0.7};
    std::vector<float> before;
    for (int step = 0; step < 12; ++step) {
        RenderOptions options = view({0, -2500 + 0.5 * step, 30}, {0, 10'000, 300});
        options.fog.patchiness = 1;
        const std::vector<float> now = renderer.draw(cloud, options).beauty;
        if (!before.empty()) {
            EXPECT_LE(test::largest_difference(now, before), 4.0f / 255.0f) << step;
        }
        before = now;
    }
}

TEST(Fog, BadOptionsAreErrors) {
    Renderer renderer({{}, false, 2048, Splatting::cpu});
    for (auto change :
         {+[](Fog& fog) { fog.extinction_per_m = -1; }, +[](Fog& fog) { fog.height_m = 0; },
          +[](Fog& fog) { fog.patchiness = 2; }, +[](Fog& fog) { fog.patch_m = NAN; },
          +[](Fog& fog) { fog.velocity_m_per_s.y = INFINITY; },
          +[](Fog& fog) { fog.velocity_m_per_s.z = NAN; }, +[](Fog& fog) { fog.base_m = 1e9; }}) {
        RenderOptions options = views()[0];
        change(options.fog);
        EXPECT_THROW(renderer.draw(MetaballCloud{}, options), Error);
    }
}

}  // namespace
}  // namespace nephos
