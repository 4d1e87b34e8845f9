// SPDX-License-Identifier: Apache-2.0
#include "seeds/climate.h"

#include <cmath>

#include "tests/seeds/fixtures.h"

namespace nephos {
namespace {

using test::expect_error;

std::vector<Sky> skies_of(std::vector<std::pair<double, int>> states) {
    std::vector<Sky> skies;
    for (auto [state, clouds] : states) skies.push_back({"sky", state, clouds, {{0, 1}}});
    return skies;
}

// T's worked example: skies 0, 0.25, 0.75, 1; Si = 0, Sf = 1, D = 30, T = 15.
TEST(Climate, WorkedExample) {
    const auto schedule = straight_schedule(0, 1, 30);
    const double state = state_at(schedule, 15);
    EXPECT_EQ(state, 0.5);
    const SkyShares shares = shares_at(skies_of({{0, 0}, {0.25, 0}, {0.75, 0}, {1, 0}}), state);
    EXPECT_EQ(shares.lower, 1u);
    EXPECT_EQ(shares.upper, 2u);
    EXPECT_EQ(shares.lower_fraction, 0.5);
    EXPECT_EQ(shares.upper_fraction, 0.5);
}

TEST(Climate, SharesFollowTheFormulaInAnyOrder) {
    const auto skies = skies_of({{0.75, 30}, {0, 10}, {1, 400}, {0.25, 20}});
    for (double state : {0.0, 0.1, 0.25, 0.3, 0.7, 0.75, 0.9, 1.0}) {
        const SkyShares s = shares_at(skies, state);
        EXPECT_NEAR(s.lower_fraction + s.upper_fraction, 1, 1e-15);
        if (s.lower == s.upper) {
            EXPECT_EQ(skies[s.lower].state, state);
            EXPECT_EQ(s.lower_fraction, 1);
            continue;
        }
        const double difference = skies[s.upper].state - skies[s.lower].state;
        EXPECT_LT(skies[s.lower].state, state);
        EXPECT_GT(skies[s.upper].state, state);
        EXPECT_NEAR(s.lower_fraction, 1 - std::abs(state - skies[s.lower].state) / difference, 1e-15);
        EXPECT_NEAR(s.upper_fraction, 1 - std::abs(state - skies[s.upper].state) / difference, 1e-15);
    }
    EXPECT_EQ(clouds_at(skies, 0.5), 25);
    EXPECT_EQ(clouds_at(skies, 0.125), 15);
    EXPECT_EQ(clouds_at(skies, 1), 400);
    EXPECT_EQ(nearest_sky(skies, 0.45), 3u);
    EXPECT_EQ(nearest_sky(skies, 0.55), 0u);
    EXPECT_EQ(nearest_sky(skies, 0.5), 3u);  // equally near: the clearer one
    // T's upper layer has no sky above 0.5: beyond, that one has it all.
    const auto upper = skies_of({{0, 50}, {0.5, 100}});
    EXPECT_EQ(clouds_at(upper, 0.9), 100);
    EXPECT_EQ(shares_at(upper, 0.9).lower, 1u);
    EXPECT_EQ(shares_at(skies_of({{0.5, 7}}), 0.1).lower_fraction, 1);
}

TEST(Climate, AnySchedule) {
    const std::vector<StatePoint> course{{10, 0.2}, {20, 0.8}, {40, 0.0}};
    EXPECT_EQ(state_at(course, -5), 0.2);
    EXPECT_EQ(state_at(course, 10), 0.2);
    EXPECT_NEAR(state_at(course, 15), 0.5, 1e-15);
    EXPECT_EQ(state_at(course, 20), 0.8);
    EXPECT_EQ(state_at({{{0, 0.8}, {100, 0.1}}}, 100), 0.1);  // and not one rounded twice
    EXPECT_NEAR(state_at(course, 35), 0.2, 1e-15);
    EXPECT_EQ(state_at(course, 1e9), 0.0);
    EXPECT_EQ(state_at(straight_schedule(0.3, 0.9, 0), 0), 0.9);
}

TEST(Climate, BadInput) {
    expect_error(ErrorCode::usage, "no sky", [] { (void)shares_at({}, 0.5); });
    expect_error(ErrorCode::usage, "schedule", [] { (void)state_at({}, 0); });
    expect_error(ErrorCode::usage, "initial state", [] { (void)straight_schedule(-0.1, 1, 10); });
    expect_error(ErrorCode::usage, "final state", [] { (void)straight_schedule(0, NAN, 10); });
    expect_error(ErrorCode::usage, "duration", [] { (void)straight_schedule(0, 1, -1); });
}

TEST(SkyCheck, NamesEveryBadValue) {
    EXPECT_NO_THROW(check(test::small_sky()));
    const auto refuse = [](const std::string& part, auto&& change) {
        SkyOptions options = test::small_sky();
        change(options);
        expect_error(ErrorCode::usage, part, [&] { SkySimulation sky(options); });
    };
    refuse("no sky", [](SkyOptions& o) { o.skies.clear(); });
    refuse("same state", [](SkyOptions& o) { o.skies[1].state = 0; });
    refuse("state", [](SkyOptions& o) { o.skies[1].state = 1.5; });
    refuse("number of clouds", [](SkyOptions& o) { o.skies[1].clouds = -3; });
    refuse("no base model", [](SkyOptions& o) { o.skies[1].models.clear(); });
    refuse("does not exist", [](SkyOptions& o) { o.skies[1].models[0].model = 2; });
    refuse("generated", [](SkyOptions& o) { o.skies[1].models[0].generated = 0; });
    refuse("empty schedule", [](SkyOptions& o) { o.schedule.clear(); });
    refuse("must rise", [](SkyOptions& o) { o.schedule = {{0, 0}, {0, 1}}; });
    refuse("state in the schedule", [](SkyOptions& o) { o.schedule = {{0, 2}}; });
    refuse("no area", [](SkyOptions& o) { o.world.max_x_m = o.world.min_x_m; });
    refuse("world rectangle", [](SkyOptions& o) { o.world.max_x_m = INFINITY; });
    refuse("base height", [](SkyOptions& o) { o.base_height_m = {2000, 1000}; });
    refuse("time step", [](SkyOptions& o) { o.time_step_s = 0; });
    refuse("formation", [](SkyOptions& o) { o.formation_s = -1; });
    refuse("softness", [](SkyOptions& o) { o.formation_softness = 0; });
    refuse("width", [](SkyOptions& o) { o.models[0].seeds[0].size_m.x = -1; });
    refuse("layer number", [](SkyOptions& o) { o.layer = 70000; });
    refuse("larger than the world", [](SkyOptions& o) { o.models[1].seeds[0].size_m.y = 6001; });
}

}  // namespace
}  // namespace nephos
