// SPDX-License-Identifier: Apache-2.0
// Shells of air: light shafts against ray-marched single scattering, and the three ways of drawing against
// each other.

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "core/error.h"
#include "render/renderer.h"
#include "tests/render/picture_checks.h"
#include "tests/render/reference_render.h"

namespace nephos {
namespace {

RenderOptions view(Vec3 from, Vec3 to, double fov = 60, int width = 60, int height = 45) {
    RenderOptions options = test::view(from, to, fov, width, height);
    options.air.extinction_per_m = {1e-4, 1.3e-4, 2e-4};
    options.sun.elevation_deg = 25;
    options.sun.azimuth_deg = 10;
    options.shells = {40, 100, 1};
    options.light_shafts.strength = 1;
    return options;
}

// From 900 to 1300 m.
std::vector<Metaball> broken_layer(unsigned seed, int count = 400) {
    return reference::broken_layer(seed, count, 1100);
}

std::vector<RenderOptions> views() {
    std::vector<RenderOptions> all;
    all.push_back(view({0, -2500, 100}, {0, 0, 900}));       // from below, towards the sun
    all.push_back(view({0, -2500, 100}, {0, -5000, 600}));   // away from it
    all.push_back(view({0, -4000, 1100}, {0, 0, 1000}));     // through the layer
    all.push_back(view({500, -3000, 2500}, {0, 0, 500}));    // from above
    all.push_back(view({0, 0, 1100}, {0, 1000, 1000}, 90));  // inside
    all.push_back(view({0, -2500, 300}, {0, 0, 500}, 70));
    all.back().shells = {32, 20, 1.12};
    all.back().sun.elevation_deg = 8;
    for (const std::size_t from : {0, 3}) {  // the same under the physical sky
        all.push_back(all[from]);
        all.back().atmosphere.model = AirModel::physical;
    }
    return all;
}

TEST(Shells, BackendsAgree) {
    Renderer reference(test::validated(Splatting::blended));
    Renderer tiles(test::validated(Splatting::vulkan)), processor(test::validated(Splatting::cpu));
    const std::vector<Metaball> balls = broken_layer(7);
    const MetaballCloud cloud{balls, 0.02, 0.7};
    float worst = 0;
    for (const RenderOptions& options : views()) {
        const Picture expected = reference.draw(cloud, options);
        for (Renderer* renderer : {&tiles, &processor}) {
            const Picture picture = renderer->draw(cloud, options);
            const float difference = test::largest_difference(picture.beauty, expected.beauty);
            EXPECT_LE(difference, 1.0f / 255.0f);
            EXPECT_LE(test::largest_difference(picture.transmittance, expected.transmittance), 1.0f / 255.0f);
            worst = std::max(worst, difference);
        }
    }
    std::printf("shells: largest difference between ways %.5f\n", double(worst));
    for (const Renderer* each : {&reference, &tiles, &processor}) test::expect_no_messages(*each);
}

// Under the physical sky, shade takes away light that the air has: neither more than all of it, nor none.
TEST(Shells, ShadeUnderThePhysicalSkyLeavesNoNegativeLight) {
    Renderer renderer(test::validated(Splatting::cpu));
    const std::vector<Metaball> balls = broken_layer(7);
    const MetaballCloud cloud{balls, 0.02, 0.7};
    for (const double elevation : {1.0, 8.0, 40.0, 90.0}) {
        RenderOptions options = view({0, -2500, 100}, {0, 0, 900});
        options.atmosphere.model = AirModel::physical;
        options.sun.elevation_deg = elevation;
        options.shells = {40, 1000, 1};
        const Picture with = renderer.draw(cloud, options);
        options.light_shafts.strength = 0;
        const Picture without = renderer.draw(cloud, options);
        double taken = 0;
        for (std::size_t i = 0; i < with.beauty.size(); ++i) {
            ASSERT_GE(with.beauty[i], 0.0f) << elevation;
            ASSERT_LE(with.beauty[i], without.beauty[i] * 1.0001f + 1e-5f) << elevation;
            taken += double(without.beauty[i] - with.beauty[i]) / double(with.beauty.size());
        }
        EXPECT_GT(taken, 2e-4) << elevation;
    }
}

// Tiles of the picture and batches do not show: the pattern in which shells are sampled is that of the
// picture.
TEST(Shells, PartsOfThePictureDoNotShow) {
    const std::vector<Metaball> balls = broken_layer(3);
    const MetaballCloud cloud{balls, 0.02, 0.7};
    const RenderOptions options = views()[0];
    for (const Splatting way : {Splatting::cpu, Splatting::vulkan, Splatting::blended}) {
        Renderer whole(test::validated(way)), parts(test::validated(way, 16));
        EXPECT_LE(
            test::largest_difference(whole.draw(cloud, options).beauty, parts.draw(cloud, options).beauty),
            2e-4f);
        test::expect_no_messages(parts);
    }
}

// What is known of a ray of a pixel: radiance that the shade of clouds takes away, marched in many steps.
class Marcher {
  public:
    Marcher(const MetaballCloud& cloud, const RenderOptions& options, const Picture& picture)
        : cloud_(cloud), options_(options), picture_(picture), to_sun_(reference::to_sun(options.sun)) {}

    // D's gamma from the shadow map, between the middles of texels; beyond it there is light.
    double map(const Vec3& p) const {
        const ShadowFrame& frame = picture_.shadow_frame;
        const auto along = [&](const Vec3& axis) {
            const double square = axis.x * axis.x + axis.y * axis.y + axis.z * axis.z;
            return (axis.x * (p.x - frame.origin_m.x) + axis.y * (p.y - frame.origin_m.y) +
                    axis.z * (p.z - frame.origin_m.z)) /
                       square * picture_.shadow_size -
                   0.5;
        };
        const double u = along(frame.u_axis_m), v = along(frame.v_axis_m);
        const int column = int(std::floor(u)), row = int(std::floor(v));
        const auto texel = [&](int x, int y) {
            const int size = picture_.shadow_size;
            if (x < 0 || y < 0 || x >= size || y >= size) return 1.0;
            return double(picture_.shadow[std::size_t(y) * std::size_t(size) + std::size_t(x)]);
        };
        const double a = u - column, b = v - row;
        return (1 - b) * ((1 - a) * texel(column, row) + a * texel(column + 1, row)) +
               b * ((1 - a) * texel(column, row + 1) + a * texel(column + 1, row + 1));
    }
    // The same as an integral towards the sun, which knows where the clouds begin and end.
    double integral(const Vec3& p) const { return reference::transmittance(cloud_, {p, to_sun_}); }

    // D's sum as an integral up to a distance: I_s (1 - gamma) beta ds, green.
    template <class Gamma>
    double shaded(const reference::Ray& ray, double end_m, int steps, Gamma&& gamma) const {
        const double extinction = options_.air.extinction_per_m[1], step = end_m / steps;
        double sum = 0;
        for (int i = 0; i < steps; ++i) {
            const double s = (i + 0.5) * step;
            const Vec3 p{ray.origin_m.x + s * ray.direction.x, ray.origin_m.y + s * ray.direction.y,
                         ray.origin_m.z + s * ray.direction.z};
            sum += (1 - gamma(p)) * std::exp(-extinction * s) * extinction * step;
        }
        return sum * source(ray.direction);
    }

    // The same through the cloud, whose own extinction also shades: T_cloud(s) I_s (1 - gamma) beta ds.
    double shaded_in_cloud(const reference::Ray& ray, double end_m, int steps) const {
        const double extinction = options_.air.extinction_per_m[1], step = end_m / steps;
        double sum = 0, depth = 0;
        for (int i = 0; i < steps; ++i) {
            const double s = (i + 0.5) * step;
            const Vec3 p{ray.origin_m.x + s * ray.direction.x, ray.origin_m.y + s * ray.direction.y,
                         ray.origin_m.z + s * ray.direction.z};
            double density = 0;
            for (const Metaball& ball : cloud_.metaballs)
                density +=
                    ball.density *
                    reference::field(std::hypot(p.x - ball.x, p.y - ball.y, p.z - ball.z) / ball.radius);
            const double own = cloud_.extinction_per_m * cloud_.normalisation * density * step;
            sum += std::exp(-depth - 0.5 * own) * (1 - integral(p)) * std::exp(-extinction * s) * extinction *
                   step;
            depth += own;
        }
        return sum * source(ray.direction);
    }

  private:
    // Radiance of air without end in direct sunlight: a share of horizon or sky, by the phase function.
    double source(const Vec3& ray) const {
        const double cosine = ray.x * to_sun_.x + ray.y * to_sun_.y + ray.z * to_sun_.z;
        const double g = options_.light_shafts.g, share = options_.light_shafts.sun_share;
        const double direct = share * 1.5 * (1 - g * g) / (2 + g * g) * (1 + cosine * cosine) /
                              std::pow(1 + g * g - 2 * g * cosine, 1.5);  // Cornette and Shanks
        double sky = options_.air.horizon[1];
        if (ray.z > 0) {
            const double haze = (std::exp(-4 * ray.z) - std::exp(-4.0)) / (1 - std::exp(-4.0));
            sky = options_.air.zenith[1] + haze * (options_.air.horizon[1] - options_.air.zenith[1]);
        }
        return direct / (direct + 1 - share) * std::min(sky, options_.air.horizon[1]);
    }

    const MetaballCloud& cloud_;
    const RenderOptions& options_;
    const Picture& picture_;
    Vec3 to_sun_{};
};

// Mean of the light that shafts take from a picture, and of its error; thin clouds, which hide nothing.
struct Shafts {
    double mean = 0, error = 0, worst = 0;
};

template <class Gamma>
Shafts compare(Renderer& renderer, const MetaballCloud& cloud, RenderOptions options, Gamma&& gamma_of) {
    const Picture with = renderer.draw(cloud, options);
    options.light_shafts.strength = 0;
    const Picture without = renderer.draw(cloud, options);
    const Marcher marcher(cloud, options, with);
    const auto gamma = gamma_of(marcher);
    Shafts shafts;
    // Single pixels differ by where their shells are sampled: blocks of 4 x 4.
    constexpr int kBlock = 4;
    int count = 0;
    for (int y = 0; y + kBlock <= with.height; y += kBlock) {
        for (int x = 0; x + kBlock <= with.width; x += kBlock, ++count) {
            double expected = 0, found = 0;
            for (int i = 0; i < kBlock * kBlock; ++i) {
                const int column = x + i % kBlock, row = y + i / kBlock;
                const std::size_t pixel = std::size_t(row * with.width + column);
                const reference::Ray ray = reference::pixel_ray(options, column, row);
                const double end = std::min(ray.end_m, reach_m(options.shells));
                expected += marcher.shaded(ray, end, 2000, gamma);
                found += double(without.beauty[3 * pixel + 1]) - double(with.beauty[3 * pixel + 1]);
            }
            shafts.mean += expected / (kBlock * kBlock);
            shafts.error += std::abs(found - expected) / (kBlock * kBlock);
            shafts.worst = std::max(shafts.worst, std::abs(found - expected) / (kBlock * kBlock));
        }
    }
    shafts.mean /= count;
    shafts.error /= count;
    return shafts;
}

// Under clouds so far above that no ray meets them: D's sum through the same shadow map.
TEST(Shells, ShaftsEqualMarchedSingleScatteringThroughTheSameMap) {
    Renderer renderer(test::validated(Splatting::cpu));
    std::vector<Metaball> balls = broken_layer(11, 700);
    for (Metaball& ball : balls) ball.z += 5000;
    const MetaballCloud cloud{balls, 0.02, 0.7};
    RenderOptions options = view({0, -1000, 100}, {0, 2000, 700}, 50, 64, 48);
    options.sun.elevation_deg = 88;
    const auto through_the_map = [](const Marcher& marcher) {
        return [&marcher](const Vec3& p) { return marcher.map(p); };
    };
    for (const Shells& shells : {Shells{40, 100, 1}, Shells{40, 30, 1.06}}) {
        options.shells = shells;
        const Shafts shafts = compare(renderer, cloud, options, through_the_map);
        std::printf("shafts: mean %.4f, mean error %.5f (%.2f %%), largest %.5f\n", shafts.mean, shafts.error,
                    100 * shafts.error / shafts.mean, shafts.worst);
        EXPECT_GT(shafts.mean, 0.003);
        EXPECT_LE(shafts.error, 0.03 * shafts.mean);
    }
}

// Rays through a thin cloud that shades air before, in and behind it: what is taken away behind a part of the
// cloud is hidden by it, and shade begins at the cloud's top. Against the integral with the cloud's own
// extinction, not the map.
TEST(Shells, ShaftsBetweenCloudsEqualMarchedSingleScattering) {
    Renderer renderer(test::validated(Splatting::cpu));
    std::vector<Metaball> balls;
    for (int i = 0; i < 48; ++i)
        balls.push_back(
            {float(300 * (i % 6) - 750), float(300 * (i / 6) - 1000), float(1000 + 37 * (i % 5)), 260, 1});
    const MetaballCloud cloud{balls, 0.004, 1};
    RenderOptions options = view({0, -3000, 600}, {0, 0, 900}, 40, 24, 16);
    options.sun.elevation_deg = 50;
    options.air.extinction_per_m = {3e-4, 3e-4, 3e-4};
    options.level_of_detail.pixels = 0;  // the integral has every ball for itself
    options.shells = {40, 125, 1};
    const Picture with = renderer.draw(cloud, options);
    RenderOptions bare = options;
    bare.light_shafts.strength = 0;
    const Picture without = renderer.draw(cloud, bare);
    const Marcher marcher(cloud, options, with);
    double expected_sum = 0, found_sum = 0, error_sum = 0;
    for (int y = 0; y < with.height; ++y) {
        for (int x = 0; x < with.width; ++x) {
            const std::size_t pixel = std::size_t(y * with.width + x);
            const reference::Ray ray = reference::pixel_ray(options, x, y);
            const double expected =
                marcher.shaded_in_cloud(ray, std::min(ray.end_m, reach_m(options.shells)), 400);
            const double found = double(without.beauty[3 * pixel + 1]) - double(with.beauty[3 * pixel + 1]);
            expected_sum += expected;
            found_sum += found;
            error_sum += std::abs(found - expected);
        }
    }
    const double pixels = double(with.pixels());
    std::printf("shafts between clouds: mean %.4f, found %.4f, mean error %.5f (%.1f %%)\n",
                expected_sum / pixels, found_sum / pixels, error_sum / pixels,
                100 * error_sum / expected_sum);
    EXPECT_GT(expected_sum / pixels, 0.01);
    EXPECT_NEAR(found_sum / expected_sum, 1, 0.03);
    EXPECT_LE(error_sum, 0.1 * expected_sum);
}

// Radiance of fog at the eye below clouds that let no light through: black, whatever the shadow map's texels,
// the metaballs' size, and what else there is above.
TEST(Shells, AirBelowClosedCloudsIsInFullShade) {
    Renderer renderer({{}, true, 2048, Splatting::cpu});
    const auto layer = [](double z, double spacing, double radius, float density) {
        std::vector<Metaball> balls;
        for (double y = -6000; y <= 6000; y += spacing)
            for (double x = -6000; x <= 6000; x += spacing)
                balls.push_back({float(x), float(y), float(z), float(radius), density});
        return balls;
    };
    const auto green = [&](const std::vector<Metaball>& balls, double elevation, int map) {
        RenderOptions options = view({0, 0, 1}, {0, 100, 1.5}, 5, 4, 4);
        options.light.ambient_base = options.light.ambient_top = {0, 0, 0};
        options.air.extinction_per_m = {0, 0, 0};
        options.sun.elevation_deg = elevation;
        options.shadow_map_size = map;
        options.fog = {0.1, 0, 1000, 0, 300, {}, 1};
        options.shells = {40, 10, 1.1};
        return double(renderer.draw(MetaballCloud{balls, 0.05, 1}, options).beauty[1]);
    };
    const double open = green({}, 60, 256);
    ASSERT_GT(open, 0.001);
    const std::vector<Metaball> low = layer(1500, 100, 200, 1);
    std::vector<Metaball> both = low;
    for (const Metaball& ball : layer(10'000, 400, 600, 0.004f)) both.push_back(ball);
    for (const int map : {64, 256, 1024, 4096}) {
        for (const double elevation : {60.0, 30.0}) {
            EXPECT_LT(green(low, elevation, map), 0.03 * open) << map << ' ' << elevation;
            EXPECT_LT(green(layer(1500, 800, 1200, 1), elevation, map), 0.03 * open)
                << map << ' ' << elevation;
        }
        EXPECT_LT(green(both, 60, map), 0.03 * open) << map;
    }
}

// Shaded air never has less than no light, and nothing changes where nothing is shaded.
TEST(Shells, ShaftsOnlyDarkenAndNeverBelowZero) {
    Renderer renderer(test::validated(Splatting::cpu));
    const std::vector<Metaball> balls = broken_layer(5, 2000);
    const MetaballCloud cloud{balls, 0.2, 0.7};
    for (RenderOptions options : views()) {
        options.air.extinction_per_m = {2e-3, 2e-3, 2e-3};
        options.light_shafts.sun_share = 1;
        RenderOptions bare = options;
        bare.light_shafts.strength = 0;
        const Picture with = renderer.draw(cloud, options), without = renderer.draw(cloud, bare);
        for (std::size_t i = 0; i < with.beauty.size(); ++i) {
            ASSERT_GE(with.beauty[i], -1e-5f) << i;
            ASSERT_LE(with.beauty[i], without.beauty[i] + 1e-5f) << i;
        }
        EXPECT_EQ(renderer.draw({}, options).beauty, renderer.draw({}, bare).beauty);
    }
}

TEST(Shells, OptionsOutOfRangeAreErrors) {
    const auto fails = [](auto&& change, const char* what) {
        RenderOptions options;
        change(options);
        try {
            check(options);
            ADD_FAILURE() << what;
        } catch (const Error& error) {
            EXPECT_NE(std::string(error.what()).find(what), std::string::npos) << error.what();
        }
    };
    fails([](RenderOptions& o) { o.shells.count = 0; }, "shells.count");
    fails([](RenderOptions& o) { o.shells.count = 129; }, "shells.count");
    fails([](RenderOptions& o) { o.shells.spacing_m = 0; }, "shells.spacing_m");
    fails([](RenderOptions& o) { o.shells.growth = 0.9; }, "shells.growth");
    fails([](RenderOptions& o) { o.shells = {128, 100, 1.5}; }, "1000 km");
    fails([](RenderOptions& o) { o.light_shafts.strength = 1.1; }, "light_shafts.strength");
    fails([](RenderOptions& o) { o.light_shafts.g = -1; }, "light_shafts.g");
    fails([](RenderOptions& o) { o.light_shafts.sun_share = 2; }, "light_shafts.sun_share");
}

}  // namespace
}  // namespace nephos
