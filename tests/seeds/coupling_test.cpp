// SPDX-License-Identifier: Apache-2.0
#include "seeds/coupling.h"

#include <algorithm>
#include <bit>
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

// Dark rain clouds and bright fair ones in one layer: a model's own probabilities come before those of its genus, these
// before the layer's.
TEST(Coupling, ModelsAndGeneraHaveProbabilitiesOfTheirOwn) {
    CouplingOptions options;
    options.centre = {0.1, 0, 0};
    options.rim = {0.01, 0, 0};
    options.genera = {{Genus::Ns, {0.2, 0, 0}, {0.02, 0, 0}}, {std::nullopt, {0.3, 0, 0}, {0.03, 0, 0}}};
    BaseModel model = test::single_box_model(100);
    model.genus = Genus::Cu;
    EXPECT_EQ(probabilities_of(model, options).centre.hum, 0.1);
    model.genus = Genus::Ns;
    EXPECT_EQ(probabilities_of(model, options).centre.hum, 0.2);
    EXPECT_EQ(probabilities_of(model, options).rim.hum, 0.02);
    model.own_centre = true;
    model.centre = {0.4, 0, 0};
    EXPECT_EQ(probabilities_of(model, options).centre.hum, 0.4);
    EXPECT_EQ(probabilities_of(model, options).rim.hum, 0.02) << "the rim is still the genus's";
    model.genus.reset();
    model.own_rim = true;
    model.rim = {0.05, 0, 0};
    EXPECT_EQ(probabilities_of(model, options).rim.hum, 0.05);
    std::vector<ActiveEllipsoid> out;
    append_ellipsoids(out, model, reproduce(model, 1, 0, 0), {}, 1, 0.5, options);
    ASSERT_EQ(out.size(), 1u);
    EXPECT_EQ(out[0].ellipsoid.centre, model.centre);
    EXPECT_EQ(out[0].ellipsoid.rim, model.rim);
    options.genera[0].centre.act = 1.5;
    test::expect_error(ErrorCode::usage, "coupling of a genus", [&] { check(options); });
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

// The automaton follows: without clouds nothing grows, with them cloud grows inside the ellipsoids, it moves
// with them, and it is gone some time after they have dissolved.
TEST(Coupling, DrivesTheAutomaton) {
    SkyOptions options = test::small_sky();
    options.world = {0, 0, 6400, 6400};
    options.models = {test::single_box_model(600)};
    options.skies = {{"clear", 0, 0, {}}, {"some", 1, 6, {{0, 1}}}};
    options.schedule = {{0, 1}, {600, 1}, {610, 0}};
    options.wind = test::constant_wind(5, 0);
    options.base_height_m = {500, 500};
    SkySimulation sky(options);
    AutomatonOptions lattice;
    lattice.extent = {128, 128, 20};
    lattice.placement = {{0, 0, 0}, 50};
    lattice.wind = options.wind;
    lattice.field.background = {0, 0, 0.1};
    Automaton coupled(lattice), alone(lattice);
    const CouplingOptions coupling{.centre = {0.3, 0.05, 0.05}};
    const auto count = [](const BitPlaneView& plane) {
        std::size_t cells = 0;
        for (std::size_t w = 0; w < plane.word_count(); ++w)
            cells += std::size_t(std::popcount(plane.words[w]));
        return cells;
    };
    for (int step = 0; step < 60; ++step) {
        coupled.set_external_ellipsoids(ellipsoids_of(sky, coupling));
        coupled.step();
        alone.step();
        sky.step();
    }
    EXPECT_EQ(count(alone.cld()), 0u);
    EXPECT_GT(count(coupled.cld()), 500u);
    // Cloud may creep out by its own growth, but most of it is where the ellipsoids are now.
    const auto ellipsoids = ellipsoids_of(sky, coupling);
    std::size_t inside = 0, all = 0;
    const BitPlaneView cld = coupled.cld();
    for (int k = 0; k < 20; ++k) {
        for (int j = 0; j < 128; ++j) {
            for (int i = 0; i < 128; ++i) {
                if (!cld.get(i, j, k)) continue;
                ++all;
                inside += std::ranges::any_of(ellipsoids, [&](const ActiveEllipsoid& a) {
                    const Vec3 &c = a.ellipsoid.centre_m, &s = a.ellipsoid.semi_axes_m;
                    return std::hypot((i * 50 + 25 - c.x) / s.x, (j * 50 + 25 - c.y) / s.y,
                                      (k * 50 + 25 - c.z) / s.z) < 1.2;
                });
            }
        }
    }
    EXPECT_GT(double(inside) / double(all), 0.9);
    for (int step = 0; step < 120; ++step) {
        sky.step();
        coupled.set_external_ellipsoids(ellipsoids_of(sky, coupling));
        coupled.step();
    }
    EXPECT_TRUE(sky.clouds().empty());
    EXPECT_LT(count(coupled.cld()), 50u);
}

}  // namespace
}  // namespace nephos
