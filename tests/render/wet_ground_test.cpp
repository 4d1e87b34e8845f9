// SPDX-License-Identifier: Apache-2.0

// Wet and snowy ground in pictures: the formulas of its light, reflections of a sky that is known, and the
// three ways of drawing against each other.

#include "render/ground/wet_ground.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/vec.h"
#include "render/renderer.h"
#include "tests/reference/with_threads.h"
#include "tests/render/shared_renderers.h"

namespace nephos {
namespace {

// The same everywhere.
GroundCoverView everywhere(double water_mm, double snow_mm, double rain_mm_per_h = 0) {
    GroundCoverView cover;
    cover.outside.water_mm = water_mm;
    cover.outside.snow_mm = snow_mm;
    cover.outside_rain_mm_per_h = rain_mm_per_h;
    return cover;
}

constexpr double kFlood_mm = 100;  // with puddle_film_mm = 0.01 all is under water

RenderOptions small_options() {
    RenderOptions options;
    options.camera = {{0, 0, 20}, {0, 100, 12}, 60, 96, 72, 0};
    options.air.extinction_per_m = {0, 0, 0};
    options.shadow_map_size = 64;
    options.wet_ground.puddle_film_mm = 0.01;
    return options;
}

Picture draw(const RenderOptions& options, const std::optional<GroundCoverView>& cover,
             const MetaballCloud& cloud = {}, Splatting way = Splatting::cpu,
             std::optional<Flash> flash = {}) {
    Splats splats;
    splats.metaballs = cloud;
    splats.ground_cover = cover;
    splats.time_s = 12.34;
    splats.flash = flash;
    return test::renderer(way).draw_splats(splats, options);
}

Rgb pixel(const Picture& picture, int x, int y) {
    const float* at = &picture.beauty[3 * std::size_t(y * picture.width + x)];
    return {at[0], at[1], at[2]};
}

TEST(WaterTest, ReflectsTwoPercentFromAboveAndAllAtGrazingAngles) {
    EXPECT_NEAR(water_reflectance(1, 0), std::pow(0.333 / 2.333, 2), 1e-4);
    EXPECT_NEAR(water_reflectance(0, 0), 1, 1e-6);
    // Exact equations of Fresnel.
    for (const double cosine : {0.05, 0.2, 0.4, 0.6, 0.8, 1.0}) {
        const double inner = std::sqrt(1 - (1 - cosine * cosine) / (1.333 * 1.333));
        const double s = (cosine - 1.333 * inner) / (cosine + 1.333 * inner),
                     p = (1.333 * cosine - inner) / (1.333 * cosine + inner);
        EXPECT_NEAR(water_reflectance(cosine, 0), (s * s + p * p) / 2, 0.05) << cosine;
    }
    EXPECT_LT(water_reflectance(0, 0.04), 0.6) << "waves hide the far sides of each other";
}

TEST(WaterTest, DarkensTheGroundAndKeepsItsBounds) {
    EXPECT_EQ(soaked_albedo(0), 0);
    EXPECT_NEAR(soaked_albedo(1), 1, 1e-12);
    for (double albedo = 0.05; albedo < 1; albedo += 0.05) {
        EXPECT_LT(soaked_albedo(albedo), albedo);
        EXPECT_GT(soaked_albedo(albedo), 0.4 * albedo);
    }
    EXPECT_NEAR(soaked_albedo(0.15) / 0.15, 0.56, 0.02) << "about half, as wet sand";
}

TEST(WetGroundTest, DryGroundStaysAsItIs) {
    const RenderOptions options = small_options();
    const Picture plain = draw(options, {}), dry = draw(options, everywhere(0, 0, 30));
    EXPECT_EQ(plain.beauty, dry.beauty);
    RenderOptions above = options;
    above.camera.target_m = {0, 100, 200};
    EXPECT_EQ(draw(above, {}).beauty, draw(above, everywhere(3, 5)).beauty) << "no ground in view";
}

// The first drops of a shower wet the ground and leave no puddles, also next to the eye, where the noise of
// the hollows is resolved and sharp.
TEST(WetGroundTest, TheFirstDropsMakeNoPuddles) {
    RenderOptions options = small_options();
    options.camera.position_m = {0, 0, 3};
    options.camera.target_m = {0, 12, 0};
    options.wet_ground.puddle_film_mm = 2;
    const Picture dry = draw(options, {});
    for (const double film_mm : {1e-12, 1e-6, 1e-4}) {
        const Picture wet = draw(options, everywhere(film_mm, 0));
        for (std::size_t i = 0; i < dry.beauty.size(); ++i)
            ASSERT_NEAR(wet.beauty[i], dry.beauty[i], 1e-3) << film_mm << ' ' << i;
    }
}

// Still water under a sky of one colour: Fresnel's share of the sky and what comes out of the water.
TEST(WetGroundTest, WaterReflectsASkyThatIsKnown) {
    RenderOptions options = small_options();
    options.air.horizon = options.air.zenith = {0.4, 0.6, 0.9};
    const Picture dry = draw(options, {}), wet = draw(options, everywhere(kFlood_mm, 0));
    const CameraFrame frame = camera_frame(options.camera);
    int seen = 0;
    for (int y = 40; y < 72; y += 3) {
        for (int x = 0; x < 96; x += 7) {
            const Vec3 ray = pixel_ray(frame, options.camera, x + 0.5, y + 0.5);
            if (ray.z > -0.02) continue;
            const double share = water_reflectance(-ray.z, 0);
            for (std::size_t c = 0; c < 3; ++c) {
                const double albedo = options.ground.albedo[c];
                const double expected = share * options.air.horizon[c] +
                                        (1 - share) * soaked_albedo(albedo) / albedo * pixel(dry, x, y)[c];
                ASSERT_NEAR(pixel(wet, x, y)[c], expected, 2e-3) << x << ' ' << y << ' ' << c;
            }
            ++seen;
        }
    }
    EXPECT_GT(seen, 100);
}

std::vector<Metaball> ball(const Vec3& centre, double radius) {
    return {{float(centre.x), float(centre.y), float(centre.z), float(radius), 1.0f}};
}

// The mirror image of a cloud stands as far below the horizon as the cloud above it, also for an eye high up.
TEST(WetGroundTest, CloudsStandInTheWaterUpsideDown) {
    for (const double eye_m : {2.0, 300.0}) {
        RenderOptions options = small_options();
        options.ground.albedo = {0, 0, 0};
        options.camera.position_m = {0, 0, eye_m};
        options.camera.target_m = {0, 1000, eye_m};
        options.air.horizon = options.air.zenith = {0, 0, 0};
        options.wet_ground.reflection_scale = 1;
        const Vec3 centre{150, 2000, 700};
        const std::vector<Metaball> balls = ball(centre, 150);
        const Picture wet = draw(options, everywhere(kFlood_mm, 0), {balls, 0.1, 1});
        const CameraFrame frame = camera_frame(options.camera);
        const PixelPosition image = project(frame, options.camera, {centre.x, centre.y, -centre.z});
        double weight = 0, x_sum = 0, y_sum = 0;
        for (int y = 37; y < 72; ++y) {
            for (int x = 0; x < 96; ++x) {
                const double light = pixel(wet, x, y)[1];
                weight += light;
                x_sum += light * (x + 0.5);
                y_sum += light * (y + 0.5);
            }
        }
        ASSERT_GT(weight, 0.1) << "no image";
        EXPECT_NEAR(x_sum / weight, image.x, 1.0) << eye_m;
        EXPECT_NEAR(y_sum / weight, image.y, 1.5) << eye_m;
    }
}

// Looking down on snow that is lit and shaded: brighter by the ratio of the albedos, in the shadow too.
TEST(WetGroundTest, SnowIsWhiteAndWearsTheShadow) {
    RenderOptions options = small_options();
    options.camera.position_m = {0, 0, 2500};
    options.camera.target_m = {0, 1, 0};
    options.wet_ground.snow_cover_mm = 0.01;
    const std::vector<Metaball> balls = ball({-200, -400, 1000}, 220);
    const MetaballCloud cloud{balls, 0.05, 1};
    const Picture dry = draw(options, {}, cloud), white = draw(options, everywhere(0, 500), cloud);
    double darkest = 1, brightest = 0;
    for (std::size_t i = 0; i < dry.pixels(); ++i) {
        if (dry.transmittance[i] < 0.999f) continue;
        const double ratio = white.beauty[3 * i + 1] / dry.beauty[3 * i + 1];
        ASSERT_NEAR(ratio, options.wet_ground.snow_albedo[1] / options.ground.albedo[1], 0.3) << i;
        darkest = std::min(darkest, double(white.beauty[3 * i + 1]));
        brightest = std::max(brightest, double(white.beauty[3 * i + 1]));
    }
    EXPECT_LT(darkest, 0.75 * brightest) << "no shadow, nothing proved";
    EXPECT_LT(brightest, 1.2);
}

// The albedo below falling snow is that of looking down on it from far above, where no tuft is resolved.
TEST(WetGroundTest, MeanAlbedoIsThatFromAbove) {
    RenderOptions options = small_options();
    options.camera.position_m = {0, 0, 30'000};
    options.camera.target_m = {0, 1, 0};
    options.atmosphere.model = AirModel::gradient;
    options.air.extinction_per_m = {};
    const GroundCoverView none;
    EXPECT_EQ(mean_albedo(options, none), options.ground.albedo);
    const Picture dry = draw(options, {}, {});
    for (const float snow_mm : {0.5f, 2.0f, 6.0f}) {
        const GroundCoverView cover = everywhere(0, snow_mm);
        const Picture white = draw(options, cover, {});
        const std::size_t middle = 3 * (dry.pixels() / 2) + 1;
        EXPECT_NEAR(white.beauty[middle] / dry.beauty[middle], mean_albedo(options, cover)[1] / options.ground.albedo[1], 0.1)
            << snow_mm;
    }
}

// More light than falls on it leaves no ground: in a white furnace every surface is at most as bright.
TEST(WetGroundTest, NeverReflectsMoreThanArrives) {
    RenderOptions options = small_options();
    options.air.horizon = options.air.zenith = {1, 1, 1};
    options.sun.colour = {0, 0, 0};
    options.wet_ground.puddle_film_mm = 2;
    options.wet_ground.sheen = 1;
    for (const GroundCoverView& cover :
         {everywhere(0.3, 0, 0), everywhere(2, 1, 40), everywhere(20, 30, 5)}) {
        for (const Rgb& albedo : {Rgb{0, 0, 0}, Rgb{0.2, 0.5, 1}}) {
            options.ground.albedo = albedo;
            for (const float value : draw(options, cover).beauty) {
                ASSERT_LE(value, 1.03);
                ASSERT_GE(value, 0);
            }
        }
    }
}

// A small map in the middle of the picture: no step at its edge.
TEST(WetGroundTest, TheMapFadesOutAtItsEdge) {
    RenderOptions options = small_options();
    options.camera.position_m = {0, 0, 4000};
    options.camera.target_m = {0, 1, 0};
    options.wet_ground.snow_cover_mm = 2;
    const std::vector<float> none(64, 0.0f), snow(64, 4.0f);
    const GroundCoverView cover{
        {.x_m = -2000, .y_m = -2000, .texel_x_m = 500, .texel_y_m = 500, .columns = 8, .rows = 8},
        none,
        snow,
        none};
    const Picture picture = draw(options, cover);
    const Rgb middle = pixel(picture, 48, 36), corner = pixel(picture, 1, 1);
    EXPECT_GT(middle[1], 4 * corner[1]);
    double steepest = 0;
    for (int x = 1; x < 96; ++x)
        steepest = std::max(steepest, std::abs(pixel(picture, x, 36)[1] - pixel(picture, x - 1, 36)[1]));
    EXPECT_LT(steepest, 0.6 * (middle[1] - corner[1]));
}

std::vector<Metaball> cumulus() {
    std::vector<Metaball> balls;
    for (int i = 0; i < 60; ++i) {
        balls.push_back({float(400 * std::sin(2.4 * i)), float(1500 + 300 * std::cos(1.7 * i)),
                         float(500 + 4 * i), 120, 0.6f});
    }
    return balls;
}

TEST(WetGroundTest, BackendsAgree) {
    RenderOptions options = small_options();
    options.air = {};
    options.wet_ground.puddle_film_mm = 2;
    const std::vector<Metaball> balls = cumulus();
    const MetaballCloud cloud{balls, 0.02, 1};
    const Flash flash{{300, 1200, 700}, {0.8, 0.8, 1}, 0.15};
    const GroundCoverView cover = everywhere(1.8, 0.8, 15);
    const Picture reference = draw(options, cover, cloud, Splatting::cpu, flash);
    for (const Splatting way : {Splatting::vulkan, Splatting::blended}) {
        const Picture other = draw(options, cover, cloud, way, flash);
        for (std::size_t i = 0; i < reference.beauty.size(); ++i)
            ASSERT_NEAR(reference.beauty[i], other.beauty[i], 1.0 / 255) << i;
    }
}

TEST(WetGroundTest, ThreadsChangeNothing) {
    const RenderOptions options = small_options();
    const GroundCoverView cover = everywhere(0.02, 1.5, 20);
    const Picture one = test::with_threads(1, [&] { return draw(options, cover); });
    for (const std::size_t threads : {2u, 5u})
        EXPECT_EQ(test::with_threads(threads, [&] { return draw(options, cover); }).beauty, one.beauty);
}

TEST(WetGroundTest, RefusesBadMapsAndOptions) {
    const RenderOptions options = small_options();
    EXPECT_THROW(draw(options, everywhere(-1, 0)), Error);
    EXPECT_THROW(draw(options, everywhere(0, std::nan(""))), Error);
    GroundCoverView cover = everywhere(1, 0);
    cover.columns = cover.rows = 3;
    EXPECT_THROW(draw(options, cover), Error) << "no values";
    const auto refused = [&](auto change) {
        RenderOptions bad = options;
        change(bad.wet_ground);
        EXPECT_THROW(check(bad), Error);
    };
    refused([](WetGroundOptions& o) { o.puddle_film_mm = 0; });
    refused([](WetGroundOptions& o) { o.reflection = 1.5; });
    refused([](WetGroundOptions& o) { o.reflection_scale = 0; });
    refused([](WetGroundOptions& o) { o.ripples = -1; });
    refused([](WetGroundOptions& o) { o.snow_albedo[2] = 1.1; });
    refused([](WetGroundOptions& o) { o.sheen = std::nan(""); });
}

}  // namespace
}  // namespace nephos
