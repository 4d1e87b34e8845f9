// SPDX-License-Identifier: Apache-2.0
// Whose turn it is to be lit anew: by the number of the frame, and never too many at once.

#include "seeds/light_schedule.h"

#include <algorithm>
#include <map>
#include <set>

#include <gtest/gtest.h>

#include "seeds/sky_simulation.h"
#include "tests/seeds/fixtures.h"

namespace nephos {
namespace {

SkyOptions sky_of(int clouds) {
    SkyOptions options;
    options.skies = {{"few", 0, clouds / 2, {}}, {"many", 1, clouds, {}}};
    return options;
}

// A cloud's light is of a frame of its own turn, the last one; before its first turn, of frame 0.
TEST(LightSchedule, ACloudKeepsTheLightOfItsLastTurn) {
    for (const int clouds : {1, 7, 60}) {
        for (const int bound : {1, 3, 1000}) {
            const LightSchedule schedule(sky_of(clouds), bound);
            for (std::uint32_t slot = 0; slot < 90; ++slot) {
                int last = 0;
                for (int frame = 0; frame < 300; ++frame) {
                    if (frame % schedule.period() == int(slot) % schedule.period()) last = frame;
                    ASSERT_EQ(schedule.frame_of_light(slot, frame), last);
                }
            }
        }
    }
    EXPECT_EQ(LightSchedule(sky_of(60), 0).period(), 1);
    EXPECT_EQ(LightSchedule(sky_of(60), 1).period(), 75);
    EXPECT_EQ(LightSchedule(sky_of(60), 4).period(), 19);
    EXPECT_EQ(LightSchedule(sky_of(0), 4).period(), 1);
}

// Clouds drift through, leave, dissolve and enter: never more than the bound are due in a frame beside those
// that are new, every cloud gets its turn, and slots are never shared.
TEST(LightSchedule, ADriftingSkyKeepsTheBound) {
    for (const bool whole : {true, false}) {
        for (const int bound : {1, 3}) {
            SkyOptions options = test::small_sky();
            options.schedule = {{0, 1}};  // its fullest sky
            options.wind = test::constant_wind(9, 5);
            options.cross_edges_whole = whole;
            options.formation_s = options.dissolution_s = 60;
            SkySimulation sky(options);
            const LightSchedule schedule(options, bound);
            std::map<std::uint32_t, int> light;  // by cloud: the frame that it has the light of
            std::size_t entered = 0;
            for (int frame = 0; frame < 600; ++frame, sky.step()) {
                std::map<std::uint32_t, int> next;
                std::set<std::uint32_t> slots;
                int due = 0;
                for (const SkyCloud& cloud : sky.clouds()) {
                    EXPECT_TRUE(slots.insert(cloud.slot).second);
                    const int of = schedule.frame_of_light(cloud.slot, frame);
                    EXPECT_GT(of, frame - schedule.period());
                    next[cloud.serial] = of;
                    const auto before = light.find(cloud.serial);
                    entered += before == light.end();
                    due += before != light.end() && before->second != of;
                }
                ASSERT_LE(due, bound) << "frame " << frame << ", " << sky.clouds().size() << " clouds";
                light = std::move(next);
            }
            EXPECT_GT(entered, 2 * sky.clouds().size()) << "nothing drifted";
        }
    }
}

// The slots go on where they were saved, and the state's hash does not know them.
TEST(LightSchedule, SlotsAreSaved) {
    SkyOptions options = test::small_sky();
    options.wind = test::constant_wind(9, 5);
    SkySimulation straight(options), resumed(options);
    for (int step = 0; step < 90; ++step) straight.step();
    resumed.restore(straight.save());
    for (int step = 0; step < 90; ++step) {
        ASSERT_TRUE(std::ranges::equal(resumed.clouds(), straight.clouds()));
        ASSERT_EQ(resumed.hash(), straight.hash());
        straight.step();
        resumed.step();
    }
}

}  // namespace
}  // namespace nephos
