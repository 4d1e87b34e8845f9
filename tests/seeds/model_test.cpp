// SPDX-License-Identifier: Apache-2.0
#include "seeds/model.h"

#include <cmath>
#include <set>

#include "core/math.h"
#include "seeds/draw.h"
#include "tests/seeds/fixtures.h"

namespace nephos {
namespace {

using test::branching_model;
using test::expect_error;

Vec3 minus(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
double dot(const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
double length(const Vec3& a) { return std::sqrt(dot(a, a)); }

BaseModel one_root(Root root, Vec3 size = {20, 20, 20}) {
    Seed seed;
    seed.size_m = size;
    seed.position_m = {5, -7, 100};
    seed.roots = {root};
    return {.name = "one root", .genus = {}, .seeds = {seed}};
}

TEST(Trigonometry, AgreesWithLibm) {
    for (double degrees = -1000; degrees < 1000; degrees += 0.37) {
        const double radians = degrees * (M_PI / 180);
        const Rotation r = rotation_of_degrees(degrees);
        EXPECT_NEAR(r.cos, std::cos(radians), 1e-14) << degrees;
        EXPECT_NEAR(r.sin, std::sin(radians), 1e-14) << degrees;
        const double back = degrees_of_vector(3 * r.cos, 3 * r.sin);
        EXPECT_NEAR(back, std::atan2(r.sin, r.cos) * (180 / M_PI), 1e-11) << degrees;
    }
    EXPECT_EQ(rotation_of_degrees(90).sin, 1);
    EXPECT_EQ(rotation_of_degrees(90).cos, 0);
    EXPECT_EQ(degrees_of_vector(-2, 0), 180);
    EXPECT_EQ(degrees_of_vector(0, 0), 0);
}

// T: from seeds start to seeds end, linear over the drawn number of levels; 2..3 over 3 levels passes 2.5.
TEST(Reproduction, ChildrenAreInterpolated) {
    const Root grows{.seeds_start = 2, .seeds_end = 8};
    EXPECT_EQ(children_of_level(grows, 1, 4), 2);
    EXPECT_EQ(children_of_level(grows, 2, 4), 4);
    EXPECT_EQ(children_of_level(grows, 3, 4), 6);
    EXPECT_EQ(children_of_level(grows, 4, 4), 8);
    const Root shrinks{.seeds_start = 5, .seeds_end = 0};
    EXPECT_EQ(children_of_level(shrinks, 1, 2), 5);
    EXPECT_EQ(children_of_level(shrinks, 2, 2), 0);
    const Root half{.seeds_start = 2, .seeds_end = 3};
    EXPECT_EQ(children_of_level(half, 2, 3), 3);  // 2.5 up
    EXPECT_EQ(children_of_level(half, 1, 1), 2);  // one level: the first
}

// Every child lies at level * radius from the seed that owns the root, in the cone, and has the parent's
// size.
TEST(Reproduction, ChildrenStandWhereTheFormulaSays) {
    const Root root{.pitch_deg = 35,
                    .yaw_deg = 120,
                    .open_pitch_deg = 50,
                    .open_yaw_deg = 50,
                    .seeds_start = 3,
                    .seeds_end = 9,
                    .reproductions = {4, 4}};
    const BaseModel model = one_root(root, {20, 30, 10});
    const double radius = std::sqrt(20.0 * 20 + 30 * 30 + 10 * 10) / 2;
    const double p = 35 * M_PI / 180, y = 120 * M_PI / 180;
    const Vec3 axis{std::cos(p) * std::cos(y), std::cos(p) * std::sin(y), std::sin(p)};
    double widest = 0;
    for (std::uint32_t number = 0; number < 50; ++number) {
        const Cloud cloud = reproduce(model, 7, 3, number);
        ASSERT_EQ(cloud.boxes.size(), 1u + 3 + 5 + 7 + 9);
        EXPECT_EQ(cloud.boxes[0].level, 0);
        EXPECT_EQ(cloud.boxes[0].centre_m, model.seeds[0].position_m);
        int of_level[5] = {};
        for (const SeedBox& box : cloud.boxes) {
            ++of_level[box.level];
            EXPECT_EQ(box.size_m, model.seeds[0].size_m);
            if (box.level == 0) continue;
            const Vec3 way = minus(box.centre_m, model.seeds[0].position_m);
            EXPECT_NEAR(length(way), radius * box.level, 1e-9);
            const double angle = std::acos(dot(way, axis) / length(way)) * 180 / M_PI;
            EXPECT_LE(angle, 25 + 1e-6);
            widest = std::max(widest, angle);
        }
        EXPECT_EQ(of_level[1], 3);
        EXPECT_EQ(of_level[4], 9);
    }
    EXPECT_GT(widest, 24.5);  // the whole cone is used
}

TEST(Reproduction, ClosedRootIsALine) {
    const BaseModel model = one_root({.pitch_deg = 90,
                                      .open_pitch_deg = 0,
                                      .open_yaw_deg = 0,
                                      .seeds_start = 1,
                                      .seeds_end = 1,
                                      .reproductions = {3, 3},
                                      .radius = RootRadius::box},
                                     {200, 200, 10});
    const Cloud cloud = reproduce(model, 1, 0, 0);
    ASSERT_EQ(cloud.boxes.size(), 4u);
    for (int level = 1; level <= 3; ++level) {
        const Vec3 way = minus(cloud.boxes[std::size_t(level)].centre_m, model.seeds[0].position_m);
        EXPECT_NEAR(way.x, 0, 1e-12);
        EXPECT_NEAR(way.y, 0, 1e-12);
        EXPECT_NEAR(way.z, 5.0 * level, 1e-12);  // to the top face of the flat box
    }
}

// An elliptic opening: wide in yaw, narrow in pitch.
TEST(Reproduction, OpeningsAreSeparate) {
    const BaseModel model =
        one_root({.open_pitch_deg = 10, .open_yaw_deg = 80, .seeds_start = 2000, .seeds_end = 2000});
    const Cloud cloud = reproduce(model, 5, 0, 0);
    double yaw = 0, pitch = 0;
    for (const SeedBox& box : cloud.boxes) {
        if (box.level == 0) continue;
        const Vec3 d = minus(box.centre_m, model.seeds[0].position_m);
        yaw = std::max(yaw, std::abs(std::atan2(d.y, d.x)) * 180 / M_PI);
        pitch = std::max(pitch, std::abs(std::asin(d.z / length(d))) * 180 / M_PI);
    }
    EXPECT_LE(yaw, 40 + 1e-9);
    EXPECT_GT(yaw, 38);
    EXPECT_LE(pitch, 5 + 1e-9);
    EXPECT_GT(pitch, 4.5);
}

// Open on all sides: directions uniform on the sphere. Means within 4 sigma of 0, second moments of 1/3.
TEST(Reproduction, FullOpeningIsUniform) {
    const int n = 10000;
    const BaseModel model =
        one_root({.open_pitch_deg = 360, .open_yaw_deg = 360, .seeds_start = n, .seeds_end = n});
    const Cloud cloud = reproduce(model, 11, 0, 0);
    Vec3 mean{}, square{};
    for (const SeedBox& box : cloud.boxes) {
        if (box.level == 0) continue;
        const Vec3 way = minus(box.centre_m, model.seeds[0].position_m);
        const Vec3 d{way.x / length(way), way.y / length(way), way.z / length(way)};
        mean = {mean.x + d.x / n, mean.y + d.y / n, mean.z + d.z / n};
        square = {square.x + d.x * d.x / n, square.y + d.y * d.y / n, square.z + d.z * d.z / n};
    }
    const double sigma = std::sqrt(1.0 / 3 / n), sigma2 = std::sqrt((1.0 / 5 - 1.0 / 9) / n);
    for (double m : {mean.x, mean.y, mean.z}) EXPECT_NEAR(m, 0, 4 * sigma);
    for (double m : {square.x, square.y, square.z}) EXPECT_NEAR(m, 1.0 / 3, 4 * sigma2);
}

// The numbers of levels and of billboards are uniform over their ranges.
TEST(Reproduction, CountsAreDrawnUniformly) {
    BaseModel model = one_root({.seeds_start = 1, .seeds_end = 1, .reproductions = {2, 5}});
    model.seeds[0].billboards = {3, 5};
    int levels[6] = {}, billboards[6] = {};
    const int clouds = 4000;
    int boxes = 0;
    for (std::uint32_t number = 0; number < clouds; ++number) {
        const Cloud cloud = reproduce(model, 3, 1, number);
        ++levels[cloud.boxes.back().level];
        for (const SeedBox& box : cloud.boxes) {
            ASSERT_TRUE(box.billboards >= 3 && box.billboards <= 5);
            ++billboards[box.billboards];
            ++boxes;
        }
    }
    EXPECT_EQ(levels[0] + levels[1], 0);
    for (int l = 2; l <= 5; ++l) EXPECT_NEAR(levels[l], clouds / 4.0, 4 * std::sqrt(clouds * 0.25 * 0.75));
    for (int b = 3; b <= 5; ++b) EXPECT_NEAR(billboards[b], boxes / 3.0, 4 * std::sqrt(boxes * 2.0 / 9));
}

// A cloud is a function of (scene seed, base model, number), and each of them makes another cloud.
TEST(Reproduction, IsAFunctionOfItsName) {
    const BaseModel model = branching_model();
    const Cloud cloud = reproduce(model, 1, 2, 3);
    EXPECT_EQ(cloud, reproduce(model, 1, 2, 3));
    EXPECT_NE(cloud, reproduce(model, 2, 2, 3));
    EXPECT_NE(cloud, reproduce(model, 1, 3, 3));
    EXPECT_NE(cloud, reproduce(model, 1, 2, 4));
    std::set<double> places;  // no two boxes of a cloud share their draws
    for (const SeedBox& box : cloud.boxes) places.insert(box.centre_m.x);
    EXPECT_EQ(places.size(), cloud.boxes.size());
    std::set<double> radii;
    for (std::uint32_t number = 0; number < 500; ++number)
        radii.insert(reproduce(model, 1, 2, number).radius_m);
    EXPECT_EQ(radii.size(), 500u);
}

// The same bits with every compiler, optimisation level and C library.
TEST(Reproduction, GoldenFingerprint) {
    test::Fingerprint f;
    for (std::uint32_t number = 0; number < 100; ++number) {
        const Cloud cloud = reproduce(branching_model(), 0x123456789abcdef0, 17, number);
        for (const SeedBox& box : cloud.boxes) {
            f.add(box.centre_m);
            f.add(box.distance);
            f.add(std::uint64_t(box.billboards));
        }
        f.add(cloud.radius_m);
        for (const Billboard& b :
             scatter_billboards(branching_model(), cloud, 0x123456789abcdef0, 17, number)) {
            f.add(b.centre_m);
            f.add(b.width_m);
            f.add(std::uint64_t(b.variant));
        }
    }
    EXPECT_EQ(f.value(), 0x8fe8952f9eee17cdull);
}

// Random words of clouds, skies and the automaton's own domains never come from one counter: equal outputs
// would be an accident of 2^-128 a pair.
TEST(Draws, NeverShareACounter) {
    std::set<PhiloxWords> seen;
    std::size_t drawn = 0;
    const auto add = [&](const PhiloxWords& words) {
        seen.insert(words);
        ++drawn;
    };
    for (std::uint32_t a = 0; a < 5; ++a) {
        for (std::uint32_t b = 0; b < 5; ++b) {
            for (std::uint32_t c = 0; c < 5; ++c) {
                for (auto kind : {SeedDraw::box, SeedDraw::root, SeedDraw::child})
                    add(draw_for_cloud(1, a, b, kind, c));
                for (std::uint32_t sub = 0; sub < 4; ++sub)
                    add(draw_for_cloud(1, a, b, SeedDraw::billboard, c, sub));
                add(philox(1, item_counter(Domain::field, a, b, c, 0)));
            }
            for (auto kind : {SkyDraw::cloud, SkyDraw::place, SkyDraw::dissolve})
                add(draw_for_sky(1, a, kind, b));
            for (auto draw : {Draw::counts, Draw::hum, Draw::act, Draw::ext, Draw::births, Draw::extinctions}) {
                add(philox(1, block_counter(Domain::lattice, draw, a, int(b), 0, 0, 0)));
            }
        }
    }
    EXPECT_EQ(seen.size(), drawn);
}

TEST(Billboards, LieInTheirBoxes) {
    const BaseModel model = branching_model();
    const Cloud cloud = reproduce(model, 4, 0, 9);
    const auto billboards = scatter_billboards(model, cloud, 4, 0, 9);
    std::vector<int> in_box(cloud.boxes.size());
    for (const Billboard& b : billboards) {
        const SeedBox& box = cloud.boxes[b.box];
        ++in_box[b.box];
        EXPECT_LE(std::abs(b.centre_m.x - box.centre_m.x), box.size_m.x / 2);
        EXPECT_LE(std::abs(b.centre_m.y - box.centre_m.y), box.size_m.y / 2);
        EXPECT_LE(std::abs(b.centre_m.z - box.centre_m.z), box.size_m.z / 2);
        EXPECT_TRUE(b.width_m >= 30 && b.width_m <= 50 && b.height_m >= 30 && b.height_m <= 50);
    }
    for (std::size_t i = 0; i < in_box.size(); ++i) EXPECT_EQ(in_box[i], cloud.boxes[i].billboards);
}

TEST(BaseModelCheck, NamesEveryBadValue) {
    EXPECT_NO_THROW(check(branching_model()));
    const auto refuse = [](const std::string& part, auto&& change) {
        BaseModel model = branching_model();
        change(model);
        expect_error(ErrorCode::usage, part, [&] { check(model); });
        expect_error(ErrorCode::usage, "branching", [&] { check(model); });
    };
    refuse("no seed", [](BaseModel& m) { m.seeds.clear(); });
    refuse("width", [](BaseModel& m) { m.seeds[0].size_m.x = -1; });
    refuse("depth", [](BaseModel& m) { m.seeds[0].size_m.y = 0; });
    refuse("height", [](BaseModel& m) { m.seeds[0].size_m.z = NAN; });
    refuse("position", [](BaseModel& m) { m.seeds[0].position_m.z = INFINITY; });
    refuse("billboards", [](BaseModel& m) { m.seeds[0].billboards = {5, 2}; });
    refuse("billboard width", [](BaseModel& m) { m.seeds[0].billboard_width_m = {50, 30}; });
    refuse("billboard height", [](BaseModel& m) { m.seeds[0].billboard_height_m = {-1, 30}; });
    refuse("billboard width", [](BaseModel& m) { m.seeds[0].billboard_width_m = {30, 60'001}; });
    refuse("billboard height", [](BaseModel& m) { m.seeds[0].billboard_height_m = {1e-300, 30}; });
    refuse("strength", [](BaseModel& m) { m.seeds[0].strength = 2; });
    refuse("reproductions", [](BaseModel& m) { m.seeds[0].roots[1].reproductions = {3, 2}; });
    refuse("seeds start", [](BaseModel& m) { m.seeds[0].roots[0].seeds_start = -1; });
    refuse("seeds end", [](BaseModel& m) { m.seeds[0].roots[0].seeds_end = 20000; });
    refuse("pitch", [](BaseModel& m) { m.seeds[0].roots[0].pitch_deg = 1000; });
    refuse("open yaw", [](BaseModel& m) { m.seeds[0].roots[0].open_yaw_deg = -5; });
    refuse("light distance", [](BaseModel& m) { m.light_distance_m = 0; });
    refuse("at most", [](BaseModel& m) {
        m.seeds[0].roots[0].seeds_end = 10000;
        m.seeds[0].roots[0].reproductions = {1, 10000};
    });
}

}  // namespace
}  // namespace nephos
