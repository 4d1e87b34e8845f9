// SPDX-License-Identifier: Apache-2.0
#include "seeds/light_absorption.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/seeds/fixtures.h"

namespace nephos {
namespace {

Cloud cloud_of(std::vector<SeedBox> boxes, double light_distance_m) {
    Cloud cloud{.boxes = std::move(boxes), .light_distance_m = light_distance_m};
    enclose(cloud);
    return cloud;
}

// Marches from `origin` along unit `d` and counts, at each midpoint, how many boxes hold it.
double integrated(const Cloud& cloud, const Vec3& origin, const Vec3& d, double end, double step) {
    double sum = 0;
    for (double t = step / 2; t < end; t += step) {
        for (const SeedBox& b : cloud.boxes) {
            sum += step * (std::abs(origin.x + t * d.x - b.centre_m.x) <= b.size_m.x / 2 &&
                           std::abs(origin.y + t * d.y - b.centre_m.y) <= b.size_m.y / 2 &&
                           std::abs(origin.z + t * d.z - b.centre_m.z) <= b.size_m.z / 2);
        }
    }
    return sum;
}

Cloud random_cloud(std::mt19937_64& random, int n) {
    std::uniform_real_distribution<double> place(-100, 100), size(10, 80);
    std::vector<SeedBox> boxes;
    for (int i = 0; i < n; ++i) {
        boxes.push_back({.centre_m = {place(random), place(random), place(random)},
                         .size_m = {size(random), size(random), size(random)}});
    }
    return cloud_of(std::move(boxes), 150);
}

// The sum of lengths against numerical integration along the same rays, for sun, light below the horizon and
// lights at finite places.
TEST(LightAbsorption, AgreesWithIntegration) {
    std::mt19937_64 random(3);
    std::normal_distribution<double> normal;
    const Vec3 position{5000, -3000, 1200};
    for (int round = 0; round < 12; ++round) {
        const Cloud cloud = random_cloud(random, 13);
        const Vec3 n{normal(random), normal(random), normal(random)};
        const double l = std::hypot(n.x, n.y, n.z);
        Light light{{3 * n.x, 3 * n.y, 3 * n.z}, true};
        if (round % 2)
            light = {{position.x + n.x / l * 400, position.y + n.y / l * 400, position.z + n.z / l * 400},
                     false};
        const auto absorbed = absorbed_light(cloud, position, light);
        bool partly = false;
        for (std::size_t i = 0; i < cloud.boxes.size(); ++i) {
            const Vec3 origin = cloud.boxes[i].centre_m;
            Vec3 d{n.x / l, n.y / l, n.z / l};
            double end = 1000;
            if (!light.at_infinity) {
                d = {d.x * 400 - origin.x, d.y * 400 - origin.y, d.z * 400 - origin.z};
                end = std::hypot(d.x, d.y, d.z);
                d = {d.x / end, d.y / end, d.z / end};
            }
            const double expected = std::min(1.0, integrated(cloud, origin, d, end, 0.02) / 150);
            EXPECT_NEAR(absorbed[i], expected, 0.02 * 13 / 150) << "round " << round << " box " << i;
            partly = partly || (absorbed[i] > 0.1 && absorbed[i] < 0.9);
        }
        EXPECT_TRUE(partly);
    }
}

// Three boxes in a row: every length is known. Rays parallel to axes, also in the planes of other boxes'
// faces.
TEST(LightAbsorption, RowOfBoxes) {
    const auto box = [](double x, double y = 0) {
        return SeedBox{.centre_m = {x, y, 0}, .size_m = {10, 10, 10}};
    };
    const Cloud row = cloud_of({box(0), box(20), box(40), box(60, 5)}, 40);
    const auto east = absorbed_light(row, {}, {{1, 0, 0}, true});
    // The fourth box's face lies in y = 0, where the rays run: it counts as inside.
    EXPECT_DOUBLE_EQ(east[0], 35.0 / 40);
    EXPECT_DOUBLE_EQ(east[1], 25.0 / 40);
    EXPECT_DOUBLE_EQ(east[2], 15.0 / 40);
    EXPECT_DOUBLE_EQ(east[3], 5.0 / 40);
    const auto west = absorbed_light(row, {}, {{-5, 0, 0}, true});
    EXPECT_DOUBLE_EQ(west[0], 5.0 / 40);
    EXPECT_DOUBLE_EQ(west[2], 25.0 / 40);
    for (double z : {1.0, -1.0}) {  // sun above, light below the horizon
        for (double a : absorbed_light(row, {}, {{0, 0, z}, true})) EXPECT_DOUBLE_EQ(a, 5.0 / 40);
        for (double a : absorbed_light(row, {7, 8, 9}, {{0, 0, z * 1e-200}, true}))
            EXPECT_DOUBLE_EQ(a, 5.0 / 40);
    }
}

TEST(LightAbsorption, CornerCases) {
    const SeedBox box{.centre_m = {0, 0, 0}, .size_m = {10, 10, 10}};
    EXPECT_EQ(absorbed_light(cloud_of({box}, INFINITY), {}, {{1, 1, 1}, true})[0], 0);
    EXPECT_EQ(absorbed_light(cloud_of({box}, 1), {}, {{1, 1, 1}, true})[0], 1);
    EXPECT_DOUBLE_EQ(absorbed_light(cloud_of({box}, 10), {}, {{0, 3, 0}, false})[0],
                     0.3);  // nothing beyond the light
    EXPECT_EQ(absorbed_light(cloud_of({box}, 10), {4, 5, 6}, {{4, 5, 6}, false})[0], 0);  // in the centre
    EXPECT_TRUE(absorbed_light(Cloud{}, {}, {{1, 0, 0}, true}).empty());
    // A box whose face's plane holds the ray's start: 0 * 1/0 must not become a NaN.
    const SeedBox touching{.centre_m = {20, 5, 5}, .size_m = {10, 10, 10}};
    const auto along = absorbed_light(cloud_of({box, touching}, 100), {}, {{1, 0, 0}, true});
    EXPECT_DOUBLE_EQ(along[0], 0.15);
    EXPECT_DOUBLE_EQ(along[1], 0.05);
    // Weights thin the cloud.
    const Cloud two = cloud_of({box, {.centre_m = {20, 0, 0}, .size_m = {10, 10, 10}}}, 100);
    std::vector<double> out(2);
    absorb_light(two, {}, {{1, 0, 0}, true}, out, std::vector<double>{1, 0.5});
    EXPECT_DOUBLE_EQ(out[0], 0.10);
    EXPECT_DOUBLE_EQ(out[1], 0.025);
    test::expect_error(ErrorCode::usage, "direction", [&] {
        (void)absorbed_light(two, {}, {{0, 0, 0}, true});
    });
    test::expect_error(ErrorCode::usage, "finite", [&] {
        (void)absorbed_light(two, {}, {{NAN, 0, 0}, true});
    });
    test::expect_error(ErrorCode::usage, "room", [&] { absorb_light(two, {}, {}, std::span(out).first(1)); });
}

// A ray's result has the same bits wherever it stands among the lanes: the scalar twin, one ray at a time.
TEST(LightAbsorption, BitsDoNotDependOnLanes) {
    std::mt19937_64 random(8);
    for (int n : {1, 2, 3, 5, 8, 31}) {
        const Cloud cloud = random_cloud(random, n);
        const Light light{{0.3, -0.7, 0.9}, true};
        const auto all = absorbed_light(cloud, {}, light);
        for (int i = 0; i < n; ++i) {
            Cloud rotated = cloud;  // box i alone with its ray in another lane, the others' order kept
            std::vector<double> one(std::size_t(n) + 7);
            // Seven boxes of no volume in front shift the lanes; their lengths are 0.
            const SeedBox nothing{.centre_m = {1e6, 1e6, 1e6}, .size_m = {1, 1, 1}};
            rotated.boxes.insert(rotated.boxes.begin(), 7, nothing);
            absorb_light(rotated, {}, light, one);
            EXPECT_EQ(one[std::size_t(i) + 7], all[std::size_t(i)]);
        }
    }
}

// Two boxes of 100 m above each other, the upper one at the rim: while the cloud forms it is not there and takes no light.
TEST(LightAbsorptionUpdate, CountsBoxesAsFarAsTheyAreThere) {
    const Cloud cloud = cloud_of({{.centre_m = {0, 0, 50}, .size_m = {100, 100, 100}, .distance = 0},
                                  {.centre_m = {0, 0, 250}, .size_m = {100, 100, 100}, .distance = 0}},
                                 400);
    Cloud placed = cloud;
    placed.boxes[0].distance = 0;
    placed.boxes[1].distance = 1;
    LightAbsorption light;
    const auto lower_at = [&](double phase, std::size_t computed) {
        const CloudToLight lit{7, &placed, {0, 0, 0}, {{0, 0, 1}, true}, phase, 0.5};
        EXPECT_EQ(light.update({&lit, 1}), computed) << phase;
        return light.absorbed(7)[0];
    };
    // Weights by phase_weight(): (1.5 phase - distance) / 0.5.
    EXPECT_DOUBLE_EQ(lower_at(0.2, 1), 0.6 * 50 / 400);
    EXPECT_DOUBLE_EQ(lower_at(0.5, 1), 50.0 / 400);
    EXPECT_DOUBLE_EQ(lower_at(0.5, 0), 50.0 / 400);
    EXPECT_NEAR(lower_at(0.8, 1), (50 + 0.4 * 100) / 400, 1e-12);
    EXPECT_DOUBLE_EQ(lower_at(1, 1), 150.0 / 400);
}

TEST(LightAbsorptionUpdate, OnlyWhereTheLightMoved) {
    std::mt19937_64 random(4);
    std::vector<Cloud> shapes;
    for (int i = 0; i < 5; ++i) shapes.push_back(random_cloud(random, 6));
    const Light noon{{0, 0, 1}, true}, evening{{1, 0, 0.1}, true};
    std::vector<CloudToLight> clouds;
    for (std::uint64_t i = 0; i < 5; ++i)
        clouds.push_back({100 + i, &shapes[i], {double(i) * 1000, 0, 500}, noon});
    LightAbsorption absorption;
    EXPECT_TRUE(absorption.absorbed(100).empty());
    EXPECT_EQ(absorption.update(clouds), 5u);
    EXPECT_EQ(absorption.update(clouds), 0u);  // the light stands still
    LightAbsorption other;
    EXPECT_EQ(other.update(std::vector{clouds[0], clouds[0]}), 1u);  // named twice, computed once
    for (CloudToLight& c : clouds) c.position_m.x += 77;
    EXPECT_EQ(absorption.update(clouds), 0u);  // the sun is as far as before

    // Each cloud has the light that it was given, whatever the others have.
    for (std::size_t i = 0; i < 5; ++i) {
        clouds[i].light = evening;
        EXPECT_EQ(absorption.update(clouds), 1u);
        for (std::size_t j = 0; j < 5; ++j) {
            EXPECT_TRUE(std::ranges::equal(absorption.absorbed(100 + j),
                                           absorbed_light(shapes[j], {}, j <= i ? evening : noon)));
        }
    }
    // A flash near drifting clouds is recomputed; a cloud that is gone is forgotten.
    for (CloudToLight& c : clouds) c.light = {{0, 0, 3000}, false};
    EXPECT_EQ(absorption.update(clouds), 5u);
    clouds[1].position_m.y += 1;
    EXPECT_EQ(absorption.update(clouds), 1u);
    clouds[0].id = 7;
    EXPECT_EQ(absorption.update(clouds), 1u);
    EXPECT_FALSE(absorption.absorbed(7).empty());
    EXPECT_TRUE(absorption.absorbed(100).empty());
}

}  // namespace
}  // namespace nephos
