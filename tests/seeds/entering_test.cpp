// SPDX-License-Identifier: Apache-2.0
// Clouds that enter over the horizon alone (T, 3.4; Entering::horizon).

#include <cmath>
#include <map>
#include <set>

#include "seeds/sky_simulation.h"
#include "tests/seeds/fixtures.h"

namespace nephos {
namespace {

SkyOptions over_the_horizon(double east, double north) {
    SkyOptions options = test::small_sky();
    options.entering = Entering::horizon;
    options.wind = test::constant_wind(east, north);
    return options;
}

std::set<std::uint32_t> serials(const SkySimulation& sky) {
    std::set<std::uint32_t> result;
    for (const SkyCloud& c : sky.clouds()) result.insert(c.serial);
    return result;
}

bool touches_the_world(const SkySimulation& sky, const SkyCloud& cloud, double moved_x_m = 0, double moved_y_m = 0) {
    const Vec3 p = sky.position_m(cloud) + Vec3(moved_x_m, moved_y_m, 0);
    const Cloud& c = sky.shape(cloud);
    const WorldRectangle& w = sky.options().world;
    return p.x + c.high_m.x > w.min_x_m && p.x + c.low_m.x < w.max_x_m && p.y + c.high_m.y > w.min_y_m &&
           p.y + c.low_m.y < w.max_y_m;
}

// While the state doubles the number of clouds and halves it again: none is born inside, none vanishes there.
TEST(EnteringOverTheHorizon, NothingAppearsOrVanishesInside) {
    for (const auto& [east, north] : {std::pair{25.0, 0.0}, {-18.0, 12.0}, {0.0, -30.0}}) {
        SkyOptions options = over_the_horizon(east, north);
        options.schedule = {{0, 0}, {1000, 1}, {3000, 1}, {4000, 0}};
        SkySimulation sky(options);
        std::size_t entered = 0, left = 0;
        for (int step = 0; step < 600; ++step) {
            const std::vector<SkyCloud> before(sky.clouds().begin(), sky.clouds().end());
            const std::set<std::uint32_t> known = serials(sky);
            sky.step();
            const std::set<std::uint32_t> now = serials(sky);
            for (const SkyCloud& c : sky.clouds()) {
                EXPECT_FALSE(c.dissolving);
                if (known.contains(c.serial)) continue;
                ++entered;
                EXPECT_FALSE(touches_the_world(sky, c)) << "a cloud was born inside";
            }
            for (const SkyCloud& c : before) {
                if (now.contains(c.serial)) continue;
                ++left;
                EXPECT_FALSE(touches_the_world(sky, c, east * 10, north * 10)) << "a cloud vanished inside";
            }
        }
        EXPECT_GT(entered, 60u);
        EXPECT_GT(left, 60u);
    }
}

// Without wind the state may do what it likes.
TEST(EnteringOverTheHorizon, NothingChangesInCalmAir) {
    SkyOptions options = over_the_horizon(0, 0);
    options.schedule = {{0, 0}, {1000, 1}, {2000, 0}};
    SkySimulation sky(options);
    const std::vector<SkyCloud> before(sky.clouds().begin(), sky.clouds().end());
    ASSERT_EQ(before.size(), 40u);
    for (int step = 0; step < 300; ++step) sky.step();
    EXPECT_EQ(std::vector<SkyCloud>(sky.clouds().begin(), sky.clouds().end()), before);
}

// The number follows once the air has been exchanged, and stays even: clouds of both halves of the world, of the
// kinds that the state asks for.
TEST(EnteringOverTheHorizon, TheNumberFollowsByAdvection) {
    SkyOptions options = over_the_horizon(20, 8);
    options.schedule = {{0, 0}, {1, 1}};
    SkySimulation sky(options);
    for (int step = 0; step < 5; ++step) sky.step();
    EXPECT_GT(sky.count(), 42u);
    EXPECT_LT(sky.count(), 65u) << "not at once: the air is exchanged in 30 steps";
    for (int step = 0; step < 80; ++step) sky.step();
    double sum = 0, west = 0, south = 0;
    for (int step = 0; step < 400; ++step) {
        sky.step();
        sum += double(sky.count());
        for (const SkyCloud& c : sky.clouds()) {
            EXPECT_EQ(c.sky, 1u);
            west += sky.sphere(c).centre_m.x < 3000;
            south += sky.sphere(c).centre_m.y < 4000;
        }
    }
    EXPECT_NEAR(sum / 400, 80, 3);
    EXPECT_NEAR(west / sum, 0.5, 0.04);
    EXPECT_NEAR(south / sum, 0.5, 0.04);
}

// Large clouds touch the world for longer than small ones: that they enter as often as the air that they need
// passes keeps each kind's share of the sky.
TEST(EnteringOverTheHorizon, KindsKeepTheirShares) {
    SkyOptions options = over_the_horizon(25, 0);
    options.models = {test::single_box_model(50, "small"), test::single_box_model(4000, "large")};
    options.skies = {{"both", 0, 60, {{0, 2}, {1, 2}}}};
    SkySimulation sky(options);
    for (int step = 0; step < 100; ++step) sky.step();
    double large = 0, all = 0;
    for (int step = 0; step < 1500; ++step) {
        sky.step();
        for (const SkyCloud& c : sky.clouds()) large += sky.model(c).name == "large";
        all += double(sky.count());
    }
    EXPECT_NEAR(all / 1500, 60, 2);
    EXPECT_NEAR(large / all, 0.5, 0.05);
}

TEST(EnteringOverTheHorizon, WindThatCrossesTheWorldInOneStepStillBringsClouds) {
    SkySimulation sky(over_the_horizon(5000, 0));
    for (int step = 0; step < 20; ++step) sky.step();
    EXPECT_GT(sky.count(), 20u);
    EXPECT_LE(sky.count(), 120u);
}

TEST(EnteringOverTheHorizon, ASkyWithoutModelsLeavesEnteringToTheOther) {
    SkyOptions options = over_the_horizon(30, 0);
    options.skies = {{"clear", 0, 0, {}}, {"some", 1, 40, {{0, 4}}}};
    options.schedule = {{0, 0.4}};
    SkySimulation sky(options);
    for (int step = 0; step < 200; ++step) sky.step();
    EXPECT_NEAR(double(sky.count()), 16, 4);
}

TEST(EnteringOverTheHorizon, SavedStateContinuesExactly) {
    SkyOptions options = over_the_horizon(12.3, 4.5);
    options.schedule = {{0, 0}, {500, 1}};
    SkySimulation straight(options), resumed(options);
    for (int step = 0; step < 77; ++step) straight.step();
    resumed.restore(straight.save());
    for (int step = 0; step < 150; ++step) {
        straight.step();
        resumed.step();
    }
    EXPECT_EQ(resumed.save(), straight.save());
    EXPECT_EQ(resumed.hash(), straight.hash());
    SkyOptions other = options;
    other.entering = Entering::anywhere;
    SkySimulation foreign(other);
    test::expect_error(ErrorCode::io, "", [&] { foreign.restore(straight.save()); });
}

}  // namespace
}  // namespace nephos
