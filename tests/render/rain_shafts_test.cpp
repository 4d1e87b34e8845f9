// SPDX-License-Identifier: Apache-2.0
// Rain seen from afar: what it lets through, and the picture against a twin that goes ray by ray.

#include "render/rain/rain_shafts.h"

#include <cmath>
#include <memory>
#include <random>

#include <gtest/gtest.h>

#include "tests/reference/with_threads.h"
#include "tests/render/picture_checks.h"
#include "tests/render/rain_scene.h"
#include "tests/render/reference_shafts.h"

namespace nephos {
namespace {

RainCurtain area() {
    RainCurtain c = test::rain_area();
    c.id = 7;
    return c;
}

RenderOptions options_at(const Vec3& eye, const Vec3& target) {
    return test::rain_view(eye, target, 77, 30, 0);
}

// A picture with clouds at all distances before and behind the rain, and their shadow.
Picture cloudy(const Camera& camera, std::mt19937& random) {
    Picture picture = test::grey(camera, 0.2f);
    std::uniform_real_distribution<float> share(0.0f, 1.0f);
    for (std::size_t i = 0; i < picture.pixels(); ++i) {
        if (share(random) < 0.3f) continue;
        picture.transmittance[i] = share(random);
        picture.depth_m[i] = 3000 * share(random);
        for (std::size_t c = 0; c < 3; ++c) picture.beauty[3 * i + c] = share(random);
    }
    picture.shadow_size = 16;
    picture.shadow_frame = {{-2000, -2000, 0}, {4000, 300, 0}, {-300, 4000, 200}, {0, 0, -1}};
    for (int i = 0; i < 16 * 16; ++i) picture.shadow.push_back(share(random));
    GroundLight& ground = picture.ground_light;
    ground.corner_m = {-2100, -1900};
    ground.texel_m = {45, 50};
    for (int i = 0; i < GroundLight::kTexels * GroundLight::kTexels; ++i)
        ground.words.push_back(std::uint32_t(random()));
    return picture;
}

struct Drawn {
    Picture picture;
    int apart = 0;  // pixels that differ from the twin's by more than a step of eight bits
};

Drawn draw(Picture picture, const RenderOptions& options, const std::vector<RainCurtain>& curtains,
           double time_s) {
    const CameraFrame camera = camera_frame(options.camera);
    const PrecipitationLight light = precipitation_light(picture, options, time_s);
    Drawn drawn{picture, 0};
    draw_shafts(drawn.picture, options, camera, curtains, light, time_s, 5);
    const reference::Shafts twin{
        picture, options, camera,         curtains,
        light,   time_s,  shaft_noise(5), reference::whole_per_m(options.precipitation, curtains)};
    for (int y = 0; y < picture.height; ++y) {
        for (int x = 0; x < picture.width; ++x) {
            const Rgb expected = reference::pixel_with_shafts(twin, x, y);
            const float* pixel = &drawn.picture.beauty[3 * std::size_t(y * picture.width + x)];
            double most = 0;
            for (std::size_t c = 0; c < 3; ++c)
                most = std::max(most, std::abs(double(pixel[c]) - expected[c]) / std::max(1.0, expected[c]));
            if (!(most < 1.0 / 255)) ++drawn.apart;
        }
    }
    return drawn;
}

// A shaft lets through what Beer and Lambert say: through its middle, with neither edge nor texture.
TEST(RainShafts, HaveTheirOpticalDepth) {
    RainCurtain curtain = area();
    curtain.x_m = 0;
    curtain.axis_x = 1;
    curtain.axis_y = 0;
    RenderOptions options = options_at({0, -3000, 300}, {0, 0, 300});
    PrecipitationOptions& p = options.precipitation;
    p.edge = 0;
    p.shaft_texture = 0;
    options.air.extinction_per_m = {0, 0, 0};
    Picture dark = test::grey(options.camera, 0.0f), bright = test::grey(options.camera, 0.5f);
    // The same light of the surroundings in both: only what is behind differs.
    const CameraFrame camera = camera_frame(options.camera);
    const PrecipitationLight light = precipitation_light(dark, options, 0);
    draw_shafts(dark, options, camera, {&curtain, 1}, light, 0, 1);
    draw_shafts(bright, options, camera, {&curtain, 1}, light, 0, 1);
    const std::size_t middle = 3 * (15 * 77 + 38);
    const double expected = std::exp(-rain_extinction_per_m(PrecipitationKind::rain, 20) * 800);
    EXPECT_NEAR(double(bright.beauty[middle] - dark.beauty[middle]) / 0.5, expected, 0.01);
    // Beside it nothing changes.
    EXPECT_EQ(bright.beauty[3 * 15 * 77], 0.5f);
    // Virga: none is left below.
    EXPECT_EQ(left_of_rain(0.2, 0), 1);
    EXPECT_EQ(left_of_rain(0.2, 0.3), 0);
    EXPECT_NEAR(left_of_rain(1, 0.3), 1, 1e-12);
}

// The profile through which the sun shines has half of the optical depth of the rain itself, without texture: on the mean of places all
// over a leaning curtain, for each softness and height of the sun. The rain fades in at its top, which the profile leaves out.
TEST(RainShafts, ShadeThemselvesAsMuchAsTheirRain) {
    RainCurtain curtain = area();
    curtain.lean_x = 0.3;
    RenderOptions options = options_at({-400, -900, 20}, {100, 900, 300});
    options.precipitation.shaft_texture = 0;
    const Picture picture = test::grey(options.camera, 0.2f);
    for (const double edge : {0.0, 0.6, 0.8, 1.0}) {
        for (const double elevation_deg : {3.0, 20.0, 50.0}) {
            options.precipitation.edge = edge;
            options.sun.elevation_deg = elevation_deg;
            const PrecipitationLight light = precipitation_light(picture, options, 0);
            const reference::Shafts twin{picture, options, camera_frame(options.camera), {&curtain, 1}, light, 0,
                                         shaft_noise(5), reference::whole_per_m(options.precipitation, {&curtain, 1})};
            double rain = 0, shade = 0;
            for (const double u : {-0.9, -0.5, 0.0, 0.4, 0.8}) {
                for (const double height_m : {10.0, 200.0, 400.0}) {
                    const Ellipse at = ellipse_at(curtain, height_m);
                    const Vec3 place{at.x_m + u * at.semi_a_m * at.axis_x, at.y_m + u * at.semi_a_m * at.axis_y, height_m};
                    shade += reference::depth_to_sun(twin, curtain, twin.whole_per_m[0], place);
                    constexpr int kSteps = 2000;
                    const double step_m = (curtain.base_m - height_m) / light.to_sun.z / kSteps;
                    for (int n = 0; n < kSteps; ++n)
                        rain += 0.5 * step_m * reference::extinction(twin, curtain, twin.whole_per_m[0],
                                                               place + (n + 0.5) * step_m * light.to_sun);
                }
            }
            EXPECT_NEAR(shade / rain, 1, elevation_deg < 45 ? 0.15 : 0.25) << edge << ", " << elevation_deg;
        }
    }
}

// A face of heavy rain that is in the sun is bright, one that the rain itself shades is dark; thin rain is as bright on both
// sides, but for its phase function.
TEST(RainShafts, AreDarkerFarFromTheSun) {
    RainCurtain curtain = area();
    curtain.rate_mm_per_h = 60;
    RenderOptions options = options_at({100, -3000, 300}, {100, 900, 300});
    options.precipitation.shaft_texture = 0;
    options.camera.vertical_fov_deg = 20;
    options.sun.elevation_deg = 10;
    options.air.extinction_per_m = {0, 0, 0};
    const CameraFrame camera = camera_frame(options.camera);
    const auto middle = [&](double sun_azimuth_deg, double rate_mm_per_h) {
        options.sun.azimuth_deg = sun_azimuth_deg;
        curtain.rate_mm_per_h = rate_mm_per_h;
        Picture picture = test::grey(options.camera, 0.0f);
        PrecipitationLight light = precipitation_light(picture, options, 0);
        light.by_sky = light.by_scattered_sun = light.by_sunlit_ground = {};
        light.kind = PrecipitationKind::snow;  // without bows
        draw_shafts(picture, options, camera, {&curtain, 1}, light, 0, 5);
        return double(picture.beauty[3 * (15 * 77 + 38)]);
    };
    const double behind_thin = middle(0, 2), behind = middle(0, 200), before_thin = middle(180, 2), before = middle(180, 200);
    EXPECT_GT(before / before_thin, 2 * behind / behind_thin);
}

// Three curtains, two of which overlap and the third behind them, all leaning in their own ways; from
// outside, from within, from above, steeply and level, with all that light them.
TEST(RainShafts, AreThoseOfTheTwin) {
    std::vector<RainCurtain> curtains(3, area());
    curtains[0].lean_x = 0.3;
    curtains[0].lean_y = -0.2;
    curtains[1].id = 62;
    curtains[1].x_m = 600;
    curtains[1].semi_b_m = 650;
    curtains[1].lean_x = -0.5;
    curtains[1].rate_mm_per_h = 60;
    curtains[2].id = 4711;
    curtains[2].x_m = -500;
    curtains[2].y_m = 4200;
    curtains[2].semi_a_m = 2500;
    curtains[2].ground_m = 100;
    curtains[2].base_m = 1500;
    std::mt19937 random(2026);
    const Vec3 eyes[] = {{-400, -900, 20}, {150, 850, 200}, {300, 300, 2600}, {-12000, -30000, 500}};
    const Vec3 targets[] = {{100, 900, 300}, {150, 1850, 200}, {150, 800, 0}, {100, 900, 400}};
    for (std::size_t n = 0; n < std::size(eyes); ++n) {
        RenderOptions options = options_at(eyes[n], targets[n]);
        options.lightning = {{{600, 700, 500}, 100, 1, {0.8, 0.8, 1}, 3}};
        options.sun.elevation_deg = 15;
        if (n == 3) options.camera.vertical_fov_deg = 5;
        if (n == 1) options.precipitation.particles = 1000;
        options.precipitation.evaporation = n == 2 ? 0.3 : 0;
        options.precipitation.kind = n == 0 ? PrecipitationKind::snow : PrecipitationKind::rain;
        const Picture picture = cloudy(options.camera, random);
        for (const double time_s : {100.1, 1234.5}) {
            const Drawn drawn = draw(picture, options, curtains, time_s);
            EXPECT_EQ(drawn.apart, 0) << "eye " << n << " at " << time_s;
            EXPECT_NE(drawn.picture.beauty, picture.beauty);
        }
        // A wall of rain: a step on the other side of it is another picture.
        options.precipitation.edge = 0;
        EXPECT_LT(draw(picture, options, curtains, 0).apart, 20) << n;
    }
}

// A cloud over the whole of the areas, with holes and a base that rises from 500 to 1100 m.
std::shared_ptr<const CloudBases> uneven_cloud(bool repeats) {
    CloudBases cloud{-2000, -1000, 150, 40, 36, {}, {}, repeats, repeats};
    for (int j = 0; j < cloud.rows; ++j) {
        for (int i = 0; i < cloud.columns; ++i) {
            const float water = (i / 5 + j / 4) % 3 == 0 ? 0.0f : 0.25f * float(1 + (i + 2 * j) % 4);
            cloud.water.push_back(water);
            cloud.water_base_m.push_back(water * (500 + 15 * float(i)));
        }
    }
    return std::make_shared<CloudBases>(cloud);
}

// In the middle of a cloud and across the seams of one that repeats, with rain that evaporates on its way.
TEST(RainShafts, FallFromTheCloudAsThoseOfTheTwin) {
    for (const bool repeats : {false, true}) {
        std::vector<RainCurtain> curtains(2, area());
        curtains[0].lean_x = 0.3;
        curtains[0].lean_y = -0.2;
        curtains[1].id = 62;
        curtains[1].x_m = 600;
        curtains[1].semi_b_m = 650;
        for (RainCurtain& curtain : curtains) {
            curtain.base_m = 1100;
            curtain.cloud = uneven_cloud(repeats);
            if (repeats) curtain.x_m += 3900;
        }
        std::mt19937 random(17);
        const Vec3 eyes[] = {{-400, -1900, 20}, {300, 300, 2600}, {-9000, -4000, 500}};
        for (const Vec3& eye : eyes) {
            const double moved = repeats ? 3900 : 0;
            RenderOptions options = options_at(eye + Vec3(moved, 0, 0), {150 + moved, 900, 300});
            options.precipitation.evaporation = repeats ? 0.3 : 0;
            const Picture picture = cloudy(options.camera, random);
            const Drawn drawn = draw(picture, options, curtains, 100);
            EXPECT_LE(drawn.apart, 2) << eye.x << " " << repeats;
            EXPECT_NE(drawn.picture.beauty, picture.beauty);
        }
    }
}

// Beside the cloud there is no rain; above its base neither.
TEST(RainShafts, FallOnlyBelowTheCloud) {
    RainCurtain curtain = area();
    curtain.x_m = 0;
    curtain.axis_x = 1;
    curtain.axis_y = 0;
    curtain.semi_a_m = 2000;
    curtain.base_m = 900;
    CloudBases half{-3000, -1000, 500, 12, 8, {}, {}};  // to the east of x = 0, its base at 600 m
    for (int n = 0; n < 12 * 8; ++n) {
        half.water.push_back(n % 12 >= 6 ? 1.0f : 0.0f);
        half.water_base_m.push_back(n % 12 >= 6 ? 600.0f : 0.0f);
    }
    curtain.cloud = std::make_shared<CloudBases>(half);
    RenderOptions options = options_at({0, -3000, 300}, {0, 900, 300});
    options.camera.vertical_fov_deg = 30;
    const CameraFrame camera = camera_frame(options.camera);
    Picture picture = test::grey(options.camera, 0.9f);
    const Picture before = picture;
    draw_shafts(picture, options, camera, {&curtain, 1}, precipitation_light(picture, options, 0), 0, 5);
    const auto changed = [&](const Vec3& place) {
        const PixelPosition at = project(camera, options.camera, place);
        const std::size_t n = 3 * (std::size_t(at.y) * std::size_t(picture.width) + std::size_t(at.x));
        return std::abs(picture.beauty[n] - before.beauty[n]) > 0.004f;
    };
    EXPECT_TRUE(changed({900, 900, 300}));
    EXPECT_FALSE(changed({-900, 900, 300}));
    EXPECT_FALSE(changed({900, 900, 850}));
    EXPECT_FALSE(changed({-900, 900, 850}));
}

// What stands in the middle of a curtain, a wall of fog here, has steps of its own before it and behind:
// neighbours, whose steps are displaced against each other, see as much of the curtain before it.
TEST(RainShafts, HaveNoGrainBeforeWhatStandsInThem) {
    RainCurtain curtain = area();
    curtain.rate_mm_per_h = 150;
    RenderOptions options = options_at({0, -3000, 300}, {0, 0, 300});
    options.camera.vertical_fov_deg = 0.5;  // the curtain itself hardly changes from pixel to pixel
    options.precipitation.shaft_texture = 0;
    const CameraFrame camera = camera_frame(options.camera);
    for (const float left : {0.0f, 0.7f}) {
        for (const float depth_m : {3600.0f, 3800.0f, 3850.0f, 4000.0f, 9000.0f}) {
            Picture picture = test::grey(options.camera, 0.85f);
            const PrecipitationLight light = precipitation_light(picture, options, 0);
            std::ranges::fill(picture.depth_m, depth_m);
            std::ranges::fill(picture.transmittance, left);
            draw_shafts(picture, options, camera, {&curtain, 1}, light, 0, 5);
            float most = 0, darkest = 0.85f;
            for (int y = 0; y < picture.height; ++y) {
                const float* row = &picture.beauty[std::size_t(3 * y * picture.width)];
                for (int x = 0; x + 1 < picture.width; ++x) {
                    most = std::max(most, std::abs(row[3 * x + 3] - row[3 * x]));
                    darkest = std::min(darkest, row[3 * x]);
                }
            }
            EXPECT_LT(most, 1.5f / 255) << depth_m;
            EXPECT_LT(darkest, 0.8f) << depth_m << ": the curtain is seen";
        }
    }
}

TEST(RainShafts, AreTheSameForAnyNumberOfThreads) {
    std::mt19937 random(7);
    const RenderOptions options = options_at({-400, -900, 20}, {100, 900, 300});
    const Picture picture = cloudy(options.camera, random);
    const RainCurtain curtain = area();
    const CameraFrame camera = camera_frame(options.camera);
    const PrecipitationLight light = precipitation_light(picture, options, 0);
    const auto drawn = [&](std::size_t threads) {
        Picture copy = picture;
        test::with_threads(threads, [&] { draw_shafts(copy, options, camera, {&curtain, 1}, light, 0, 5); });
        return copy.beauty;
    };
    const std::vector<float> one = drawn(1);
    for (const std::size_t threads : {2, 3, 8}) EXPECT_EQ(drawn(threads), one);
}

}  // namespace
}  // namespace nephos
