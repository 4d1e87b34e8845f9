// SPDX-License-Identifier: Apache-2.0

// Wind, advection and the carried parcels of air: closed forms and the naive twin.

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "automaton/advection.h"
#include "automaton/air_parcels.h"
#include "automaton/automaton.h"
#include "core/error.h"
#include "tests/reference/reference_automaton.h"

namespace nephos {
namespace {

TEST(Wind, IsPiecewiseLinearInHeightAndTime) {
    const Wind wind{{{0, {{100, {10, 0}}, {300, {30, -4}}}}, {60, {{0, {0, 0}}}}}};
    EXPECT_EQ(wind_at(wind, 200, 0), (Velocity{20, -2}));
    EXPECT_EQ(wind_at(wind, 0, -5), (Velocity{10, 0}));
    EXPECT_EQ(wind_at(wind, 999, 0), (Velocity{30, -4}));
    EXPECT_EQ(wind_at(wind, 300, 30), (Velocity{15, -2}));
    EXPECT_EQ(wind_at(wind, 300, 1e9), (Velocity{0, 0}));
    EXPECT_EQ(wind_at({}, 300, 0), (Velocity{0, 0}));
}

// What the editor records: the profile of a moment, written down as a keyframe there, is the wind that was.
TEST(Wind, IsTheSameWithItsProfileAsAKeyframe) {
    std::mt19937_64 random(7);
    const auto number = [&](double low, double high) {
        return std::uniform_real_distribution<double>(low, high)(random);
    };
    const auto levels = [&] {
        std::vector<WindLevel> out;
        double height = number(-100, 500);
        for (auto n = 1 + random() % 4; n > 0; --n, height += number(0.1, 900))
            out.push_back({height, {number(-30, 30), number(-30, 30)}});
        return out;
    };
    for (int n = 0; n < 3000; ++n) {
        const Wind wind{
            {{number(0, 10), levels()}, {number(20, 99), levels()}, {number(100, 999), levels()}}};
        const WindKeyframe& first = wind.keyframes[0];
        const WindKeyframe& second = wind.keyframes[1];
        const double now = n % 7 == 0 ? second.time_s : number(first.time_s, second.time_s);
        const std::vector<WindLevel> profile = profile_at(wind, now);
        const Wind recorded{{first, {now, profile}, {now + 1, levels()}}};
        for (int k = 0; k < 40; ++k) {
            const double height =
                k < int(profile.size()) ? profile[std::size_t(k)].height_m : number(-500, 4000);
            const Velocity wanted = wind_at(wind, height, now);
            ASSERT_EQ(wanted, wind_at(recorded, height, now)) << n << ": " << height << " m, " << now << " s";
            const Velocity from = wind_at({{first}}, height, 0), to = wind_at({{second}}, height, 0);
            const double passed = (now - first.time_s) / (second.time_s - first.time_s);
            ASSERT_NEAR(wanted.east_m_per_s,
                        from.east_m_per_s + (to.east_m_per_s - from.east_m_per_s) * passed, 1e-9);
        }
    }
}

TEST(Wind, RefusesWhatNoLatticeCanHold) {
    EXPECT_THROW(displacement_of_step({1e15, 0}, 1, 1), Error);
    EXPECT_THROW(displacement_of_step({std::nan(""), 0}, 1, 1), Error);
    EXPECT_EQ(displacement_of_step({-0.25, 3}, 1, 1).whole_x(), -1);
}

// After n steps of a decimal speed the air has moved floor(n * speed) cells in exact arithmetic, towards east
// and towards west: 0.2 cells a step are 1 cell after 5 steps, -0.3 are -3 after 10.
TEST(Wind, DecimalSpeedsMoveByTheFloorOfTheExactProduct) {
    for (const int thousandths : {1, 7, 100, 200, 250, 300, 333, 500, 700, 999, 1000, 1100, 12345}) {
        for (const int sign : {1, -1}) {
            const std::int64_t speed = sign * thousandths;
            // 10 s and 10 m, 2 s and 50 m: the same cells a step by other roundings.
            const Displacement d = displacement_of_step({double(speed) / 1000, double(speed) / 40}, 10, 10);
            const Displacement e = displacement_of_step({double(speed) / 40, 0}, 2, 50);
            Displacement sum, other;
            for (std::int64_t n = 1; n <= 20000; ++n) {
                sum = {sum.x + d.x, sum.y + d.y};
                other.x += e.x;
                const std::int64_t exact = n * speed;
                ASSERT_EQ(sum.whole_x(), (exact - (exact % 1000 + 1000) % 1000) / 1000) << speed << " " << n;
                ASSERT_EQ(sum.whole_y(), (exact - (exact % 40 + 40) % 40) / 40) << speed << " " << n;
                ASSERT_EQ(other.whole_x(), sum.whole_x()) << speed << " " << n;
            }
        }
    }
    EXPECT_EQ(displacement_of_step({1e-17, -1e-17}, 10, 1), Displacement{}) << "calm";
}

// After n steps a layer has moved floor(n * speed) cells: 0.3 cells a step for 1000 steps is 300 cells.
TEST(Advection, NeverDrifts) {
    AutomatonOptions o{.extent = {400, 3, 1}};
    o.placement.cell_size_m = 1;
    o.time_step_s = 1;
    o.field.background = {0, 0, 0};
    o.wind.keyframes = {{0, {{0, {0.3, 0}}}}};
    Lattice start{BitPlane(o.extent), BitPlane(o.extent), BitPlane(o.extent)};
    start.cld.set(5, 1, 0, true);
    Automaton automaton(o, std::move(start));
    for (std::int64_t n = 1; n <= 1000; ++n) {
        automaton.step();
        ASSERT_TRUE(automaton.cld().get(5 + int(n * 3 / 10), 1, 0)) << "step " << n;
    }
}

// The same towards the west: -3 cells after 10 steps of -0.3.
TEST(Advection, NeverDriftsTowardsTheWest) {
    AutomatonOptions o{.extent = {400, 3, 1}};
    o.placement.cell_size_m = 1;
    o.time_step_s = 1;
    o.field.background = {0, 0, 0};
    o.wind.keyframes = {{0, {{0, {-0.3, 0}}}}};
    Lattice start{BitPlane(o.extent), BitPlane(o.extent), BitPlane(o.extent)};
    start.cld.set(395, 1, 0, true);
    Automaton automaton(o, std::move(start));
    for (std::int64_t n = 1; n <= 1000; ++n) {
        automaton.step();
        ASSERT_TRUE(automaton.cld().get(395 - int((n * 3 + 9) / 10), 1, 0)) << "step " << n;
    }
}

TEST(Advection, EqualsTheNaiveTwin) {
    std::mt19937 engine(3);
    const auto integer = [&](int low, int high) {
        return std::uniform_int_distribution<>(low, high)(engine);
    };
    for (int round = 0; round < 300; ++round) {
        const Extent e{integer(1, 200), integer(1, 12), 2};
        const Boundaries b{integer(0, 1) ? Boundary::open : Boundary::periodic,
                           integer(0, 1) ? Boundary::open : Boundary::periodic, Boundary::open};
        BitPlane plane(e);
        for (int j = 0; j < e.y; ++j) {
            for (int i = 0; i < e.x; ++i) plane.set(i, j, 1, integer(0, 1) == 1);
        }
        const int reach = integer(0, 1) ? 3 : 70000;
        const std::int64_t dx = integer(-reach, reach), dy = integer(-reach, reach);
        reference::Cells twin = reference::to_cells(plane.view(), plane.view(), plane.view());
        reference::advect_layer(twin, b, 1, dx, dy);
        std::vector<std::uint64_t> scratch;
        shift_layer(plane, 1, dx, dy, b, scratch);
        ASSERT_EQ(reference::to_cells(plane.view(), plane.view(), plane.view()), twin)
            << e.x << " x " << e.y << " by " << dx << ", " << dy;
        const auto words = plane.words();
        if (e.x % 64 != 0) {
            ASSERT_EQ(words.back() >> (e.x % 64), 0u) << "padding is not 0";
        }
    }
}

TEST(SinCos, AgreesWithTheLibrary) {
    for (double degrees = -725; degrees < 1000; degrees += 0.37) {
        const Rotation value = sin_cos_deg(degrees);
        EXPECT_NEAR(value.sin, std::sin(degrees * std::acos(-1.0) / 180),
                    4e-15 * (1 + std::abs(degrees) / 90));
        EXPECT_NEAR(value.cos, std::cos(degrees * std::acos(-1.0) / 180),
                    4e-15 * (1 + std::abs(degrees) / 90));
    }
    EXPECT_EQ(sin_cos_deg(90).cos, 0);
    EXPECT_EQ(sin_cos_deg(-180).cos, -1);
}

TEST(AirParcels, FadeInAndOut) {
    Ellipsoid e;
    e.birth_s = 100;
    e.life_s = 50;
    e.fade_in_s = 10;
    e.fade_out_s = 20;
    EXPECT_EQ(fade_weight(e, 99), 0);
    EXPECT_EQ(fade_weight(e, 105), 0.5);
    EXPECT_EQ(fade_weight(e, 120), 1);
    EXPECT_EQ(fade_weight(e, 140), 0.5);
    EXPECT_EQ(fade_weight(e, 150), 0);
    EXPECT_EQ(fade_weight(Ellipsoid{}, 1e12), 1);
}

AutomatonOptions carried_options(Velocity wind) {
    AutomatonOptions o{.extent = {100, 80, 10}};  // 5000 x 4000 m
    o.wind.keyframes = {{0, {{0, wind}}}};
    o.field.scatters = {{.count = 20,
                         .x_m = {0, 5000},
                         .y_m = {0, 4000},
                         .z_m = {250, 250},
                         .semi_axis_x_m = {300, 300},
                         .semi_axis_y_m = {300, 300},
                         .semi_axis_z_m = {200, 200},
                         .replace = true}};
    return o;
}

TEST(AirParcels, AreCarriedUnlessFixed) {
    AutomatonOptions o = carried_options({20, -5});
    o.field.scatters.clear();
    Ellipsoid e;
    e.centre_m = {100, 200, 300};
    o.field.ellipsoids = {e, e};
    o.field.ellipsoids[1].carried = false;
    Automaton automaton(o);
    for (int step = 0; step < 7; ++step) automaton.step();
    EXPECT_NEAR(automaton.ellipsoids()[0].ellipsoid.centre_m.x, 100 + 20 * 70, 1e-6);
    EXPECT_NEAR(automaton.ellipsoids()[0].ellipsoid.centre_m.y, 200 - 5 * 70, 1e-6);
    EXPECT_EQ(automaton.ellipsoids()[1].ellipsoid.centre_m, (Vec3{100, 200, 300}));
}

// Whatever the wind's direction, parcels that left come back on the upwind sides and their number stays.
TEST(AirParcels, AreReplacedUpwind) {
    for (int degrees = 0; degrees < 360; degrees += 30) {
        const Rotation direction = sin_cos_deg(degrees);
        const Velocity wind{40 * direction.cos, 40 * direction.sin};
        const AutomatonOptions o = carried_options(wind);
        AirParcels parcels(o);
        for (int step = 0; step < 400; ++step) {
            const auto before = parcels.active(o, step * o.time_step_s);
            parcels.advance(o, std::uint64_t(step));
            const auto after = parcels.active(o, (step + 1) * o.time_step_s);
            ASSERT_EQ(after.size(), 20u);
            for (std::size_t i = 0; i < after.size(); ++i) {
                const Vec3 &from = before[i].ellipsoid.centre_m, &to = after[i].ellipsoid.centre_m;
                const double moved =
                    (to.x - from.x) * wind.east_m_per_s + (to.y - from.y) * wind.north_m_per_s;
                if (moved >= 0) continue;  // carried on
                const bool touches_west = std::abs(to.x + 300) < 1e-6,
                           touches_east = std::abs(to.x - 5300) < 1e-6;
                const bool touches_south = std::abs(to.y + 300) < 1e-6,
                           touches_north = std::abs(to.y - 4300) < 1e-6;
                EXPECT_TRUE(
                    (touches_west && wind.east_m_per_s > 0) || (touches_east && wind.east_m_per_s < 0) ||
                    (touches_south && wind.north_m_per_s > 0) || (touches_north && wind.north_m_per_s < 0))
                    << degrees << " degrees: " << to.x << ", " << to.y;
                EXPECT_EQ(after[i].weight, 1);
            }
        }
    }
}

AutomatonOptions plume_options() {
    AutomatonOptions o{.extent = {100, 80, 30}};
    o.boundaries = {Boundary::periodic, Boundary::periodic, Boundary::open};
    o.wind.keyframes = {{0, {{0, {4, 1}}, {1000, {12, -3}}}}};
    o.field.scatters = {
        {.count = 3,
         .x_m = {0, 5000},
         .y_m = {0, 4000},
         .z_m = {0, 0},
         .semi_axis_x_m = {400, 600},
         .semi_axis_y_m = {300, 300},
         .semi_axis_z_m = {200, 250},
         .yaw_deg = {0, 180},
         .life_s = {1000, 1000},
         .fade_in_s = 20,
         .fade_out_s = 40,
         .replace = true,
         .thermals = {.interval_s = 100, .life_s = 600, .rise_m = {500, 700}, .spread = -0.2}}};
    return o;
}

// Thermals leave the base one after the other, rise by u (2 - u), taper, and lean with the shear; the last dies with
// the plume.
TEST(AirParcels, ThermalsRiseFromTheirBase) {
    const AutomatonOptions o = plume_options();
    const AirParcels parcels(o);
    const auto at = [&](double time_s) { return parcels.active(o, time_s); };
    // Of each plume the base and as many thermals as have been released: at 0, 100 .. 400 s.
    for (const auto& [time_s, thermals] :
         {std::pair{5.0, 1u}, {105.0, 2u}, {305.0, 4u}, {590.0, 5u}, {605.0, 4u}, {995.0, 1u}, {1005.0, 0u}})
        EXPECT_EQ(at(time_s).size(), 3 * thermals + (time_s < 1000 ? 3 : 0)) << time_s;
    const auto now = at(305), later = at(310);
    const auto per_plume = now.size() / 3;
    for (std::size_t n = 0; n < now.size(); ++n) {
        const Ellipsoid &e = now[n].ellipsoid, &base = now[n - n % per_plume].ellipsoid;
        const double age = 305 - e.birth_s;
        if (n % per_plume == 0) {
            EXPECT_EQ(e.centre_m.z, 0);
            continue;
        }
        EXPECT_EQ(e.birth_s, 100.0 * double(n % per_plume - 1));
        EXPECT_EQ(now[n].weight, std::min(age / 20, 1.0));
        const double u = age / 600, most = 700 * u * (2 - u), least = 0.6 * 500 * u * (2 - u);
        EXPECT_GE(e.centre_m.z, least);
        EXPECT_LE(e.centre_m.z, most);
        EXPECT_GE(later[n].ellipsoid.centre_m.z, e.centre_m.z);
        EXPECT_LT(later[n].ellipsoid.semi_axes_m.x, e.semi_axes_m.x);
        EXPECT_LE(e.semi_axes_m.x, 0.6 * base.semi_axes_m.x);
        EXPECT_NEAR(e.semi_axes_m.x / e.semi_axes_m.z, 0.6 * base.semi_axes_m.x / base.semi_axes_m.z, 1e-9);
        // The wind is linear in height, its value half way up that at the base and 0.004 m/s a metre more.
        const double shear = 0.5 * e.centre_m.z * 0.008 * age, farthest = 0.5 * std::hypot(600, 300);
        EXPECT_NEAR(e.centre_m.x - base.centre_m.x, shear, farthest);
        EXPECT_NEAR(e.centre_m.y - base.centre_m.y, -0.5 * shear, farthest);
    }
}

// The same bits again, also from a checkpoint amid the life of plumes and their successors.
TEST(AirParcels, ThermalsAreReproduced) {
    const AutomatonOptions o = plume_options();
    Automaton whole(o), first(o);
    for (int step = 0; step < 130; ++step) {
        whole.step();
        if (step < 77) first.step();
    }
    Automaton resumed(o);
    resumed.restore(first.save());
    while (resumed.steps() < whole.steps()) resumed.step();
    EXPECT_EQ(resumed.hash(), whole.hash());
    EXPECT_EQ(whole.steps(), 130u);
    EXPECT_EQ(ellipsoid_count(o), 3u * 8u * 9u);  // bases and seven thermals, with their images
}

TEST(Options, TheNumberOfEllipsoidsIsLimited) {
    AutomatonOptions o = carried_options({1, 1});
    EXPECT_EQ(ellipsoid_count(o), 20u);
    o.boundaries = {Boundary::periodic, Boundary::periodic, Boundary::periodic};
    EXPECT_EQ(ellipsoid_count(o), 20u * 27u);
    o.field.scatters[0].count = 100000;
    EXPECT_THROW(check(o), Error);
}

TEST(Automaton, RefusesMeaninglessExternalEllipsoids) {
    Automaton automaton(carried_options({1, 1}));
    Ellipsoid flat;
    flat.semi_axes_m.z = 0;
    EXPECT_THROW(automaton.set_external_ellipsoids({{flat, 1}}), Error);
    EXPECT_THROW(automaton.set_external_ellipsoids({{Ellipsoid{}, 1.5}}), Error);
    automaton.set_external_ellipsoids({{Ellipsoid{}, 0.5}});
    automaton.step();
}

TEST(Options, EachProblemIsNamed) {
    const auto reason = [](auto change) -> std::string {
        AutomatonOptions o = carried_options({1, 1});
        change(o);
        try {
            check(o);
        } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::usage);
            return error.what();
        }
        return "accepted";
    };
    EXPECT_EQ(reason([](auto&) {}), "accepted");
    const auto thermals = [&](const char* expected, auto change) {
        const std::string text = reason([&](auto& o) {
            o.field.scatters[0].thermals.interval_s = 100;
            change(o.field.scatters[0].thermals);
        });
        EXPECT_NE(text.find(expected), std::string::npos) << text;
    };
    thermals("accepted", [](auto&) {});
    thermals("scatters[0].thermals.life_s", [](auto& t) { t.life_s = 0; });
    thermals("thermals.rise_m", [](auto& t) { t.rise_m = {-5, 5}; });
    thermals("thermals.variety = 0.95: expected 0 to 0.9", [](auto& t) { t.variety = 0.95; });
    thermals("thermals at once", [](auto& t) { t.interval_s = 0.1; });
    EXPECT_NE(reason([](auto& o) { o.extent.y = 0; }).find("1..65536"), std::string::npos);
    EXPECT_NE(reason([](auto& o) { o.placement.cell_size_m = 0; }).find("cell_size_m"), std::string::npos);
    EXPECT_NE(reason([](auto& o) { o.time_step_s = std::nan(""); }).find("time_step_s"), std::string::npos);
    EXPECT_NE(reason([](auto& o) { o.field.background.ext = 1.5; }).find("field.background.ext"),
              std::string::npos);
    EXPECT_NE(reason([](auto& o) { o.field.scatters[0].semi_axis_y_m.min = -1; }).find("scatters[0]"),
              std::string::npos);
    EXPECT_NE(reason([](auto& o) {
                  o.field.scatters[0].x_m = {2, 1};
              }).find("min <= max"),
              std::string::npos);
    EXPECT_NE(reason([](auto& o) {
                  o.wind.keyframes[0].levels.push_back({0, {}});
              }).find("rising heights"),
              std::string::npos);
    EXPECT_NE(reason([](auto& o) {
                  o.wind.keyframes.push_back({0, {{0, {}}}});
              }).find("rising times"),
              std::string::npos);
    EXPECT_NE(
        reason([](auto& o) { o.wind.keyframes[0].levels[0].velocity.east_m_per_s = 1e30; }).find("2^24"),
        std::string::npos);
}

// What is born at the end of a step lives in the next, also where times of steps are no binary fractions.
TEST(AirParcels, AreAliveAtAnyTimeWhenReplaced) {
    for (const double step_s : {0.1, 0.7, 7.3, 12.3}) {
        AutomatonOptions o = carried_options({3, 1});
        o.time_step_s = step_s;
        o.field.scatters[0].life_s = {4 * step_s, 4 * step_s};
        o.field.scatters[0].fade_in_s = o.field.scatters[0].fade_out_s = 0;
        AirParcels parcels(o);
        for (std::uint64_t step = 0; step < 2000; ++step) {
            ASSERT_EQ(parcels.active(o, double(step) * step_s).size(), 20u) << step_s << " s, step " << step;
            parcels.advance(o, step);
        }
    }
}

}  // namespace
}  // namespace nephos
