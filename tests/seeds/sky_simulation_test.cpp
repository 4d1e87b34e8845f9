// SPDX-License-Identifier: Apache-2.0
#include "seeds/sky_simulation.h"

#include <cmath>
#include <map>
#include <set>

#include "seeds/climate.h"
#include "tests/seeds/fixtures.h"

namespace nephos {
namespace {

using test::constant_wind;
using test::small_sky;

bool reaches_inside(const SkySimulation& sky, const SkyCloud& cloud) {
    const Vec3 p = sky.position_m(cloud);
    const Cloud& c = sky.shape(cloud);
    const WorldRectangle& w = sky.options().world;
    return p.x + c.high_m.x > w.min_x_m && p.x + c.low_m.x < w.max_x_m && p.y + c.high_m.y > w.min_y_m &&
           p.y + c.low_m.y < w.max_y_m;
}

std::map<std::uint32_t, SkyCloud> by_serial(const SkySimulation& sky) {
    std::map<std::uint32_t, SkyCloud> result;
    for (const SkyCloud& c : sky.clouds()) result[c.serial] = c;
    return result;
}

std::uint64_t fingerprint(const SkySimulation& sky) {
    test::Fingerprint f;
    f.add(sky.steps());
    for (const SkyCloud& c : sky.clouds()) {
        f.add(std::uint64_t(c.serial) << 32 | c.shape);
        f.add(std::uint64_t(c.place.x));
        f.add(std::uint64_t(c.place.y));
        f.add(c.base_m);
        f.add(c.phase);
        f.add(std::uint64_t(c.dissolving));
    }
    return f.value();
}

// T: the sky nearest to the initial state, its clouds scattered over the world.
TEST(SkySimulation, StartsFromTheNearestSky) {
    SkyOptions options = small_sky();
    options.skies[1].clouds = 1000;
    options.schedule = {{0, 0.6}};
    const SkySimulation sky(options);
    ASSERT_EQ(sky.clouds().size(), 1000u);
    const WorldRectangle& w = options.world;
    int west = 0, south = 0;
    for (const SkyCloud& c : sky.clouds()) {
        EXPECT_EQ(c.sky, 1u);
        EXPECT_EQ(c.phase, 1);
        const Sphere s = sky.sphere(c);
        EXPECT_TRUE(s.centre_m.x >= w.min_x_m && s.centre_m.x <= w.max_x_m);
        EXPECT_TRUE(s.centre_m.y >= w.min_y_m && s.centre_m.y <= w.max_y_m);
        west += s.centre_m.x < (w.min_x_m + w.max_x_m) / 2;
        south += s.centre_m.y < (w.min_y_m + w.max_y_m) / 2;
    }
    EXPECT_NEAR(west, 500, 4 * std::sqrt(250.0));
    EXPECT_NEAR(south, 500, 4 * std::sqrt(250.0));
}

// Whatever the wind's direction: clouds leave only when wholly outside downwind, each is replaced by one that
// comes from outside upwind, the number stays, and the world stays evenly filled.
TEST(SkySimulation, CrossesTheWorldInAnyDirection) {
    for (int direction = 0; direction < 16; ++direction) {
        const double angle = direction * M_PI / 8;
        SkyOptions options = small_sky();
        const double east = direction % 4 == 0 ? std::round(std::cos(angle)) * 25 : 25 * std::cos(angle);
        const double north = direction % 4 == 0 ? std::round(std::sin(angle)) * 25 : 25 * std::sin(angle);
        options.wind = constant_wind(east, north);
        SkySimulation sky(options);
        const WorldRectangle& w = options.world;
        const Vec3 middle{(w.min_x_m + w.max_x_m) / 2, (w.min_y_m + w.max_y_m) / 2, 0};
        std::size_t entered = 0;
        double west = 0, south = 0, samples = 0;
        for (int step = 0; step < 200; ++step) {
            const auto before = by_serial(sky);
            sky.step();
            ASSERT_EQ(sky.count(), 40u) << direction;
            const auto after = by_serial(sky);
            for (const auto& [serial, cloud] : before) {
                if (after.contains(serial)) continue;
                SkyCloud gone = cloud;
                gone.place.x += std::llround(east * 10 * 0x1p32);
                gone.place.y += std::llround(north * 10 * 0x1p32);
                EXPECT_FALSE(reaches_inside(sky, gone)) << "a visible cloud vanished";
            }
            for (const auto& [serial, cloud] : after) {
                if (before.contains(serial)) continue;
                ++entered;
                EXPECT_FALSE(reaches_inside(sky, cloud)) << "a cloud popped up inside";
                EXPECT_EQ(cloud.phase, 1);
                const Vec3 p = sky.position_m(cloud);
                const Cloud& c = sky.shape(cloud);
                const bool from_west = p.x + c.high_m.x <= w.min_x_m,
                           from_east = p.x + c.low_m.x >= w.max_x_m;
                const bool from_south = p.y + c.high_m.y <= w.min_y_m,
                           from_north = p.y + c.low_m.y >= w.max_y_m;
                EXPECT_TRUE((from_west && east > 0) || (from_east && east < 0) || (from_south && north > 0) ||
                            (from_north && north < 0))
                    << direction;
            }
            for (const SkyCloud& c : sky.clouds()) {
                const Vec3 p = sky.position_m(c);
                west += p.x < middle.x;
                south += p.y < middle.y;
                samples += 1;
            }
        }
        EXPECT_GT(entered, 150u) << direction;  // 50 km of wind over a world of 10 x 6 km
        EXPECT_NEAR(west / samples, 0.5, 0.1) << direction;
        EXPECT_NEAR(south / samples, 0.5, 0.1) << direction;
    }
}

// A steady wind moves a cloud by exactly the wind's way, however many steps it takes.
TEST(SkySimulation, NothingDrifts) {
    SkyOptions options = small_sky();
    options.world = {0, 0, 1e6, 1e6};
    options.wind = constant_wind(0.1, -0.3);
    SkySimulation sky(options);
    const auto before = by_serial(sky);
    for (int step = 0; step < 1000; ++step) sky.step();
    const std::int64_t dx = 1000 * std::llround(0.1 * 10 * 0x1p32),
                       dy = 1000 * std::llround(-0.3 * 10 * 0x1p32);
    EXPECT_EQ(sky.carried().x, dx);
    EXPECT_EQ(sky.carried().y, dy);
    for (const auto& [serial, cloud] : by_serial(sky)) {
        if (!before.contains(serial)) continue;
        EXPECT_EQ(cloud.place.x - before.at(serial).place.x, dx);
        EXPECT_EQ(cloud.place.y - before.at(serial).place.y, dy);
    }
}

// Entering clouds follow P_Si within 4 sigma at several states, also in unequal sky lists.
TEST(SkySimulation, EnteringCloudsFollowTheShares) {
    for (double state : {0.25, 0.5, 0.8}) {
        SkyOptions options = small_sky();
        options.skies = {{"a", 0, 100, {{0, 3}}}, {"b", 0.4, 100, {{1, 3}}}, {"c", 1, 100, {{0, 3}, {1, 3}}}};
        options.schedule = {{0, state}};
        options.wind = constant_wind(40, 30);
        SkySimulation sky(options);
        const SkyShares shares = shares_at(options.skies, state);
        std::set<std::uint32_t> seen;
        for (const SkyCloud& c : sky.clouds()) seen.insert(c.serial);
        double entered = 0, upper = 0;
        while (entered < 5000) {
            sky.step();
            for (const SkyCloud& c : sky.clouds()) {
                if (!seen.insert(c.serial).second) continue;
                ASSERT_TRUE(c.sky == shares.lower || c.sky == shares.upper);
                entered += 1;
                upper += c.sky == shares.upper;
            }
        }
        const double p = shares.upper_fraction;
        EXPECT_NEAR(upper, entered * p, 4 * std::sqrt(entered * p * (1 - p))) << state;
    }
}

// The number follows the interpolated one in every step, up and down; what appears or goes inside the world
// does so from phase 0 and to phase 0, by at most one step's share at a time.
TEST(SkySimulation, NumberFollowsWithoutPopping) {
    SkyOptions options = small_sky();
    options.schedule = {{0, 0}, {600, 1}, {1500, 1}, {1600, 0.2}, {4000, 0.2}};
    options.wind = {{{0, {{0, {15, 5}}}}, {1500, {{0, {-10, 12}}}}}};
    SkySimulation sky(options);
    bool dissolved = false, formed = false;
    for (int step = 0; step < 400; ++step) {
        const auto before = by_serial(sky);
        sky.step();
        ASSERT_EQ(int(sky.count()), clouds_at(options.skies, state_at(options.schedule, sky.time_s())));
        const auto after = by_serial(sky);
        for (const auto& [serial, cloud] : after) {
            const double was = before.contains(serial) ? before.at(serial).phase : 0;
            if (!before.contains(serial) && !reaches_inside(sky, cloud)) continue;
            EXPECT_LE(std::abs(cloud.phase - was), 10.0 / 300 + 1e-9);
            dissolved = dissolved || cloud.dissolving;
            formed = formed || (cloud.phase > 0 && cloud.phase < 1 && !cloud.dissolving);
        }
        for (const auto& [serial, cloud] : before) {
            if (after.contains(serial)) continue;
            SkyCloud gone = cloud;
            const Velocity v = wind_at(options.wind, 0, sky.time_s() - 10);
            gone.place.x += std::llround(v.east_m_per_s * 10 * 0x1p32);
            gone.place.y += std::llround(v.north_m_per_s * 10 * 0x1p32);
            EXPECT_TRUE(gone.phase <= 10.0 / 300 + 1e-9 || !reaches_inside(sky, gone))
                << "phase " << gone.phase;
        }
    }
    EXPECT_TRUE(dissolved);
    EXPECT_TRUE(formed);
    for (const SkyCloud& c : sky.clouds()) EXPECT_FALSE(c.dissolving);  // all gone by now
    EXPECT_EQ(sky.clouds().size(), sky.count());
}

// The change comes over the horizon: without a change of number, clouds that are there stay what they are.
TEST(SkySimulation, CloudsThatAreThereStay) {
    SkyOptions options = small_sky();
    options.skies[1].clouds = 40;
    options.schedule = straight_schedule(0, 1, 100);
    SkySimulation calm(options);
    for (int step = 0; step < 100; ++step) calm.step();
    for (const SkyCloud& c : calm.clouds()) EXPECT_EQ(c.sky, 0u);
    options.wind = constant_wind(25, 0);
    SkySimulation windy(options);
    for (int step = 0; step < 100; ++step) windy.step();  // 25 km
    for (const SkyCloud& c : windy.clouds()) EXPECT_EQ(c.sky, 1u);
}

TEST(SkySimulation, EdgesMayBeSoft) {
    SkyOptions options = small_sky();
    options.cross_edges_whole = false;
    options.wind = constant_wind(-20, 0);
    SkySimulation sky(options);
    bool outside_dissolving = false;
    for (int step = 0; step < 300; ++step) {
        const auto before = by_serial(sky);
        sky.step();
        ASSERT_EQ(sky.count(), 40u);
        const auto after = by_serial(sky);
        for (const auto& [serial, cloud] : after) {
            if (!before.contains(serial)) {
                EXPECT_EQ(cloud.phase, 0);
            }
            if (cloud.dissolving) {
                EXPECT_FALSE(reaches_inside(sky, cloud));
                outside_dissolving = true;
            }
        }
        for (const auto& [serial, cloud] : before) {
            if (!after.contains(serial)) {
                EXPECT_LE(cloud.phase, 10.0 / 300 + 1e-9);
            }
        }
    }
    EXPECT_TRUE(outside_dissolving);
    EXPECT_LT(sky.clouds().size(), 100u);
}

// Wind that crosses the world in one step: defined, no hang, every cloud is replaced in every step.
TEST(SkySimulation, WindCrossesTheWorldInOneStep) {
    SkyOptions options = small_sky();
    options.wind = constant_wind(3000, -2000);
    for (bool whole : {true, false}) {
        options.cross_edges_whole = whole;
        SkySimulation sky(options);
        for (int step = 0; step < 50; ++step) {
            sky.step();
            ASSERT_EQ(sky.count(), 40u);
            ASSERT_LT(sky.clouds().size(), 5000u);
        }
    }
    for (double speed : {6e7, 1e30, -6e7, double(NAN)}) {
        options.wind = constant_wind(0, speed);
        SkySimulation sky(options);
        test::expect_error(ErrorCode::usage, "wind", [&] { sky.step(); });
    }
    // The fastest that is possible, in a world at the end of the numbers, turning about: no overflow.
    options.world = {9e7, 9e7, 9e7 + 6000, 9e7 + 6000};
    options.wind = {{{0, {{0, {4.9e7, 4.9e7}}}}, {50, {{0, {-4.9e7, -4.9e7}}}}}};
    for (bool whole : {true, false}) {
        options.cross_edges_whole = whole;
        SkySimulation sky(options);
        for (int step = 0; step < 20; ++step) sky.step();
        EXPECT_EQ(sky.count(), 40u);
    }
}

// However fast the wind is, a cloud that enters straight is seen before it leaves.
TEST(SkySimulation, FastWindCarriesNoCloudPastTheWorld) {
    SkyOptions options = small_sky();
    options.wind = constant_wind(3000, 0);  // three worlds a step
    SkySimulation sky(options);
    std::set<std::uint32_t> seen;
    std::size_t left = 0;
    for (int step = 0; step < 50; ++step) {
        const auto before = by_serial(sky);
        for (const auto& [serial, cloud] : before) {
            if (reaches_inside(sky, cloud)) seen.insert(serial);
        }
        sky.step();
        const auto after = by_serial(sky);
        for (const auto& [serial, cloud] : before) {
            if (after.contains(serial)) continue;
            ++left;
            EXPECT_TRUE(seen.contains(serial)) << serial;
        }
    }
    EXPECT_GE(left, 800u);
}

// Every cloud of a layer moves with the wind at its own centre's height.
TEST(SkySimulation, WindDependsOnHeight) {
    SkyOptions options = small_sky();
    options.base_height_m = {0, 2000};
    options.models[0].seeds[0].position_m.z = 200;
    options.wind = {{{0, {{0, {0, 0}}, {2000, {20, 0}}}}}};
    SkySimulation sky(options);
    const auto before = by_serial(sky);
    sky.step();
    std::size_t seen = 0;
    for (const auto& [serial, c] : by_serial(sky)) {
        if (!before.contains(serial)) continue;
        EXPECT_NEAR(double(c.place.x - before.at(serial).place.x) * 0x1p-32,
                    std::min(c.base_m + 200, 2000.0) / 10, 1e-6);
        ++seen;
    }
    EXPECT_GT(seen, 30u);
}

// Skies that share a model share its clouds; a clear sky without models leaves entering to the other one.
TEST(SkySimulation, SharedModelsAndClearSky) {
    SkyOptions options = small_sky();
    options.skies = {{"clear", 0, 0, {}}, {"some", 0.5, 20, {{0, 4}}}, {"many", 1, 60, {{0, 2}, {1, 5}}}};
    options.schedule = {{0, 0.25}};
    options.wind = constant_wind(30, 0);
    SkySimulation sky(options);
    EXPECT_EQ(sky.shapes().size(), 9u);
    EXPECT_EQ(sky.count(), 0u);
    for (int step = 0; step < 100; ++step) sky.step();
    EXPECT_EQ(sky.count(), 10u);
    for (const SkyCloud& c : sky.clouds()) EXPECT_EQ(c.sky, 1u);
}

TEST(SkySimulation, SavedStateContinuesExactly) {
    SkyOptions options = small_sky();
    options.schedule = {{0, 0}, {500, 1}, {1500, 0.1}};
    options.wind = {{{0, {{0, {12.3, 4.5}}}}, {1000, {{0, {-7, 11}}}}}};
    SkySimulation straight(options), broken(options);
    for (int step = 0; step < 77; ++step) {
        straight.step();
        broken.step();
    }
    const auto bytes = broken.save();
    SkySimulation resumed(options);
    resumed.restore(bytes);
    EXPECT_EQ(fingerprint(resumed), fingerprint(straight));
    for (int step = 0; step < 150; ++step) {
        straight.step();
        resumed.step();
    }
    EXPECT_EQ(fingerprint(resumed), fingerprint(straight));
    EXPECT_EQ(resumed.save(), straight.save());
    EXPECT_EQ(resumed.carried(), straight.carried());
}

TEST(SkySimulation, RefusesForeignBytes) {
    SkySimulation sky(small_sky());
    const auto good = sky.save();
    const auto before = fingerprint(sky);
    for (std::size_t cut = 0; cut < good.size(); cut += 7) {
        test::expect_error(ErrorCode::io, "", [&] { sky.restore(std::span(good).first(cut)); });
    }
    auto longer = good;
    longer.push_back(std::byte{0});
    test::expect_error(ErrorCode::io, "more bytes", [&] { sky.restore(longer); });
    auto wrong = good;
    wrong[0] = std::byte{0xff};
    test::expect_error(ErrorCode::io, "not the state", [&] { sky.restore(wrong); });
    // Any single damaged byte is either refused or gives a state that can be stepped.
    for (std::size_t i = 8; i < good.size(); i += 5) {
        auto damaged = good;
        damaged[i] ^= std::byte{0xa5};
        SkySimulation victim(small_sky());
        try {
            victim.restore(damaged);
            victim.step();
        } catch (const Error& error) {
            EXPECT_TRUE(error.code() == ErrorCode::io || error.code() == ErrorCode::usage);
        }
    }
    EXPECT_EQ(fingerprint(sky), before);
}

// Same options, same sky; layers and seeds differ. The fingerprint guards the stream of draws.
TEST(SkySimulation, DeterministicAndSeparate) {
    SkyOptions options = small_sky();
    options.schedule = {{0, 0}, {1000, 1}};
    options.wind = {{{0, {{0, {12.3, 4.5}}}}, {2500, {{0, {-7, 11}}}}}};
    const auto run = [](const SkyOptions& o) {
        SkySimulation sky(o);
        for (int step = 0; step < 300; ++step) sky.step();
        return fingerprint(sky);
    };
    const auto first = run(options);
    EXPECT_EQ(first, run(options));
    EXPECT_EQ(first, 0xe3de50555ff0e671ull);
    SkyOptions other = options;
    other.layer = 1;
    EXPECT_NE(first, run(other));
    other = options;
    other.seed = 100;
    EXPECT_NE(first, run(other));
}

// In a world that repeats no cloud leaves and none is made: each is carried, and re-enters where the period ends.
TEST(SkySimulation, CloudsReEnterAPeriodicWorld) {
    SkyOptions options = small_sky();
    options.periodic = true;
    options.wind = constant_wind(-31, 17);
    SkySimulation sky(options);
    const WorldRectangle& w = options.world;
    const std::map<std::uint32_t, SkyCloud> before = by_serial(sky);
    constexpr int kSteps = 400;  // the wind crosses the world more than ten times
    for (int step = 0; step < kSteps; ++step) {
        sky.step();
        for (const SkyCloud& c : sky.clouds()) {
            const Vec3 centre = sky.sphere(c).centre_m;
            ASSERT_TRUE(centre.x >= w.min_x_m - 1e-3 && centre.x <= w.max_x_m + 1e-3) << centre.x;
            ASSERT_TRUE(centre.y >= w.min_y_m - 1e-3 && centre.y <= w.max_y_m + 1e-3) << centre.y;
        }
    }
    ASSERT_EQ(sky.clouds().size(), before.size());
    const auto periods = [](double difference_m, double period_m) { return std::remainder(difference_m, period_m); };
    for (const SkyCloud& c : sky.clouds()) {
        const Vec3 from = sky.position_m(before.at(c.serial)), to = sky.position_m(c);
        EXPECT_NEAR(periods(to.x - from.x + 31 * 10.0 * kSteps, w.max_x_m - w.min_x_m), 0, 1e-3);
        EXPECT_NEAR(periods(to.y - from.y - 17 * 10.0 * kSteps, w.max_y_m - w.min_y_m), 0, 1e-3);
    }
}

// A change of state makes clouds inside, and they form, also where they would enter over a horizon; the saved state goes on
// with the same bits.
TEST(SkySimulation, ChangesStateInAPeriodicWorld) {
    for (const Entering entering : {Entering::anywhere, Entering::horizon}) {
        SkyOptions options = small_sky();
        options.periodic = true;
        options.entering = entering;
        options.wind = constant_wind(12, -3);
        options.schedule = {{0, 0}, {600, 1}};
        SkySimulation sky(options), restored(options);
        for (int step = 0; step < 50; ++step) sky.step();
        restored.restore(sky.save());
        for (int step = 0; step < 70; ++step) {
            sky.step();
            restored.step();
        }
        EXPECT_EQ(fingerprint(sky), fingerprint(restored));
        EXPECT_EQ(sky.count(), 80u);
    }
}

}  // namespace
}  // namespace nephos
