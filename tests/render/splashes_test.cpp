// SPDX-License-Identifier: Apache-2.0
// Splashes of drops on the ground: how many there are, that they are a function of time and seed, and where they show.

#include "render/rain/splashes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "render/rain/precipitation.h"
#include "tests/render/rain_scene.h"

namespace nephos {
namespace {

constexpr Vec3 kEye{100, 900, 1.7};  // in the middle of the area

// Rain as strong as in its middle everywhere around the eye.
Weather rain_of(double rate_mm_per_h) {
    Weather weather;
    weather.seed = 3;
    RainCurtain wide = test::rain_area();
    wide.semi_a_m = wide.semi_b_m = 4000;
    wide.rate_mm_per_h = rate_mm_per_h;
    weather.curtains = {wide};
    return weather;
}

RenderOptions view(const Vec3& way) {
    RenderOptions options = test::rain_view(kEye, kEye + way, 320, 200, 0);
    options.precipitation.splashes = 1;
    return options;
}

RainFrame frame_of(const RenderOptions& options, double time_s) {
    RainFrame frame;
    frame.options = options;
    frame.camera = frame.opening = frame.closing = camera_frame(options.camera);
    frame.light.by_sky = {1, 1, 1};
    frame.time_s = time_s;
    return frame;
}

const Vec3 kDown{0, 0.001, -1}, kAhead{0, 6, -1.5};

double distance_of(const Splash& splash) { return std::hypot(splash.x_m - kEye.x, splash.y_m - kEye.y); }

TEST(Splashes, ThrowingDropsAreTheIntegralOfTheirFlux) {
    for (const double rate : {2.0, 10.0, 50.0}) {
        const SizeLaw law = size_law(PrecipitationKind::rain, rate);
        double sum = 0;
        for (double d_mm = kThrowing_mm; d_mm < kLargest_mm; d_mm += 0.001)
            sum += 0.001 * law.n0 * std::exp(-law.slope * d_mm) *
                   fall_speed_m_per_s(PrecipitationKind::rain, d_mm);
        EXPECT_NEAR(throwing_drops(law), sum, 0.01 * sum) << rate;
    }
    EXPECT_EQ(throwing_drops(size_law(PrecipitationKind::rain, 0)), 0);
    EXPECT_EQ(throwing_drops(size_law(PrecipitationKind::snow, 5)), 0);
}

// Around an eye that looks straight down: as many as fall in a period, in each ring, on an average over times. Splashes that
// stand for several count so.
TEST(Splashes, AreAsManyAsTheRainSays) {
    for (const double rate : {3.0, 10.0}) {
        const Weather weather = rain_of(rate);
        const double per_m2 = throwing_drops(size_law(PrecipitationKind::rain, rate)) * kSplashPeriod_s;
        for (const auto& [inner_m, outer_m] : {std::pair{0.0, 5.0}, {8.0, 14.0}, {14.0, 22.0}}) {
            double sum = 0, squares = 0;
            constexpr int kTimes = 5;
            for (int n = 0; n < kTimes; ++n)
                for (const Splash& each : splashes_at(frame_of(view(kDown), 10 + 1.7 * n), weather)) {
                    const double distance = distance_of(each);
                    if (distance < inner_m || distance >= outer_m) continue;
                    sum += each.weight;
                    squares += each.weight * each.weight;
                }
            const double expected = per_m2 * std::numbers::pi * (outer_m * outer_m - inner_m * inner_m);
            EXPECT_NEAR(sum / kTimes, expected, 4 * std::sqrt(squares) / kTimes + 0.06 * expected)
                << rate << ", " << outer_m;
        }
    }
    const RenderOptions none = view(kDown);
    for (const Splash& each : splashes_at(frame_of(none, 4), rain_of(10)))
        EXPECT_LT(distance_of(each), kSplashReach_m + 2);
}

// What there is at a time is there a little later, at the same place and older by as much: frames need no frames before them.
TEST(Splashes, AreAFunctionOfTimeAndSeed) {
    Weather weather = rain_of(10);
    const auto at = [&](double time_s) { return splashes_at(frame_of(view(kAhead), time_s), weather); };
    const std::vector<Splash> first = at(20), again = at(20), later = at(20.05);
    ASSERT_GT(first.size(), 500u);
    ASSERT_EQ(first.size(), again.size());
    std::map<std::pair<double, double>, double> ages;
    for (const Splash& each : later) ages[{each.x_m, each.y_m}] = each.age_s;
    std::size_t young = 0;
    for (std::size_t n = 0; n < first.size(); ++n) {
        EXPECT_EQ(first[n].x_m, again[n].x_m);
        EXPECT_EQ(first[n].age_s, again[n].age_s);
        EXPECT_GE(first[n].age_s, 0);
        EXPECT_LT(first[n].age_s, kSplashPeriod_s);
        if (first[n].age_s > kSplashPeriod_s - 0.0501) continue;
        ++young;
        ASSERT_TRUE((ages.contains({first[n].x_m, first[n].y_m})));
        EXPECT_NEAR((ages[{first[n].x_m, first[n].y_m}]), first[n].age_s + 0.05, 1e-9);
    }
    EXPECT_GT(young, first.size() / 2);
    weather.seed = 4;
    const std::vector<Splash> other = at(20);
    std::size_t same = 0;
    for (const Splash& each : other) same += std::ranges::count(first, each.x_m, &Splash::x_m) > 0 ? 1 : 0;
    EXPECT_EQ(same, 0u);
}

TEST(Splashes, NeedRainAndKnownGroundNearTheEye) {
    const Weather weather = rain_of(10);
    const auto number = [&](RenderOptions options, const Weather& of) {
        return splashes_at(frame_of(options, 5), of).size();
    };
    EXPECT_GT(number(view(kAhead), weather), 0u);
    RenderOptions off = view(kAhead), snow = off, high = off, hills = off;
    off.precipitation.splashes = 0;
    snow.precipitation.kind = PrecipitationKind::snow;
    high.camera.position_m.z = 60;
    hills.terrain.relief = Relief::hills;
    for (const RenderOptions& options : {off, snow, high, hills}) EXPECT_EQ(number(options, weather), 0u);
    EXPECT_EQ(number(view(kAhead), {}), 0u);
    Weather elsewhere = weather;
    elsewhere.curtains[0].x_m += 9000;
    EXPECT_EQ(number(view(kAhead), elsewhere), 0u);
    // At the edge of an area it rains less.
    Weather edge = weather;
    edge.curtains[0].x_m += 3200;
    const auto weight = [&](const Weather& of) {
        double sum = 0;
        for (const Splash& each : splashes_at(frame_of(view(kAhead), 5), of)) sum += each.weight;
        return sum;
    };
    EXPECT_GT(weight(edge), 0.3 * weight(weather));
    EXPECT_LT(weight(edge), 0.7 * weight(weather));
}

// On relief they lie on it: as many as on level ground for the same area of map, and none on a wall.
TEST(Splashes, LieOnReliefButNotOnWalls) {
    RenderOptions options = view(kDown);
    options.terrain.relief = Relief::hills;
    options.camera.position_m.z = options.camera.target_m.z = 101.7;
    options.camera.target_m.z -= 1;
    Weather weather = rain_of(10);
    // Ground that rises to the east, with a wall of 10 m from 3 to 4 m east of the eye.
    const auto surface = [](double x_m, double) {
        const double east_m = x_m - kEye.x, wall = std::clamp(east_m - 3, 0.0, 1.0);
        return GroundSurface{100 + 0.3 * east_m + 10 * wall, wall > 0 && wall < 1 ? 10.3 : 0.3, 0};
    };
    EXPECT_TRUE(splashes_at(frame_of(options, 5), weather).empty()) << "how the relief lies is not known";
    weather.relief = surface;
    double low = 0, beyond = 0;
    for (int n = 0; n < 5; ++n) {
        for (const Splash& each : splashes_at(frame_of(options, 5 + 1.7 * n), weather)) {
            const double east_m = each.x_m - kEye.x;
            EXPECT_DOUBLE_EQ(each.ground.z_m, surface(each.x_m, each.y_m).z_m);
            EXPECT_FALSE(east_m > 3 && east_m < 4) << "on the wall";
            if (east_m < 0 && distance_of(each) < 5) low += each.weight;
            if (east_m > 5) ++beyond;
        }
    }
    const double per_m2 = throwing_drops(size_law(PrecipitationKind::rain, 10)) * kSplashPeriod_s;
    const double expected = 5 * per_m2 * 0.5 * std::numbers::pi * 25;
    EXPECT_NEAR(low, expected, 0.15 * expected);
    EXPECT_EQ(beyond, 0) << "above the eye, which looks down";
}

// A crown stands where its drop fell and is gone before the droplets land, which fly outwards and down again.
TEST(Splashes, AreCrownsAndThenDroplets) {
    const RainFrame frame = frame_of(view(kAhead), 5);
    const auto streaks = [&](double age_s) {
        return streaks_of_splashes(frame, {Splash{kEye.x, kEye.y + 3, {}, age_s, 1, 0.3, 0.8}});
    };
    const PixelPosition impact = project(frame.camera, frame.options.camera, {kEye.x, kEye.y + 3, 0});
    const std::vector<Streak> young = streaks(0.03), flying = streaks(0.1), gone = streaks(0.29);
    ASSERT_GT(young.size(), 2u);
    EXPECT_NEAR(double(young.front().x0), impact.x, 1);
    EXPECT_GT(young.front().width, 1);
    double spread = 0, height = 0;
    ASSERT_GT(flying.size(), 2u);
    for (const Streak& each : flying) {
        spread = std::max(spread, std::abs(double(each.x0) - impact.x));
        height = std::max(height, impact.y - double(each.y0));
        EXPECT_LE(each.opacity, 0.85f);
        EXPECT_EQ(each.red, each.green);
    }
    EXPECT_GT(spread, 1);
    EXPECT_GT(height, 1);
    EXPECT_TRUE(gone.empty());
}

// They are drawn where the ground is, with the particles or without.
TEST(Splashes, LieOnTheGroundOfThePicture) {
    const RenderOptions wet = view(kAhead);
    RenderOptions dry = wet;
    dry.precipitation.splashes = 0;
    const auto draw = [](const RenderOptions& options) {
        Picture picture;
        picture.width = options.camera.width;
        picture.height = options.camera.height;
        picture.beauty.assign(3 * std::size_t(picture.width) * std::size_t(picture.height), 0.2f);
        picture.transmittance.assign(picture.beauty.size() / 3, 1.0f);
        picture.depth_m.assign(picture.beauty.size() / 3, 0.0f);
        RenderOptions without_shafts = options;
        without_shafts.precipitation.shafts = 0;
        PrecipitationPainter().draw(picture, without_shafts, rain_of(20), 5);
        return picture;
    };
    const Picture with = draw(wet), without = draw(dry);
    const double horizon = project(camera_frame(wet.camera), wet.camera, kEye + Vec3{0, 1e5, 0}).y;
    std::size_t changed = 0, above = 0;
    for (std::size_t i = 0; i < with.pixels(); ++i) {
        if (std::abs(with.beauty[3 * i] - without.beauty[3 * i]) < 1e-4f) continue;
        ++changed;
        above += double(i / std::size_t(with.width)) < horizon - 2 ? 1 : 0;
    }
    EXPECT_GT(changed, with.pixels() / 200);
    EXPECT_EQ(above, 0u);
}

}  // namespace
}  // namespace nephos
