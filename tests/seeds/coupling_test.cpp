// SPDX-License-Identifier: Apache-2.0
#include "seeds/coupling.h"

#include <cmath>

#include "tests/seeds/fixtures.h"

namespace nephos {
namespace {

// One ellipsoid a box, at its place in the world, with its form.
TEST(Coupling, EveryBoxBecomesAnEllipsoid) {
    BaseModel model = test::branching_model();
    model.seeds[0].size_m = {100, 60, 20};
    model.seeds[0].strength = 0.5;
    const Cloud cloud = reproduce(model, 1, 0, 0);
    CouplingOptions options{.strength = 0.8,
                            .size_scale = 2,
                            .min_semi_axis_m = 25,
                            .size_at_birth = 1,
                            .centre = {0.2, 0.01, 0.05},
                            .rim = {0.01, 0, 0.1}};
    std::vector<ActiveEllipsoid> out;
    append_ellipsoids(out, model, cloud, {1000, 2000, 500}, 1, 0.5, options);
    ASSERT_EQ(out.size(), cloud.boxes.size());
    for (std::size_t i = 0; i < out.size(); ++i) {
        const Ellipsoid& e = out[i].ellipsoid;
        EXPECT_NEAR(out[i].weight, 0.4, 1e-15);
        EXPECT_EQ(e.centre_m, (Vec3{1000 + cloud.boxes[i].centre_m.x, 2000 + cloud.boxes[i].centre_m.y,
                                    500 + cloud.boxes[i].centre_m.z}));
        EXPECT_EQ(e.semi_axes_m, (Vec3{100, 60, 25}));
        EXPECT_EQ(e.centre, options.centre);
        EXPECT_EQ(e.rim, options.rim);
    }
}

// Weight and size follow the phase of each box: the centre before the edge, nothing at phase 0.
TEST(Coupling, FollowsThePhase) {
    const BaseModel model = test::branching_model();
    const Cloud cloud = reproduce(model, 1, 0, 0);
    const CouplingOptions options{.size_scale = 1, .size_at_birth = 0.5};
    std::vector<ActiveEllipsoid> none, some, all;
    append_ellipsoids(none, model, cloud, {}, 0, 0.5, options);
    append_ellipsoids(some, model, cloud, {}, 0.5, 0.5, options);
    append_ellipsoids(all, model, cloud, {}, 1, 0.5, options);
    EXPECT_TRUE(none.empty());
    EXPECT_EQ(all.size(), cloud.boxes.size());
    EXPECT_GT(some.size(), 0u);
    EXPECT_LT(some.size(), all.size());
    for (const ActiveEllipsoid& e : some) {
        EXPECT_NEAR(e.ellipsoid.semi_axes_m.x, 5 * (0.5 + 0.5 * e.weight), 1e-12);
        const Vec3& c = e.ellipsoid.centre_m;
        const double d = std::hypot(c.x - cloud.centre_m.x, c.y - cloud.centre_m.y, c.z - cloud.centre_m.z);
        for (const ActiveEllipsoid& f : some) {
            const Vec3& g = f.ellipsoid.centre_m;
            const double other =
                std::hypot(g.x - cloud.centre_m.x, g.y - cloud.centre_m.y, g.z - cloud.centre_m.z);
            if (d < other) {
                EXPECT_GE(e.weight, f.weight);
            }
        }
    }
    CouplingOptions off = options;
    off.strength = 0;
    append_ellipsoids(none, model, cloud, {}, 1, 0.5, off);
    EXPECT_TRUE(none.empty());
}

TEST(Coupling, WholeSky) {
    SkyOptions options = test::small_sky();
    options.models[0] = test::branching_model();
    SkySimulation sky(options);
    std::size_t boxes = 0;
    for (const SkyCloud& c : sky.clouds()) boxes += sky.shape(c).boxes.size();
    const auto ellipsoids = ellipsoids_of(sky, {});
    ASSERT_EQ(ellipsoids.size(), boxes);
    const SkyCloud& last = sky.clouds().back();
    const Vec3 p = sky.position_m(last), c = sky.shape(last).boxes.back().centre_m;
    EXPECT_EQ(ellipsoids.back().ellipsoid.centre_m, (Vec3{p.x + c.x, p.y + c.y, p.z + c.z}));
    test::expect_error(ErrorCode::usage, "strength", [&] { (void)ellipsoids_of(sky, {.strength = -1}); });
    test::expect_error(ErrorCode::usage, "size scale", [&] { (void)ellipsoids_of(sky, {.size_scale = 0}); });
    test::expect_error(ErrorCode::usage, "p_hum", [&] { (void)ellipsoids_of(sky, {.centre = {2, 0, 0}}); });
}

}  // namespace
}  // namespace nephos
