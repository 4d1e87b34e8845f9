// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>
#include <map>
#include <random>

#include "seeds/rain_area.h"
#include "seeds/rain_finder.h"
#include "tests/seeds/fixtures.h"

namespace nephos {
namespace {

using test::expect_error;

constexpr Extent kExtent{100, 80, 10};
const Placement kPlacement{{-1000, 500, 200}, 50};
constexpr Boundaries kPeriodic{Boundary::periodic, Boundary::periodic, Boundary::open};

// Fills columns inside an ellipse (cells, turned by `yaw_deg`) with `height` cells of cloud.
void fill(BitPlane& plane, double x, double y, double a, double b, double yaw_deg, int height,
          bool wrap = false) {
    const double c = std::cos(yaw_deg * M_PI / 180), s = std::sin(yaw_deg * M_PI / 180);
    const Extent e = plane.extent();
    for (int j = -e.y; j < 2 * e.y; ++j) {
        for (int i = -e.x; i < 2 * e.x; ++i) {
            const double dx = i + 0.5 - x, dy = j + 0.5 - y;
            const double u = (dx * c + dy * s) / a, v = (dy * c - dx * s) / b;
            if (u * u + v * v > 1) continue;
            const bool inside = i >= 0 && j >= 0 && i < e.x && j < e.y;
            if (!inside && !wrap) continue;
            for (int k = 0; k < height; ++k) plane.set((i + e.x) % e.x, (j + e.y) % e.y, k, true);
        }
    }
}

RainFinderOptions quick() {
    RainFinderOptions o;
    o.start_water_m = 300;  // 6 cells
    o.keep_water_m = 150;   // 3 cells
    o.smooth_columns = 0;
    o.min_area_m2 = 10 * 50 * 50;
    o.respond_s = 0;
    o.fade_s = 100;
    return o;
}

TEST(RainArea, InsideBelowOneAndSmoothEdges) {
    const double c = std::sqrt(0.5);
    const RainArea area{.id = 1,
                        .x_m = 100,
                        .y_m = 50,
                        .semi_a_m = 20,
                        .semi_b_m = 10,
                        .axis_x = c,
                        .axis_y = c,
                        .intensity_mm_per_h = 8};
    EXPECT_EQ(ellipse_value(area, 100, 50), 0);
    EXPECT_NEAR(ellipse_value(area, 100 + 20 * c, 50 + 20 * c), 1, 1e-12);
    EXPECT_NEAR(ellipse_value(area, 100 - 10 * c, 50 + 10 * c), 1, 1e-12);
    EXPECT_NEAR(ellipse_value(area, 100 + 40 * c, 50 + 40 * c), 4, 1e-12);
    EXPECT_EQ(rain_at(area, 100, 50, 0.3), 8);
    EXPECT_EQ(rain_at(area, 100 + 20.01 * c, 50 + 20.01 * c, 0.3), 0);
    EXPECT_NEAR(rain_at(area, 100 + 17 * c, 50 + 17 * c, 0.3), 4, 1e-9);  // the middle of the edge
    EXPECT_NEAR(rain_at(area, 100 + 19.99 * c, 50 + 19.99 * c, 0), 8, 1e-9);
    double before = 8;
    for (double r = 0; r < 21; r += 0.01) {  // falls everywhere, jumps nowhere
        const double now = rain_at(area, 100 + r * c, 50 + r * c, 0.3);
        EXPECT_LE(now, before);
        EXPECT_LE(before - now, 8 * 1.5 * 0.01 / (20 * 0.3) + 1e-9);
        before = now;
    }
    const std::vector<RainArea> two{area, {.x_m = 100, .y_m = 50, .intensity_mm_per_h = 3}};
    EXPECT_EQ(rain_at(two, 100, 50, 0.3), 8);
    EXPECT_EQ(rain_at(two, 700, 50, 0.3), 3);
}

TEST(RainArea, PlacedByHand) {
    const PlacedRain rain{.x_m = 10,
                          .y_m = 20,
                          .semi_a_m = 300,
                          .semi_b_m = 100,
                          .yaw_deg = 90,
                          .intensity_mm_per_h = 6,
                          .start_s = 100,
                          .end_s = 200,
                          .fade_s = 20,
                          .carried = true};
    const std::vector<PlacedRain> rains{{.start_s = 1000}, rain};
    const Displacement moved{std::int64_t(5) << 32, -(std::int64_t(3) << 31)};
    EXPECT_TRUE(placed_areas(rains, 99, moved).empty());
    EXPECT_TRUE(placed_areas(rains, 200, moved).empty());
    const auto areas = placed_areas(rains, 110, moved);
    ASSERT_EQ(areas.size(), 1u);
    EXPECT_EQ(areas[0].id, rain_id(RainSource::placed, 0, 0, 1));
    EXPECT_EQ(areas[0].x_m, 15);
    EXPECT_EQ(areas[0].y_m, 18.5);
    EXPECT_EQ(areas[0].axis_y, 1);
    EXPECT_DOUBLE_EQ(areas[0].intensity_mm_per_h, 3);
    EXPECT_DOUBLE_EQ(placed_areas(rains, 150, moved)[0].intensity_mm_per_h, 6);
    EXPECT_DOUBLE_EQ(placed_areas(rains, 195, moved)[0].intensity_mm_per_h, 1.5);
    EXPECT_EQ(placed_areas(std::vector<PlacedRain>{{}}, 1e12, {}).size(), 1u);  // for ever, fixed
    expect_error(ErrorCode::usage, "ends", [] { check(PlacedRain{.start_s = 5, .end_s = 5}); });
    expect_error(ErrorCode::usage, "semi-axis b", [] { check(PlacedRain{.semi_b_m = 0}); });
    expect_error(ErrorCode::usage, "intensity", [] { check(PlacedRain{.intensity_mm_per_h = -1}); });
}

TEST(RainArea, AttachedToClouds) {
    SkyOptions options = test::small_sky();
    options.models[1].genus = Genus::Cb;
    options.schedule = {{0, 1}};
    options.skies[0].models.push_back({1, 3});
    SkySimulation sky(options);
    const auto areas = attached_areas(
        std::vector<AttachedRain>{{.genus = Genus::Cb, .size_scale = 1.5, .intensity_mm_per_h = 7}}, sky);
    ASSERT_EQ(areas.size(), 80u);
    for (std::size_t i = 0; i < areas.size(); ++i) {
        EXPECT_EQ(areas[i].id, rain_id(RainSource::attached, 0, 0, sky.clouds()[i].serial));
        EXPECT_EQ(areas[i].semi_a_m, 225);
        EXPECT_EQ(areas[i].x_m, sky.sphere(sky.clouds()[i]).centre_m.x);
        EXPECT_EQ(areas[i].intensity_mm_per_h, 7);
    }
    EXPECT_TRUE(attached_areas(std::vector<AttachedRain>{{.genus = Genus::Cu}}, sky).empty());
    EXPECT_TRUE(attached_areas(std::vector<AttachedRain>{{.state = {0, 0.5}}}, sky).empty());
    EXPECT_EQ(attached_areas(std::vector<AttachedRain>{{.state = {0.9, 1}}, {.model = 1}}, sky).size(), 160u);
    expect_error(ErrorCode::usage, "state", [] { check(AttachedRain{.state = {0.7, 0.2}}); });
}

// An area keeps its id, lies below its cloud, and drifts with it by the way of the wind, which turns.
TEST(RainArea, AttachedAreasFollowTheirClouds) {
    SkyOptions options = test::small_sky();
    options.wind = {{{0, {{0, {12, 3}}}}, {400, {{0, {-9, 6}}}}}};
    options.schedule = {{0, 0}, {300, 1}};
    const std::vector<AttachedRain> rule{{.size_scale = 2, .intensity_mm_per_h = 4}};
    SkySimulation sky(options);
    std::map<std::uint64_t, RainArea> before;
    std::size_t followed = 0;
    for (int step = 0; step < 60; ++step) {
        const Velocity wind = wind_at(options.wind, 0, sky.time_s());
        sky.step();
        std::map<std::uint64_t, RainArea> now;
        for (const RainArea& area : attached_areas(rule, sky)) now[area.id] = area;
        for (const SkyCloud& cloud : sky.clouds()) {
            const auto area = now.find(rain_id(RainSource::attached, 0, 0, cloud.serial));
            if (cloud.phase == 0) {
                EXPECT_EQ(area, now.end());
                continue;
            }
            ASSERT_NE(area, now.end());
            EXPECT_EQ(area->second.x_m, sky.sphere(cloud).centre_m.x);
            EXPECT_EQ(area->second.y_m, sky.sphere(cloud).centre_m.y);
            EXPECT_DOUBLE_EQ(area->second.intensity_mm_per_h, 4 * cloud.phase);
            const auto last = before.find(area->first);
            if (last == before.end()) continue;
            ++followed;
            EXPECT_NEAR(area->second.x_m - last->second.x_m, 10 * wind.east_m_per_s, 1e-6);
            EXPECT_NEAR(area->second.y_m - last->second.y_m, 10 * wind.north_m_per_s, 1e-6);
            EXPECT_LE(std::abs(area->second.intensity_mm_per_h - last->second.intensity_mm_per_h),
                      4 * 10.0 / 300 + 1e-9);
        }
        before = std::move(now);
    }
    EXPECT_GT(followed, 1000u);
}

TEST(RainArea, BetweenTwoMoments) {
    const RainArea a{.id = 1, .x_m = 0, .y_m = 100, .semi_a_m = 200, .semi_b_m = 50, .intensity_mm_per_h = 4};
    RainArea b = a;
    b.x_m = 80;
    b.semi_a_m = 400;
    b.intensity_mm_per_h = 8;
    b.axis_x = 0;
    b.axis_y = -1;  // the same axis as (0, 1)
    const RainArea gone{.id = 2, .x_m = 5, .intensity_mm_per_h = 3},
        born{.id = 3, .x_m = 7, .intensity_mm_per_h = 6};
    const std::vector<RainArea> from{a, gone}, to{born, b};
    const std::vector<RainArea> half = mix(from, to, 0.5);
    ASSERT_EQ(half.size(), 3u);
    EXPECT_EQ(half[0].id, 1u);
    EXPECT_EQ(half[0].x_m, 40);
    EXPECT_EQ(half[0].y_m, 100);
    EXPECT_EQ(half[0].semi_a_m, 300);
    EXPECT_EQ(half[0].intensity_mm_per_h, 6);
    EXPECT_NEAR(half[0].axis_x * half[0].axis_x + half[0].axis_y * half[0].axis_y, 1, 1e-12);
    EXPECT_NEAR(std::abs(half[0].axis_x), std::sqrt(0.5), 1e-12);
    EXPECT_EQ(half[1].id, 2u);
    EXPECT_EQ(half[1].intensity_mm_per_h, 1.5);
    EXPECT_EQ(half[2].id, 3u);
    EXPECT_EQ(half[2].intensity_mm_per_h, 3);
    EXPECT_EQ(mix(from, to, 0).size(), 2u) << "what only begins is not there yet";
    EXPECT_EQ(mix(from, from, 0.3), from);

    // Through a periodic side: it does not sweep over the whole world.
    b.x_m = 10000;
    EXPECT_EQ(mix(std::vector{a}, std::vector{b}, 0.5), std::vector{a});
    EXPECT_TRUE(mix({}, {}, 0.5).empty());
}

TEST(RainArea, PlacedAreasOfLayersHaveDifferentIds) {
    const std::vector<PlacedRain> rains(2);
    const auto low = placed_areas(rains, 0, {}), high = placed_areas(rains, 0, {}, 1);
    ASSERT_EQ(low.size(), 2u);
    EXPECT_NE(low[0].id, low[1].id);
    EXPECT_NE(low[0].id, high[0].id);
    EXPECT_NE(low[1].id, high[0].id);
}

TEST(RainArea, HumidColumns) {
    const std::vector<RainArea> areas{{.x_m = 1,
                                       .y_m = 2,
                                       .semi_a_m = 300,
                                       .semi_b_m = 100,
                                       .axis_x = 0.6,
                                       .axis_y = 0.8,
                                       .intensity_mm_per_h = 2.5},
                                      {.intensity_mm_per_h = 50},
                                      {.intensity_mm_per_h = 0}};
    const HumidColumn column{.bottom_m = 500, .top_m = 2500, .strength = 0.6, .full_intensity_mm_per_h = 5};
    std::vector<ActiveEllipsoid> out;
    append_columns(out, areas, column);
    ASSERT_EQ(out.size(), 2u);
    EXPECT_DOUBLE_EQ(out[0].weight, 0.3);
    EXPECT_DOUBLE_EQ(out[1].weight, 0.6);
    EXPECT_EQ(out[0].ellipsoid.centre_m, (Vec3{1, 2, 1500}));
    EXPECT_EQ(out[0].ellipsoid.semi_axes_m, (Vec3{300, 100, 1000}));
    EXPECT_NEAR(out[0].ellipsoid.yaw_deg, std::atan2(0.8, 0.6) * 180 / M_PI, 1e-10);
    EXPECT_EQ(out[0].ellipsoid.centre, column.centre);
    expect_error(ErrorCode::usage, "bottom", [] { check(HumidColumn{.bottom_m = 10, .top_m = 10}); });
}

TEST(RainFinder, ColumnCountsAgreeWithCounting) {
    std::mt19937_64 random(2);
    for (Extent e : {Extent{1, 1, 1}, Extent{63, 3, 40}, Extent{130, 5, 7}}) {
        BitPlane plane(e);
        for (int k = 0; k < e.z; ++k) {
            for (int j = 0; j < e.y; ++j) {
                for (int i = 0; i < e.x; ++i) plane.set(i, j, k, random() % 3 != 0);
            }
        }
        const auto counts = column_counts(plane.view());
        for (int j = 0; j < e.y; ++j) {
            for (int i = 0; i < e.x; ++i) {
                std::uint32_t expected = 0;
                for (int k = 0; k < e.z; ++k) expected += plane.get(i, j, k);
                ASSERT_EQ(counts[linear_index(e, i, j, 0)], expected);
            }
        }
    }
}

// A filled ellipse is found with its own place, axes and direction.
TEST(RainFinder, FitsAnEllipse) {
    for (double yaw : {0.0, 30.0, 90.0, 135.0}) {
        BitPlane plane(kExtent);
        fill(plane, 52, 41, 24, 12, yaw, 8);
        RainFinder finder(quick(), kExtent, kPlacement, {});
        finder.update(plane.view(), 10, 0, 0);
        const auto areas = finder.areas();
        ASSERT_EQ(areas.size(), 1u);
        EXPECT_NEAR(areas[0].x_m, -1000 + 52 * 50, 5);
        EXPECT_NEAR(areas[0].y_m, 500 + 41 * 50, 5);
        EXPECT_NEAR(areas[0].semi_a_m, 24 * 50, 12);
        EXPECT_NEAR(areas[0].semi_b_m, 12 * 50, 12);
        const double c = std::cos(yaw * M_PI / 180), s = std::sin(yaw * M_PI / 180);
        EXPECT_NEAR(std::abs(areas[0].axis_x * c + areas[0].axis_y * s), 1, 1e-3) << yaw;
        EXPECT_NEAR(areas[0].intensity_mm_per_h, 8 * 50 * 0.02, 1e-9);
        EXPECT_LT(ellipse_value(areas[0], -1000 + 52 * 50, 500 + 41 * 50), 1);
    }
}

// Through periodic sides a patch is one; with open sides it is two.
TEST(RainFinder, JoinsThroughPeriodicSides) {
    BitPlane plane(kExtent);
    fill(plane, 2, 40, 12, 12, 0, 8, true);
    RainFinderOptions options = quick();
    for (int smoothing : {0, 3}) {
        options.smooth_columns = smoothing;
        RainFinder joined(options, kExtent, kPlacement, kPeriodic), cut(options, kExtent, kPlacement, {});
        joined.update(plane.view(), 10, 0, 0);
        cut.update(plane.view(), 10, 0, 0);
        ASSERT_EQ(joined.areas().size(), 1u);
        EXPECT_NEAR(joined.areas()[0].x_m, -1000 + 2 * 50, 1e-6);
        EXPECT_NEAR(joined.areas()[0].semi_a_m, 600, 30);
        EXPECT_EQ(cut.areas().size(), 2u);
    }
}

// Two thresholds: rain does not begin between them, but goes on; a short gap does not end it nor change its
// name.
TEST(RainFinder, HysteresisAndIdentity) {
    BitPlane thin(kExtent), thick(kExtent), dry(kExtent);
    fill(thin, 50, 40, 15, 10, 0, 4);
    fill(thick, 50, 40, 15, 10, 0, 8);
    RainFinder finder(quick(), kExtent, kPlacement, {});
    finder.update(thin.view(), 10, 0, 0);
    EXPECT_TRUE(finder.areas().empty());
    finder.update(thick.view(), 10, 0, 0);
    ASSERT_EQ(finder.areas().size(), 1u);
    const auto id = finder.areas()[0].id;
    for (int frame = 0; frame < 20; ++frame) {  // flickers around the starting threshold
        finder.update(frame % 2 ? thick.view() : thin.view(), 10, 0, 0);
        ASSERT_EQ(finder.areas().size(), 1u);
        EXPECT_EQ(finder.areas()[0].id, id);
    }
    double before = finder.areas()[0].intensity_mm_per_h;
    finder.update(dry.view(), 10, 0, 0);  // one empty frame
    ASSERT_EQ(finder.areas().size(), 1u);
    EXPECT_LT(finder.areas()[0].intensity_mm_per_h, before);
    EXPECT_GT(finder.areas()[0].intensity_mm_per_h, before * 0.8);
    finder.update(thin.view(), 10, 0, 0);
    ASSERT_EQ(finder.areas().size(), 1u);
    EXPECT_EQ(finder.areas()[0].id, id);
    int frames = 0;
    for (before = 1e9; !finder.areas().empty(); ++frames) {  // dies away slowly
        ASSERT_LT(frames, 200);
        EXPECT_LT(finder.areas()[0].intensity_mm_per_h, before);
        before = finder.areas()[0].intensity_mm_per_h;
        finder.update(dry.view(), 10, 0, 0);
    }
    EXPECT_GT(frames, 10);
    finder.update(thick.view(), 10, 0, 0);
    ASSERT_EQ(finder.areas().size(), 1u);
    EXPECT_NE(finder.areas()[0].id, id);
}

// Two areas cross the periodic world with the wind; each keeps its name, and the response is smooth.
TEST(RainFinder, FollowsTheWind) {
    RainFinderOptions options = quick();
    options.respond_s = 100;
    RainFinder finder(options, kExtent, kPlacement, kPeriodic);
    std::uint64_t first = 0, second = 0;
    double was = 0;
    for (int frame = 0; frame < 120; ++frame) {
        BitPlane plane(kExtent);
        const double x = std::fmod(30 + 3.0 * frame, 100);
        fill(plane, x, 20, 10, 10, 0, 8, true);
        fill(plane, std::fmod(x + 50, 100), 60, 14, 8, 0, 9, true);
        finder.update(plane.view(), 10, frame ? 150 : 0, 0);
        const auto areas = finder.areas();
        if (areas.size() < 2) {
            ASSERT_LT(frame, 10);
            continue;
        }
        ASSERT_EQ(areas.size(), 2u) << frame;
        if (first == 0) {
            first = areas[0].id;
            second = areas[1].id;
            EXPECT_NE(first, second);
        }
        EXPECT_EQ(areas[0].id, first);
        EXPECT_EQ(areas[1].id, second);
        for (const RainArea& area : areas) {
            const bool lower = std::abs(area.y_m - (500 + 20 * 50)) < 100;
            double off = area.x_m - (-1000 + (lower ? x : std::fmod(x + 50, 100)) * 50);
            off -= 5000 * std::round(off / 5000);
            EXPECT_LT(std::abs(off), 100) << frame;
        }
        EXPECT_LE(std::abs(areas[0].intensity_mm_per_h - was), was == 0 ? 10 : 1);
        was = areas[0].intensity_mm_per_h;
    }
    EXPECT_NE(first, 0u);
}

TEST(RainFinder, LimitsAndSavedState) {
    RainFinderOptions options = quick();
    options.max_areas = 3;
    BitPlane plane(kExtent);
    for (int i = 0; i < 6; ++i) fill(plane, 8 + 16 * i, 40, 3.0 + i, 5, 0, 8);
    RainFinder finder(options, kExtent, kPlacement, {});
    finder.update(plane.view(), 10, 0, 0);
    ASSERT_EQ(finder.areas().size(), 3u);
    EXPECT_NEAR(finder.areas()[0].x_m, -1000 + 88 * 50, 50);  // the largest
    const auto bytes = finder.save();
    RainFinder other(options, kExtent, kPlacement, {});
    other.restore(bytes);
    EXPECT_EQ(other.areas(), finder.areas());
    other.update(plane.view(), 10, 5, 5);
    finder.update(plane.view(), 10, 5, 5);
    EXPECT_EQ(other.areas(), finder.areas());
    EXPECT_EQ(other.save(), finder.save());
    for (std::size_t cut = 0; cut < bytes.size(); cut += 3) {
        expect_error(ErrorCode::io, "", [&] { other.restore(std::span(bytes).first(cut)); });
    }
    BitPlane small({10, 10, 10});
    expect_error(ErrorCode::usage, "expected 100", [&] { finder.update(small.view(), 10, 0, 0); });
    expect_error(ErrorCode::usage, "elapsed", [&] { finder.update(plane.view(), -1, 0, 0); });
    expect_error(ErrorCode::usage, "keeps", [&] {
        RainFinderOptions bad = options;
        bad.keep_water_m = bad.start_water_m * 2;
        check(bad);
    });
}

// A square of n x n columns has the variance of the full square, n^2 / 12, not that of the columns' centres.
// A threshold that is 0 in units of cells would let patches grow over dry columns for ever.
TEST(RainFinder, DryColumnsAreInNoPatch) {
    RainFinderOptions options = quick();
    options.keep_water_m = options.start_water_m = std::numeric_limits<double>::denorm_min();
    options.min_area_m2 = 0;
    BitPlane plane(kExtent);
    plane.set(10, 12, 3, true);
    const auto patches = find_patches(plane.view(), kPlacement, kPeriodic, options);
    ASSERT_EQ(patches.size(), 1u);
    EXPECT_DOUBLE_EQ(patches[0].area_m2, 50 * 50);
}

TEST(RainFinder, ColumnsAreSquares) {
    BitPlane plane(kExtent);
    for (int j = 20; j < 24; ++j) {
        for (int i = 30; i < 34; ++i) {
            for (int k = 0; k < 8; ++k) plane.set(i, j, k, true);
        }
    }
    const auto patches = find_patches(plane.view(), kPlacement, {}, quick());
    ASSERT_EQ(patches.size(), 1u);
    EXPECT_DOUBLE_EQ(patches[0].xx_m2, 200.0 * 200 / 12);
    EXPECT_DOUBLE_EQ(patches[0].yy_m2, 200.0 * 200 / 12);
    EXPECT_DOUBLE_EQ(patches[0].xy_m2, 0);
    EXPECT_DOUBLE_EQ(patches[0].area_m2, 200 * 200);
    EXPECT_DOUBLE_EQ(patches[0].water_m, 400);
    EXPECT_DOUBLE_EQ(patches[0].x_m, -1000 + 32 * 50);
}

// Listed from one intensity, until another: a patch whose rain lies between them stays only if it was listed.
TEST(RainFinder, ListingHasTwoThresholds) {
    RainFinderOptions options = quick();
    options.report_from_mm_per_h = 7;   // 350 m of water
    options.report_until_mm_per_h = 5;  // 250 m
    BitPlane middle(kExtent), strong(kExtent), weak(kExtent);
    fill(middle, 50, 40, 15, 10, 0, 6);
    fill(strong, 50, 40, 15, 10, 0, 8);
    fill(weak, 50, 40, 15, 10, 0, 4);
    RainFinder finder(options, kExtent, kPlacement, {});
    const auto listed_after = [&](const BitPlane& plane) {
        finder.update(plane.view(), 10, 0, 0);
        return finder.areas().size();
    };
    EXPECT_EQ(listed_after(middle), 0u);
    EXPECT_EQ(listed_after(strong), 1u);
    EXPECT_EQ(listed_after(middle), 1u);
    EXPECT_EQ(listed_after(weak), 0u);
    EXPECT_EQ(listed_after(middle), 0u);
}

// Two neighbours drift by nearly half their distance: each goes on as the nearest patch, whatever the order.
TEST(RainFinder, ClosestPairsFirst) {
    for (double shift : {-7.0, 7.0}) {
        BitPlane before(kExtent), after(kExtent);
        fill(before, 40, 40, 9, 9, 0, 8);
        fill(before, 60, 40, 9.5, 9, 0, 8);
        fill(after, 40 + shift, 40, 9.5, 9, 0, 8);
        fill(after, 60 + shift, 40, 9, 9, 0, 8);
        RainFinder finder(quick(), kExtent, kPlacement, {});
        finder.update(before.view(), 10, 0, 0);
        const auto old = finder.areas();
        finder.update(after.view(), 10, 0, 0);
        const auto now = finder.areas();
        ASSERT_EQ(old.size(), 2u);
        ASSERT_EQ(now.size(), 2u);
        for (int a = 0; a < 2; ++a) {
            EXPECT_EQ(now[std::size_t(a)].id, old[std::size_t(a)].id);
            EXPECT_NEAR(now[std::size_t(a)].x_m - old[std::size_t(a)].x_m, shift * 50, 25);
        }
    }
}

// All columns wet: one area, no hang, also with periodic sides.
TEST(RainFinder, WholeWorld) {
    BitPlane plane(kExtent);
    fill(plane, 50, 40, 1000, 1000, 0, 8);
    for (const Boundaries& b : {Boundaries{}, kPeriodic}) {
        RainFinder finder(quick(), kExtent, kPlacement, b);
        finder.update(plane.view(), 10, 0, 0);
        ASSERT_EQ(finder.areas().size(), 1u);
    }
}

}  // namespace
}  // namespace nephos
