// SPDX-License-Identifier: Apache-2.0
#include "seeds/cloud.h"

#include <algorithm>
#include <cmath>
#include <random>

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

FrustumView some_view() {
    return {.eye_m = {10, -20, 5},
            .forward = {1, 2, 0.3},
            .up = {0, 0, 1},
            .fov_y_deg = 50,
            .aspect = 1.6,
            .near_m = 2,
            .far_m = 300};
}

// A point of the frustum by its own coordinates: depth and the two tangents as fractions of their limits.
Vec3 point_of(const FrustumView& v, double depth, double right, double up) {
    const auto cross = [](Vec3 a, Vec3 b) {
        return Vec3{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    };
    const Vec3 f = glm::normalize(v.forward), r = glm::normalize(cross(f, v.up)), u = cross(r, f);
    const double ty = std::tan(v.fov_y_deg * M_PI / 360), tx = ty * v.aspect;
    const auto at = [&](double e, double fo, double ri, double uu) {
        return e + depth * (fo + right * tx * ri + up * ty * uu);
    };
    return {at(v.eye_m.x, f.x, r.x, u.x), at(v.eye_m.y, f.y, r.y, u.y), at(v.eye_m.z, f.z, r.z, u.z)};
}

TEST(Culling, FrustumHoldsItsPointsAndItsSphereTheCorners) {
    for (double far_m : {3.0, 300.0}) {
        FrustumView view = some_view();
        view.far_m = far_m;
        const Frustum frustum = frustum_of(view);
        for (double depth : {view.near_m, (view.near_m + far_m) / 2, far_m}) {
            for (double right : {-1.0, 0.0, 1.0}) {
                for (double up : {-1.0, 0.0, 1.0}) {
                    const Vec3 p = point_of(view, depth, right, up);
                    EXPECT_LE(distance(p, frustum.sphere.centre_m), frustum.sphere.radius_m + 1e-9);
                    for (const Plane& plane : frustum.planes) {
                        EXPECT_GE(plane.normal.x * p.x + plane.normal.y * p.y + plane.normal.z * p.z +
                                      plane.offset_m,
                                  -1e-9);
                    }
                    EXPECT_TRUE(may_see(frustum, {p, 1e-6}));
                }
            }
        }
        EXPECT_NEAR(distance(point_of(view, far_m, 1, 1), frustum.sphere.centre_m), frustum.sphere.radius_m,
                    1e-9);
        EXPECT_FALSE(may_see(frustum, {point_of(view, far_m * 1.01, 0, 0), far_m * 0.005}));
        EXPECT_FALSE(may_see(frustum, {point_of(view, view.near_m * 0.9, 0, 0), view.near_m * 0.05}));
        EXPECT_FALSE(may_see(frustum, {point_of(view, far_m / 2, 1.2, 0), far_m * 0.01}));
        EXPECT_FALSE(may_see(frustum, {point_of(view, far_m / 2, 0, -1.2), far_m * 0.01}));
    }
}

// Brute force: a sphere of which one of many sampled frustum points is inside must be seen; one of which
// every plane has it wholly outside, tested one by one without the spheres, must not.
TEST(Culling, AgreesWithBruteForce) {
    const FrustumView view = some_view();
    const Frustum frustum = frustum_of(view);
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> u(-1, 1), unit(0, 1);
    std::vector<Vec3> samples;
    for (int i = 0; i < 20000; ++i) {
        samples.push_back(point_of(view, view.near_m + (view.far_m - view.near_m) * std::cbrt(unit(random)),
                                   u(random), u(random)));
    }
    std::vector<Sphere> spheres;
    for (int i = 0; i < 1500; ++i)
        spheres.push_back({{u(random) * 500, u(random) * 500, u(random) * 500}, 5 + 60 * unit(random)});
    std::size_t visible = 0, drawn_count = 0;
    for (std::uint32_t i = 0; i < spheres.size(); ++i) {
        const bool drawn = may_see(frustum, spheres[i]);
        drawn_count += drawn;
        const bool touches = std::ranges::any_of(
            samples, [&](const Vec3& p) { return distance(p, spheres[i].centre_m) < spheres[i].radius_m; });
        visible += touches;
        if (touches) {
            EXPECT_TRUE(drawn) << i;
        }
        const Vec3& c = spheres[i].centre_m;
        const bool behind_a_plane = std::ranges::any_of(frustum.planes, [&](const Plane& p) {
            return p.normal.x * c.x + p.normal.y * c.y + p.normal.z * c.z + p.offset_m < -spheres[i].radius_m;
        });
        const bool spheres_apart =
            distance(c, frustum.sphere.centre_m) > spheres[i].radius_m + frustum.sphere.radius_m;
        EXPECT_EQ(drawn, !behind_a_plane && !spheres_apart) << i;
    }
    EXPECT_GT(visible, 50u);
    EXPECT_LT(drawn_count, spheres.size() / 2);
}

TEST(Culling, RefusesBadViews) {
    const auto refuse = [](const std::string& part, auto&& change) {
        FrustumView view = some_view();
        change(view);
        test::expect_error(ErrorCode::usage, part, [&] { (void)frustum_of(view); });
    };
    refuse("field of view", [](FrustumView& v) { v.fov_y_deg = 180; });
    refuse("far", [](FrustumView& v) { v.far_m = v.near_m; });
    refuse("near", [](FrustumView& v) { v.near_m = 0; });
    refuse("aspect", [](FrustumView& v) { v.aspect = NAN; });
    refuse("forward", [](FrustumView& v) { v.forward = {}; });
    refuse("up", [](FrustumView& v) { v.up = v.forward; });
}

}  // namespace
}  // namespace nephos
