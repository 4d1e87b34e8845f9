// SPDX-License-Identifier: Apache-2.0
// T's absorption factor in the voxels of an automaton: lengths inside ellipsoids, by small steps along the rays.

#include "seeds/parcel_absorption.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "tests/seeds/fixtures.h"

namespace nephos {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

ActiveEllipsoid ellipsoid(const Vec3& centre_m, const Vec3& semi_axes_m, double weight = 1) {
    ActiveEllipsoid active;
    active.ellipsoid.centre_m = centre_m;
    active.ellipsoid.semi_axes_m = semi_axes_m;
    active.weight = weight;
    return active;
}

double radius_in(const Ellipsoid& e, const Vec3& place_m) {
    return length((place_m - e.centre_m) / e.semi_axes_m);
}

// The formulas of the header, with the lengths by steps of the middle rule.
double twin(const std::vector<AbsorbingCloud>& clouds, const Vec3& to_sun, const Vec3& place_m) {
    constexpr double kStep_m = 0.5, kFar_m = 3000;
    double left = 1;
    for (const AbsorbingCloud& cloud : clouds) {
        double part = 0, length_m = 0;
        for (const ActiveEllipsoid& each : cloud.ellipsoids) {
            const double r = radius_in(each.ellipsoid, place_m);
            part = std::max(part, std::min(1.0, 4 * each.weight) * std::clamp((1.5 - r) / 0.5, 0.0, 1.0));
            for (double t = kStep_m / 2; t < kFar_m; t += kStep_m)
                if (radius_in(each.ellipsoid, place_m + t * to_sun) < 1) length_m += each.weight * kStep_m;
        }
        left *= 1 - cloud.strength * part * std::clamp(length_m / cloud.light_distance_m, 0.0, 1.0);
    }
    return left;
}

TEST(ParcelAbsorption, EqualsItsTwinAtRandomPlaces) {
    constexpr unsigned kSeed = 20;
    std::mt19937 random(kSeed);
    const auto number = [&](double low, double high) {
        return std::uniform_real_distribution<double>(low, high)(random);
    };
    std::vector<AbsorbingCloud> clouds;
    for (int c = 0; c < 6; ++c) {
        AbsorbingCloud& cloud = clouds.emplace_back();
        const Vec3 middle{number(-250, 250), number(-250, 250), number(950, 1050)};
        for (int e = 0; e < 4; ++e)
            cloud.ellipsoids.push_back(
                ellipsoid(middle + Vec3(number(-150, 150), number(-150, 150), number(-60, 60)),
                          {number(60, 220), number(60, 220), number(30, 120)}, number(0.05, 1)));
        cloud.light_distance_m = number(100, 900);
        cloud.strength = number(0.3, 1);
    }
    int dark = 0, partly = 0;
    for (const double elevation : {8.0, 41.0, 90.0}) {
        const double angle = elevation * 3.14159265358979 / 180, azimuth = number(0, 6.28);
        const Vec3 to_sun{std::cos(angle) * std::cos(azimuth), std::cos(angle) * std::sin(azimuth),
                          std::sin(angle)};
        const ParcelAbsorption absorption(clouds, 7.0 * to_sun);
        for (int n = 0; n < 150; ++n) {
            const Vec3 place{number(-450, 450), number(-450, 450), number(820, 1180)};
            const double found = absorption.sunlight_at(place);
            EXPECT_NEAR(found, twin(clouds, to_sun, place), 0.02) << "seed " << kSeed << ", place " << n;
            dark += found < 0.5;
            partly += found < 1;
        }
    }
    EXPECT_GT(dark, 10);
    EXPECT_GT(partly, 100);
}

// Half of a sphere's diameter lies before its centre, all of it before its far side, and nothing before its near one.
TEST(ParcelAbsorption, OfASphereIsItsChord) {
    const AbsorbingCloud sphere{{ellipsoid({0, 0, 1000}, {200, 200, 200})}, 800, 1};
    const ParcelAbsorption absorption({&sphere, 1}, {0, 0, 1});
    EXPECT_NEAR(absorption.sunlight_at({0, 0, 1000}), 1 - 200.0 / 800, 1e-12);
    EXPECT_NEAR(absorption.sunlight_at({0, 0, 800}), 1 - 400.0 / 800, 1e-12);
    EXPECT_NEAR(absorption.sunlight_at({0, 0, 1200}), 1, 1e-12);
    EXPECT_NEAR(absorption.sunlight_at({0, 0, 750}), 1 - 0.5 * 400.0 / 800, 1e-12) << "half out of its reach";
    EXPECT_EQ(absorption.sunlight_at({0, 0, 690}), 1) << "below it";
    EXPECT_EQ(absorption.sunlight_at({0, 5000, 1000}), 1);
}

TEST(ParcelAbsorption, BeyondTheLightDistanceNothingIsLeft) {
    const AbsorbingCloud sphere{{ellipsoid({0, 0, 1000}, {200, 200, 200})}, 150, 1};
    EXPECT_EQ(ParcelAbsorption({&sphere, 1}, {0, 0, 1}).sunlight_at({0, 0, 1000}), 0);
    AbsorbingCloud weaker = sphere;
    weaker.strength = 0.4;
    EXPECT_NEAR(ParcelAbsorption({&weaker, 1}, {0, 0, 1}).sunlight_at({0, 0, 1000}), 0.6, 1e-12);
}

// A dark cloud and a bright one side by side: what lies in the bright one has all its light, also in the line behind the
// dark one.
TEST(ParcelAbsorption, ConcernsTheCloudsOwnPlacesAlone) {
    const AbsorbingCloud dark{{ellipsoid({0, 0, 1000}, {300, 300, 100})}, 200, 1};
    const Vec3 to_sun{1, 0, 0};
    const ParcelAbsorption absorption({&dark, 1}, to_sun);
    EXPECT_EQ(absorption.sunlight_at({-200, 0, 1000}), 0);
    EXPECT_EQ(absorption.sunlight_at({-700, 0, 1000}), 1) << "behind it";
}

// The way to a lightning ends there: in the cloud, behind the place, or beyond the cloud, where it is as the sun.
TEST(ParcelAbsorption, LightningIsAbsorbedOnItsWay) {
    const AbsorbingCloud sphere{{ellipsoid({0, 0, 1000}, {200, 200, 200})}, 800, 1};
    const ParcelAbsorption absorption({&sphere, 1}, {1, 0, 0});
    EXPECT_NEAR(absorption.lightning_at({0, 0, 1000}, {0, 0, 1100}), 1 - 100.0 / 800, 1e-12);
    EXPECT_NEAR(absorption.lightning_at({0, 0, 1000}, {0, 0, 900}), 1 - 100.0 / 800, 1e-12);
    EXPECT_NEAR(absorption.lightning_at({0, 0, 1000}, {0, 0, 5000}), 1 - 200.0 / 800, 1e-12);
    EXPECT_NEAR(absorption.lightning_at({0, 0, 850}, {0, 0, 1150}), 1 - 300.0 / 800, 1e-12);
    EXPECT_NEAR(absorption.lightning_at({0, -200, 1000}, {0, -900, 1000}), 1, 1e-12) << "away from the cloud";
    EXPECT_EQ(absorption.lightning_at({0, 0, 1000}, {0, 0, 1000}), 1);
    const Vec3 place{60, -80, 940}, far_m = place + 1e7 * Vec3{1, 0, 0};
    EXPECT_NEAR(absorption.lightning_at(place, far_m), absorption.sunlight_at(place), 1e-9);
}

TEST(ParcelAbsorption, SaysWhatIsWrong) {
    const AbsorbingCloud good{{ellipsoid({0, 0, 1000}, {200, 200, 200})}, 150, 1};
    AbsorbingCloud bad = good;
    bad.light_distance_m = 0;
    test::expect_error(ErrorCode::usage, "light distance", [&] { ParcelAbsorption({&bad, 1}, {0, 0, 1}); });
    bad = good;
    bad.strength = 2;
    test::expect_error(ErrorCode::usage, "strength", [&] { ParcelAbsorption({&bad, 1}, {0, 0, 1}); });
    test::expect_error(ErrorCode::usage, "direction to the sun", [&] {
        ParcelAbsorption({&good, 1}, {0, 0, 0});
    });
}

// Of a sky only the clouds of models with a finite light distance count, as the ellipsoids that drive the automaton.
TEST(ParcelAbsorption, TakesTheEllipsoidsOfModelsThatAbsorb) {
    SkyOptions options = test::small_sky();
    options.models[0].light_distance_m = kInfinity;
    options.skies[0].models.push_back({1, 3});
    const SkySimulation sky(options);
    const CouplingOptions coupling{.min_semi_axis_m = 80};
    std::vector<AbsorbingCloud> clouds;
    append_absorbing(clouds, sky, sky.clouds(), coupling, {0.7, {0, 0}}, 0);
    std::size_t expected = 0;
    for (const SkyCloud& cloud : sky.clouds()) expected += sky.model(cloud).name == "storm";
    ASSERT_GT(expected, 5u);
    ASSERT_LT(expected, sky.clouds().size());
    ASSERT_EQ(clouds.size(), expected);
    for (const AbsorbingCloud& cloud : clouds) {
        EXPECT_EQ(cloud.light_distance_m, 100);
        EXPECT_EQ(cloud.strength, 0.7);
        ASSERT_EQ(cloud.ellipsoids.size(), 1u);
        EXPECT_NEAR(cloud.ellipsoids[0].ellipsoid.semi_axes_m.x, 1.24 * 150, 1e-9);
    }
    clouds.clear();
    append_absorbing(clouds, sky, sky.clouds(), coupling, {0, {0, 0}}, 0);
    EXPECT_TRUE(clouds.empty()) << "strength 0";
    EXPECT_TRUE(ParcelAbsorption(clouds, {0, 0, 1}).empty());
}

// Beyond a periodic side stands the cloud's image, as its ellipsoid does.
TEST(ParcelAbsorption, RepeatsAtPeriodicSides) {
    SkyOptions options = test::small_sky();
    options.skies[0].clouds = 25;
    const SkySimulation sky(options);
    const WorldRectangle& world = options.world;
    const Vec2 edges{world.max_x_m - world.min_x_m, world.max_y_m - world.min_y_m};
    std::vector<AbsorbingCloud> images, alone;
    append_absorbing(alone, sky, sky.clouds(), {}, {1, {0, 0}}, 0);
    append_absorbing(images, sky, sky.clouds(), {}, {1, edges}, 0);
    EXPECT_GT(images.size(), alone.size());
    const Vec3 to_sun{0.3, 0.4, 0.5};
    const ParcelAbsorption with(images, to_sun), without(alone, to_sun);
    for (const AbsorbingCloud& cloud : alone) {
        const Vec3 centre = cloud.ellipsoids[0].ellipsoid.centre_m;
        const double there = with.sunlight_at(centre);
        EXPECT_LT(there, 1);
        Vec3 image = centre;  // as it is seen a little beyond the nearer side
        image.x += centre.x < 0.5 * (world.min_x_m + world.max_x_m) ? edges.x : -edges.x;
        if (image.x > world.min_x_m - 0.2 * edges.x && image.x < world.max_x_m + 0.2 * edges.x) {
            EXPECT_NEAR(with.sunlight_at(image), there, 1e-9);
            EXPECT_EQ(without.sunlight_at(image), 1);
        }
    }
}

}  // namespace
}  // namespace nephos
