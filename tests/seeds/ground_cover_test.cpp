// SPDX-License-Identifier: Apache-2.0

// Wetting, drying, snow and its melting against a brute-force integration of the same equations and against
// what they say in words; the exposure map against the rain areas themselves.

#include "seeds/ground_cover.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "core/error.h"

namespace nephos {
namespace {

constexpr double kHour = 3600;

// Runge-Kutta would hide the corner where the snow ends: many small Euler steps.
GroundFilm integrated(GroundFilm film, double rain, double snow, double duration_s,
                      const GroundCoverOptions& o) {
    constexpr int kSteps = 400000;
    const double dt = duration_s / kSteps;
    for (int n = 0; n < kSteps; ++n) {
        const double room = film.snow_mm + snow / kHour * dt;
        const double melts = std::min(room, o.melting_mm_per_h / kHour * dt);
        const double input = rain / kHour + melts / dt;
        film.snow_mm = room - melts;
        film.water_mm += dt * (input * (1 - film.water_mm / o.capacity_mm) - film.water_mm / o.drying_s);
    }
    return film;
}

TEST(GroundFilmTest, IsTheSolutionOfItsEquations) {
    GroundCoverOptions options;
    options.capacity_mm = 2;
    options.drying_s = 4000;
    options.melting_mm_per_h = 1.5;
    for (const GroundFilm start :
         {GroundFilm{0, 0}, GroundFilm{1.2, 0}, GroundFilm{5, 0.4}, GroundFilm{0.1, 3}}) {
        for (const double rain : {0.0, 4.0}) {
            for (const double snow : {0.0, 0.7, 2.5}) {
                const GroundFilm exact = advanced(start, rain, snow, kHour, options);
                const GroundFilm expected = integrated(start, rain, snow, kHour, options);
                EXPECT_NEAR(exact.water_mm, expected.water_mm, 2e-4)
                    << start.snow_mm << ' ' << rain << ' ' << snow;
                EXPECT_NEAR(exact.snow_mm, expected.snow_mm, 1e-5)
                    << start.snow_mm << ' ' << rain << ' ' << snow;
            }
        }
    }
}

// However long a step is: two parts of it are the whole, and the film never leaves its bounds.
TEST(GroundFilmTest, IsExactAndStableForAnyStep) {
    GroundCoverOptions options;
    options.melting_mm_per_h = 0.8;
    for (const double duration_s : {1e-3, 1.0, 60.0, 1e4, 1e9}) {
        for (const double part : {0.0, 0.2, 0.9}) {
            for (const double rain : {0.0, 0.3, 500.0}) {
                const GroundFilm start{0.7, 1.1};
                const GroundFilm whole = advanced(start, rain, 0, duration_s, options);
                const GroundFilm half = advanced(start, rain, 0, part * duration_s, options);
                const GroundFilm both = advanced(half, rain, 0, (1 - part) * duration_s, options);
                EXPECT_NEAR(whole.water_mm, both.water_mm, 1e-10) << duration_s;
                EXPECT_NEAR(whole.snow_mm, both.snow_mm, 1e-10) << duration_s;
                EXPECT_GE(whole.water_mm, 0);
                EXPECT_LE(whole.water_mm, options.capacity_mm);
                EXPECT_GE(whole.snow_mm, 0);
            }
        }
    }
}

TEST(GroundFilmTest, DriesToOneEthInItsTimeAndFillsHollowsAsLinsleySays) {
    GroundCoverOptions options;
    options.drying_s = 1800;
    EXPECT_NEAR(advanced({2, 0}, 0, 0, 1800, options).water_mm, 2 / std::exp(1.0), 1e-12);
    options.drying_s = std::numeric_limits<double>::infinity();
    EXPECT_EQ(advanced({2, 0}, 0, 0, 1e9, options).water_mm, 2);
    // 6 mm of rain in two hours.
    EXPECT_NEAR(advanced({0, 0}, 3, 0, 2 * kHour, options).water_mm,
                options.capacity_mm * (1 - std::exp(-6 / options.capacity_mm)), 1e-12);
}

TEST(GroundFilmTest, SnowGrowsWithWhatFallsAndIsGoneWhenItHasMelted) {
    GroundCoverOptions options;
    options.drying_s = std::numeric_limits<double>::infinity();
    EXPECT_DOUBLE_EQ(advanced({0, 1}, 0, 2, kHour, options).snow_mm, 3);
    options.melting_mm_per_h = 0.5;
    EXPECT_DOUBLE_EQ(advanced({0, 1}, 0, 0, kHour, options).snow_mm, 0.5);
    EXPECT_EQ(advanced({0, 1}, 0, 0, 2.5 * kHour, options).snow_mm, 0);
    EXPECT_GT(advanced({0, 1}, 0, 0, kHour, options).water_mm, 0.4) << "what melts wets the ground";
    EXPECT_EQ(advanced({0, 0}, 0, 0.4, kHour, options).snow_mm, 0) << "melts as it falls";
}

RainArea shower() {
    RainArea area;
    area.x_m = 300;
    area.y_m = -200;
    area.semi_a_m = 700;
    area.semi_b_m = 250;
    area.axis_x = 0.6;
    area.axis_y = 0.8;
    area.intensity_mm_per_h = 12;
    return area;
}

// Every texel has the rain at its middle, up the wind by the drift, and of several areas the strongest.
TEST(GroundCoverTest, IsExposedToTheRainAboveIt) {
    GroundCoverOptions options;
    options.texels = 64;
    GroundCover cover(options, PrecipitationKind::rain, {-1500, -1500, 1500, 1500});
    RainArea second = shower();
    second.x_m = -400;
    second.intensity_mm_per_h = 5;
    const RainArea low[] = {shower(), second}, high[] = {shower()};
    const FallingRain falling[] = {{low, {120, -60}}, {high, {-900, 300}}};
    cover.expose(falling);
    const GroundCoverMap& map = cover.map();
    EXPECT_DOUBLE_EQ(map.x_m, -1800);
    EXPECT_DOUBLE_EQ(map.texel_y_m * map.rows, 3600);
    int wet = 0;
    for (int row = 0; row < map.rows; ++row) {
        for (int column = 0; column < map.columns; ++column) {
            const double x = map.x_m + (column + 0.5) * map.texel_x_m,
                         y = map.y_m + (row + 0.5) * map.texel_y_m;
            const double expected = std::max(rain_at(low, x - 120, y + 60, options.edge),
                                             rain_at(high, x + 900, y - 300, options.edge));
            const float found = map.rain_mm_per_h[std::size_t(row * map.columns + column)];
            ASSERT_NEAR(found, expected, 1e-5) << column << ' ' << row;
            wet += found > 0;
        }
    }
    EXPECT_GT(wet, 200);
}

TEST(GroundCoverTest, WetsWhereItRainsAndDriesElsewhere) {
    GroundCoverOptions options;
    options.texels = 48;
    options.initial_water_mm = 1;
    GroundCover cover(options, PrecipitationKind::rain, {-1000, -1000, 1000, 1000});
    const RainArea areas[] = {shower()};
    const FallingRain falling[] = {{areas, {}}};
    cover.expose(falling);
    cover.advance(600);
    const GroundCoverMap& map = cover.map();
    for (std::size_t i = 0; i < map.water_mm.size(); ++i) {
        const GroundFilm expected = advanced({1, 0}, map.rain_mm_per_h[i], 0, 600, options);
        ASSERT_NEAR(map.water_mm[i], expected.water_mm, 1e-6) << i;
    }
    EXPECT_NEAR(map.outside.water_mm, std::exp(-600 / options.drying_s), 1e-12);
    EXPECT_EQ(map.outside_rain_mm_per_h, 0);
    cover.expose({});
    cover.advance(1e9);
    for (const float water : cover.map().water_mm) EXPECT_EQ(water, 0);
}

TEST(GroundCoverTest, BecomesWhiteWhereItSnows) {
    GroundCoverOptions options;
    options.texels = 48;
    GroundCover cover(options, PrecipitationKind::snow, {-1000, -1000, 1000, 1000});
    const RainArea areas[] = {shower()};
    const FallingRain falling[] = {{areas, {}}};
    cover.expose(falling);
    cover.advance(1800);
    const GroundCoverMap& map = cover.map();
    for (std::size_t i = 0; i < map.snow_mm.size(); ++i) {
        ASSERT_NEAR(map.snow_mm[i], map.rain_mm_per_h[i] / 2, 1e-5);
        ASSERT_EQ(map.water_mm[i], 0);
    }
}

// Rain that covers the whole map goes on beyond it.
TEST(GroundCoverTest, GroundBeyondTheMapHasTheWeatherOfItsEdge) {
    GroundCoverOptions options;
    options.texels = 16;
    GroundCover cover(options, PrecipitationKind::rain, {0, 0, 100, 100});
    RainArea wide = shower();
    wide.semi_a_m = wide.semi_b_m = 1e6;
    const FallingRain falling[] = {{{&wide, 1}, {}}};
    cover.expose(falling);
    cover.advance(1000);
    EXPECT_NEAR(cover.map().outside_rain_mm_per_h, 12, 1e-5);
    EXPECT_NEAR(cover.map().outside.water_mm, cover.map().water_mm[100], 1e-5);
}

TEST(GroundCoverTest, IsMixedLinearly) {
    GroundCoverOptions options;
    options.texels = 4;
    options.initial_water_mm = 2;
    GroundCover cover(options, PrecipitationKind::rain, {0, 0, 100, 100});
    const GroundCoverMap before = cover.map();
    cover.advance(3000);
    const GroundCoverMap half = mix(before, cover.map(), 0.5);
    EXPECT_NEAR(half.water_mm[5], (before.water_mm[5] + cover.map().water_mm[5]) / 2, 1e-6);
    EXPECT_NEAR(half.outside.water_mm, (2 + cover.map().outside.water_mm) / 2, 1e-12);
    EXPECT_EQ(mix(before, cover.map(), 0), before);
}

// Half the way in calm air, the other half in 10 m/s: a drop of 5 m/s takes 100 s each.
TEST(DriftTest, IsTheWindOnTheWayDown) {
    Wind wind;
    wind.keyframes = {{0, {{0, {0, 0}}, {600, {0, 0}}, {600.001, {10, -4}}}}};
    const Vec2 drift = drift_m(wind, 0, 1100, 100, 5);
    EXPECT_NEAR(drift.x, 1000, 1e-6);
    EXPECT_NEAR(drift.y, -400, 1e-6);
    EXPECT_EQ(drift_m(wind, 0, 100, 100, 5).x, 0);
    EXPECT_EQ(drift_m(wind, 0, 1100, 100, std::numeric_limits<double>::infinity()).x, 0);
}

// The cloud is 2000 m farther after those 200 s.
TEST(DriftTest, LagsBehindACloudThatIsCarried) {
    Wind wind;
    wind.keyframes = {{0, {{0, {0, 0}}, {600, {0, 0}}, {600.001, {10, -4}}}}};
    const Vec2 lag = lag_m(wind, 0, 1100, 100, 5);
    EXPECT_NEAR(lag.x, -1000, 1e-6);
    EXPECT_NEAR(lag.y, 400, 1e-6);
    EXPECT_EQ(lag_m(wind, 0, 100, 1100, 5).x, 0);
    EXPECT_EQ(lag_m(wind, 0, 1100, 100, std::numeric_limits<double>::infinity()).x, 0);
    Wind even;  // all move alike
    even.keyframes = {{0, {{0, {7, 3}}}}};
    EXPECT_NEAR(lag_m(even, 0, 1100, 100, 5).x, 0, 1e-9);
}

TEST(GroundCoverTest, RefusesBadOptions) {
    const auto refused = [](auto change) {
        GroundCoverOptions options;
        change(options);
        EXPECT_THROW(check(options), Error);
    };
    EXPECT_NO_THROW(check(GroundCoverOptions{}));
    refused([](GroundCoverOptions& o) { o.capacity_mm = 0; });
    refused([](GroundCoverOptions& o) { o.drying_s = 0; });
    refused([](GroundCoverOptions& o) { o.drying_s = std::nan(""); });
    refused([](GroundCoverOptions& o) { o.fall_speed_m_per_s = -1; });
    refused([](GroundCoverOptions& o) { o.texels = 1; });
    refused([](GroundCoverOptions& o) { o.edge = 1.5; });
    refused([](GroundCoverOptions& o) { o.initial_snow_mm = -1; });
    GroundCover cover({}, PrecipitationKind::rain, {0, 0, 1, 1});
    GroundCoverMap other = cover.map();
    other.water_mm.pop_back();
    EXPECT_THROW(cover.restore(other), Error);
}

}  // namespace
}  // namespace nephos
