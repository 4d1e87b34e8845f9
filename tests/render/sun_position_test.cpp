// SPDX-License-Identifier: Apache-2.0
// The sun's position against published values, and its texts.

#include "render/options/sun_position.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "render/options/options.h"
#include "render/options/sun_path.h"

namespace nephos {
namespace {

// I. Reda and A. Andreas, "Solar Position Algorithm for Solar Radiation Applications", NREL/TP-560-34302,
// 2008, appendix A.5: Golden, Colorado, 2003-10-17 12:30:30 local (UT - 7 h), 39.742476 N, 105.1786 W:
// topocentric zenith angle 50.11162 with a refraction of 0.01636 degrees, azimuth 194.34024.
TEST(SunPosition, AgreesWithNrel) {
    const auto days = days_since_2000("2003-10-17", "19:30:30");
    ASSERT_TRUE(days);
    EXPECT_NEAR(*days + 2451545, 2452930.312847, 1e-6);
    const SunPosition sun = sun_position(*days, 39.742476, -105.1786);
    EXPECT_NEAR(sun.elevation_deg, 90 - 50.11162 - 0.01636, 0.02);
    EXPECT_NEAR(sun.azimuth_deg, 194.34024, 0.02);
}

// J. Meeus, "Astronomical Algorithms", example 25.a: on 1992-10-13 0h TD the apparent declination is -7.78507
// degrees and the right ascension 198.38083. At the north pole the elevation is the declination.
TEST(SunPosition, AgreesWithMeeus) {
    const SunPosition pole = sun_position(*days_since_2000("1992-10-13", "00:00"), 90, 0);
    EXPECT_NEAR(pole.elevation_deg, -7.78507, 0.02);
}

// Equinoxes and solstices of 2026 (UT, from astronomical almanacs): the sun stands over the equator, and over
// the tropics.
TEST(SunPosition, TurnsWithTheYear) {
    EXPECT_NEAR(sun_position(*days_since_2000("2026-03-20", "14:46"), 90, 0).elevation_deg, 0, 0.02);
    EXPECT_NEAR(sun_position(*days_since_2000("2026-06-21", "08:25"), 90, 0).elevation_deg, 23.436, 0.02);
    EXPECT_NEAR(sun_position(*days_since_2000("2026-09-23", "00:05"), 90, 0).elevation_deg, 0, 0.02);
    EXPECT_NEAR(sun_position(*days_since_2000("2026-12-21", "20:50"), 90, 0).elevation_deg, -23.436, 0.02);
    // In the morning it stands in the east, in the evening in the west.
    EXPECT_NEAR(sun_position(*days_since_2000("2026-03-20", "06:07"), 0, 0).azimuth_deg, 90, 1);
    EXPECT_NEAR(sun_position(*days_since_2000("2026-03-20", "18:07"), 0, 0).azimuth_deg, 270, 1);
}

TEST(SunPosition, TakesOnlyMoments) {
    EXPECT_EQ(days_since_2000("2000-01-01", "12:00"), 0.0);
    EXPECT_EQ(days_since_2000("2000-01-02", "00:00:00"), 0.5);
    for (const char* date :
         {"", "2026-6-21", "2026-02-30", "2026/06/21", "1800-01-01", "2026-06-21x", "2026-13-01"})
        EXPECT_FALSE(days_since_2000(date, "12:00")) << date;
    for (const char* time : {"", "24:00", "12:60", "1200", "12:00:60", "12.00", "12:00:00 "})
        EXPECT_FALSE(days_since_2000("2026-06-21", time)) << time;
}

// Key frames of the sun: exactly its values at their times, evenly between them and the shorter way round, standing still
// outside. At any time a picture can be drawn with it.
TEST(SunPath, GoesEvenlyFromKeyToKey) {
    Sun sun;
    sun.elevation_deg = 77;
    const std::vector<SunKey> path{
        {10, 8, 350, {1, 1, 1}}, {20, -18, 20, {1, 0.5, 0}}, {30, 90, 300, {0.2, 0.2, 0.2}}};
    for (const SunKey& key : path) {
        const Sun at = sun_at(sun, path, key.time_s);
        EXPECT_EQ(at.elevation_deg, key.elevation_deg);
        EXPECT_EQ(at.azimuth_deg, key.azimuth_deg);
        EXPECT_EQ(at.colour, key.colour);
    }
    EXPECT_EQ(sun_at(sun, path, 0), sun_at(sun, path, 10));
    EXPECT_EQ(sun_at(sun, path, 1e9), sun_at(sun, path, 30));
    const Sun middle = sun_at(sun, path, 15);
    EXPECT_DOUBLE_EQ(middle.elevation_deg, -5);
    EXPECT_NEAR(std::remainder(middle.azimuth_deg - 5, 360.0), 0, 1e-9);  // over north, by 30 degrees
    EXPECT_DOUBLE_EQ(middle.colour[1], 0.75);
    EXPECT_NEAR(std::remainder(sun_at(sun, path, 25).azimuth_deg - 340, 360.0), 0, 1e-9);
    for (double t = 0; t < 40; t += 0.1) {
        RenderOptions now;
        now.sun = sun_at(sun, path, t);
        EXPECT_NO_THROW(check(now)) << t;
    }
    EXPECT_EQ(sun_at(sun, {}, 15), sun);
}

}  // namespace
}  // namespace nephos
