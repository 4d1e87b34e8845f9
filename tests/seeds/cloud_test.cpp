// SPDX-License-Identifier: Apache-2.0
#include "seeds/cloud.h"

#include <algorithm>
#include <cmath>

#include "tests/seeds/fixtures.h"

namespace nephos {
namespace {

double distance(const Vec3& a, const Vec3& b) { return std::hypot(a.x - b.x, a.y - b.y, a.z - b.z); }

// The sphere holds every corner of every box and touches one.
TEST(Cloud, RadiusIsTheSmallest) {
    for (std::uint32_t number = 0; number < 20; ++number) {
        const Cloud cloud = reproduce(test::branching_model(), 1, 0, number);
        double farthest = 0;
        for (const SeedBox& box : cloud.boxes) {
            for (int corner = 0; corner < 8; ++corner) {
                const auto edge = [&](int axis, double size) {
                    return (corner >> axis & 1 ? 0.5 : -0.5) * size;
                };
                farthest =
                    std::max(farthest, distance(cloud.centre_m, {box.centre_m.x + edge(0, box.size_m.x),
                                                                 box.centre_m.y + edge(1, box.size_m.y),
                                                                 box.centre_m.z + edge(2, box.size_m.z)}));
            }
        }
        EXPECT_NEAR(cloud.radius_m, farthest, 1e-9);
        double most = 0;
        for (const SeedBox& box : cloud.boxes) most = std::max(most, box.distance);
        EXPECT_EQ(most, 1);
    }
    const Cloud single = reproduce(test::single_box_model(20), 1, 0, 0);
    EXPECT_NEAR(single.radius_m, 10 * std::sqrt(3.0), 1e-12);
    EXPECT_EQ(single.boxes[0].distance, 0);
    Cloud empty;
    enclose(empty);
    EXPECT_EQ(empty.radius_m, 0);
}

// Forming: the centre first, the edge last, no jumps; the same function backwards dissolves the edge first.
TEST(Formation, GoesFromTheCentreOutwards) {
    for (double softness : {0.1, 0.5, 2.0}) {
        for (double d : {0.0, 0.25, 1.0}) {
            EXPECT_EQ(phase_weight(d, 0, softness), 0);
            EXPECT_NEAR(phase_weight(d, 1, softness), 1, 1e-12);
        }
        double before_centre = 0, before_edge = 0;
        const double step = 0.001, slope = (1 + softness) / softness;
        for (double phase = 0; phase <= 1; phase += step) {
            const double centre = phase_weight(0, phase, softness), edge = phase_weight(1, phase, softness);
            EXPECT_GE(centre, edge);
            EXPECT_GE(centre, before_centre);
            EXPECT_GE(edge, before_edge);
            EXPECT_LE(centre - before_centre, slope * step + 1e-12);
            EXPECT_LE(edge - before_edge, slope * step + 1e-12);
            before_centre = centre;
            before_edge = edge;
        }
    }
    EXPECT_EQ(phase_weight(1, 0.5, 0.5), 0);  // at half time the centre is there and the edge is not
    EXPECT_EQ(phase_weight(0, 0.5, 0.5), 1);
}

}  // namespace
}  // namespace nephos
