// SPDX-License-Identifier: Apache-2.0

// Wind that differs from place to place (core/wind_field.h, automaton/cell_motion.h): what a profile can do bit for
// bit, closed circuits, conservation, and a naive twin.

#include "automaton/cell_motion.h"

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "automaton/automaton.h"
#include "core/error.h"
#include "tests/reference/with_threads.h"

namespace nephos {
namespace {

WindField grid_field(const std::array<int, 3>& points, const std::function<Vec3(int, int, int)>& velocity,
                     const Vec3& first_m = {}, double spacing_m = 100) {
    SampleGrid grid{first_m, Vec3(spacing_m), points, 3, {}};
    for (int k = 0; k < points[2]; ++k)
        for (int j = 0; j < points[1]; ++j)
            for (int i = 0; i < points[0]; ++i)
                for (int part = 0; part < 3; ++part) grid.values.push_back(float(velocity(i, j, k)[part]));
    WindField field{.kind = WindFieldKind::grid};
    field.samples.push_back({0, std::make_shared<const SampleGrid>(std::move(grid))});
    return field;
}

WindField circulation(WindFieldKind kind, double radius_m, double speed, double x_m = 0, double y_m = 0) {
    return {.kind = kind, .x_m = x_m, .y_m = y_m, .radius_m = radius_m, .speed_m_per_s = speed, .direction_deg = 30,
            .bottom_m = 0, .top_m = 1e4};
}

Lattice empty_lattice(const Extent& e) { return {BitPlane(e), BitPlane(e), BitPlane(e)}; }

Lattice random_lattice(const Extent& e, double cover, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<> uniform;
    Lattice l = empty_lattice(e);
    for (int k = 0; k < e.z; ++k)
        for (int j = 0; j < e.y; ++j)
            for (int i = 0; i < e.x; ++i)
                for (BitPlane* plane : {&l.hum, &l.act, &l.cld}) plane->set(i, j, k, uniform(random) < cover);
    return l;
}

std::array<std::uint64_t, 3> counts(const Lattice& l) { return {l.hum.count(), l.act.count(), l.cld.count()}; }

AutomatonOptions still_options(const Extent& extent, double cell_m = 10, double step_s = 1) {
    AutomatonOptions o;
    o.extent = extent;
    o.placement = {{0, 0, 0}, cell_m};
    o.time_step_s = step_s;
    o.field.background = {};
    return o;
}

TEST(WindField, CirculationsHaveNoDivergence) {
    constexpr double h = 1e-3;
    for (const WindFieldKind kind : {WindFieldKind::thermal, WindFieldKind::roll, WindFieldKind::shear_line,
                                     WindFieldKind::vortex}) {
        WindField field = circulation(kind, 300, 5, 40, -70);
        field.top_m = 900;
        const std::vector<WindField> fields{field};
        double largest = 0;
        for (int n = 0; n < 500; ++n) {
            const Vec3 at(-400 + 1.7 * n, 300 - 1.3 * n, 10 + 1.75 * n);
            double divergence = 0;
            for (int axis = 0; axis < 3; ++axis) {
                Vec3 step{};
                step[axis] = h;
                divergence += (velocity_of(fields, at + step, 0)[axis] - velocity_of(fields, at - step, 0)[axis]) / (2 * h);
            }
            EXPECT_NEAR(divergence, 0, 1e-6) << int(kind) << " at " << at.x << ", " << at.y << ", " << at.z;
            largest = std::max(largest, length(velocity_of(fields, at, 0)));
        }
        EXPECT_GT(largest, 2) << int(kind);
    }
}

TEST(WindField, MeansWhatItsHeadSays) {
    const auto at = [](WindFieldKind kind, const Vec3& place) {
        WindField field = circulation(kind, 200, 8);
        field.direction_deg = 0;
        field.top_m = 1000;
        return velocity_of(std::span(&field, 1), place, 0);
    };
    EXPECT_NEAR(at(WindFieldKind::vortex, {200, 0, 1}).y, 8, 1e-12);
    EXPECT_NEAR(at(WindFieldKind::vortex, {0, 100, 1}).x, -4, 1e-12);
    EXPECT_NEAR(at(WindFieldKind::vortex, {800, 0, 1}).y, 2, 1e-12);
    EXPECT_NEAR(at(WindFieldKind::thermal, {0, 0, 500}).z, 8, 1e-12);
    EXPECT_LT(at(WindFieldKind::thermal, {150, 0, 500}).z, 0) << "sinking air around the core";
    EXPECT_LT(at(WindFieldKind::thermal, {100, 0, 100}).x, 0) << "inflow below";
    EXPECT_GT(at(WindFieldKind::thermal, {100, 0, 900}).x, 0) << "outflow above";
    EXPECT_NEAR(at(WindFieldKind::roll, {77, 0, 500}).z, 8, 1e-12);
    EXPECT_NEAR(at(WindFieldKind::roll, {77, 200, 500}).z, -8, 1e-12);
    EXPECT_NEAR(at(WindFieldKind::shear_line, {5, 300, 1}).x, 8, 1e-12);
    EXPECT_NEAR(at(WindFieldKind::shear_line, {5, -300, 1}).x, -8, 1e-12);
    EXPECT_EQ(at(WindFieldKind::vortex, {200, 0, 1001}), Vec3{});
}

TEST(WindField, GridsAreLinearInPlaceAndTime) {
    WindField field = grid_field({3, 2, 2}, [](int i, int j, int k) { return Vec3(i + 4 * k, 2 * j, -k); }, {50, 50, 50});
    EXPECT_EQ(velocity_of(std::span(&field, 1), {100, 125, 75}, 0), Vec3(1.5, 1.5, -0.25));
    EXPECT_EQ(velocity_of(std::span(&field, 1), {-900, 0, 9999}, 0), Vec3(4, 0, -1)) << "constant beyond";
    const WindField later = grid_field({1, 1, 1}, [](int, int, int) { return Vec3(10, 0, 0); });
    field.samples.push_back({20, later.samples[0].grid});
    EXPECT_EQ(velocity_of(std::span(&field, 1), {50, 50, 50}, 5).x, 2.5);
    EXPECT_EQ(velocity_of(std::span(&field, 1), {50, 50, 50}, 25).x, 10);
    EXPECT_FALSE(is_profile(std::span(&field, 1)));
    const WindField unread{.kind = WindFieldKind::grid, .files = {"wind.vdb"}};
    EXPECT_FALSE(is_profile(std::span(&unread, 1))) << "nobody knows yet";
    const WindField levels = grid_field({2, 2, 3}, [](int, int, int k) { return Vec3(k, 1, 0); });
    EXPECT_TRUE(is_profile(std::span(&levels, 1)));
}

// The bar of a field: where it is uniform, a run has the bits of the same wind as a profile, ellipsoids included.
TEST(CellMotion, AUniformFieldIsAProfileBitForBit) {
    AutomatonOptions profile;
    profile.extent = {70, 40, 16};
    profile.boundaries = {Boundary::periodic, Boundary::open, Boundary::open};
    profile.seed = 3;
    EllipsoidScatter scatter;
    scatter.count = 12;
    scatter.x_m = {0, 3500};
    scatter.y_m = {0, 2000};
    scatter.z_m = {0, 800};
    scatter.semi_axis_x_m = scatter.semi_axis_y_m = scatter.semi_axis_z_m = {100, 400};
    scatter.life_s = {200, 400};
    scatter.replace = true;
    profile.field.scatters = {scatter};
    AutomatonOptions field = profile, both = profile;
    profile.wind.keyframes = {{0, {{0, {3.75, -1.5}}}}};
    field.wind.fields = {grid_field({4, 4, 2}, [](int, int, int) { return Vec3(3.75, -1.5, 0); })};
    both.wind.keyframes = {{0, {{0, {1.25, -2}}}}};
    both.wind.fields = {grid_field({1, 2, 2}, [](int, int, int) { return Vec3(2.5, 0.5, 0); })};
    Automaton a(profile), b(field), c(both);
    for (int step = 0; step < 80; ++step) {
        a.step();
        b.step();
        c.step();
        ASSERT_EQ(a.hash(), b.hash()) << step;
        ASSERT_EQ(a.hash(), c.hash()) << step;
    }
    EXPECT_GT(a.cld().word_count(), 0u);
    EXPECT_EQ(a.ellipsoids().size(), b.ellipsoids().size());
    for (std::size_t n = 0; n < a.ellipsoids().size(); ++n)
        EXPECT_EQ(a.ellipsoids()[n].ellipsoid.centre_m, b.ellipsoids()[n].ellipsoid.centre_m);
}

// The second bar: a whole turn of a solid body brings a cloud back; on the way it has neither lost nor won a cell, and
// after a quarter turn it stands where it belongs.
TEST(CellMotion, ASolidBodyTurnsAndReturns) {
    const Extent e{80, 80, 3};
    AutomatonOptions o = still_options(e);
    constexpr int kSteps = 360;
    const double turn = 2 * 3.14159265358979323846 / kSteps;  // in each step of 1 s
    o.wind.fields = {circulation(WindFieldKind::vortex, 1e4, 1e4 * turn, 400, 400)};
    Lattice lattice = empty_lattice(e);
    const auto inside = [](double x, double y) {  // an ellipse aside of the axis, with a bite
        return std::hypot((x - 24) / 12, (y - 36) / 18) < 1 && std::hypot(x - 30, y - 30) > 6;
    };
    for (int k = 0; k < e.z; ++k)
        for (int j = 0; j < e.y; ++j)
            for (int i = 0; i < e.x; ++i) {
                lattice.cld.set(i, j, k, inside(i + 0.5, j + 0.5));
                lattice.hum.set(i, j, k, inside(i + 0.5, j + 0.5) && (i + 2 * j) % 5 == 0);
            }
    const Lattice start = lattice;
    CellMotion motion(e);
    std::uint64_t quarter = 0;
    for (int step = 0; step < kSteps; ++step) {
        motion.step(lattice, o, step);
        ASSERT_EQ(counts(lattice), counts(start)) << step;
        if (step + 1 != kSteps / 4) continue;
        for (int k = 0; k < e.z; ++k)
            for (int j = 0; j < e.y; ++j)
                for (int i = 0; i < e.x; ++i)  // (x, y) came from (y, 80 - x)
                    quarter += lattice.cld.get(i, j, k) && inside(j + 0.5, 80 - (i + 0.5));
    }
    std::uint64_t back = 0, back_hum = 0;
    for (int k = 0; k < e.z; ++k)
        for (int j = 0; j < e.y; ++j)
            for (int i = 0; i < e.x; ++i) {
                back += lattice.cld.get(i, j, k) && start.cld.get(i, j, k);
                back_hum += lattice.hum.get(i, j, k) && start.hum.get(i, j, k);
            }
    EXPECT_GE(double(quarter), 0.98 * double(start.cld.count()));
    EXPECT_GE(double(back), 0.99 * double(start.cld.count()));
    EXPECT_GE(double(back_hum), 0.99 * double(start.hum.count())) << "each cell, not the outline alone";
    EXPECT_EQ(motion.crowded_out(), 0u);
}

// Half a turn at an angle to the axes, where rounding alone would put two contents into one cell for one in six.
TEST(CellMotion, TheInteriorStaysFilled) {
    const Extent e{64, 64, 1};
    AutomatonOptions o = still_options(e);
    o.wind.fields = {circulation(WindFieldKind::vortex, 1e4, 1e4 * 0.03, 320, 320)};
    Lattice lattice = empty_lattice(e);
    for (int j = 0; j < e.y; ++j)
        for (int i = 0; i < e.x; ++i) lattice.cld.set(i, j, 0, std::hypot(i + 0.5 - 32, j + 0.5 - 32) < 20);
    CellMotion motion(e);
    for (int step = 0; step < 25; ++step) motion.step(lattice, o, step);
    std::uint64_t holes = 0;
    for (int j = 0; j < e.y; ++j)
        for (int i = 0; i < e.x; ++i)
            holes += std::hypot(i + 0.5 - 32, j + 0.5 - 32) < 18 && !lattice.cld.get(i, j, 0);
    EXPECT_LE(holes, 10u) << "of a thousand cells";
}

TEST(CellMotion, CountsAreConservedWhereTheWindHasNoDivergence) {
    struct Case {
        WindField field;
        Extent extent;
        Boundaries boundaries;
    };
    const Boundaries around{Boundary::periodic, Boundary::periodic, Boundary::open};
    WindField roll = circulation(WindFieldKind::roll, 160, 4);
    roll.direction_deg = 90;
    roll.top_m = 160;
    WindField thermal = circulation(WindFieldKind::thermal, 180, 4, 200, 200);
    thermal.top_m = 200;
    WindField shear = circulation(WindFieldKind::shear_line, 80, 7, 200, 200);
    shear.direction_deg = 0;
    const Case cases[] = {{roll, {32, 20, 16}, around},
                          {thermal, {40, 40, 20}, around},
                          {shear, {40, 40, 4}, around},
                          {circulation(WindFieldKind::vortex, 60, 6, 200, 200), {40, 40, 4}, around}};
    for (const Case& c : cases) {
        AutomatonOptions o = still_options(c.extent);
        o.boundaries = c.boundaries;
        o.wind.fields = {c.field};
        if (c.field.kind == WindFieldKind::vortex) {  // closed streamlines: nothing near the sides moves
            o.wind.fields[0].radius_m = 100;
            o.boundaries = {};
        }
        Lattice lattice = random_lattice(c.extent, 0.25, 5);
        if (c.field.kind == WindFieldKind::vortex) {
            for (int k = 0; k < c.extent.z; ++k)
                for (int j = 0; j < c.extent.y; ++j)
                    for (int i = 0; i < c.extent.x; ++i)
                        if (std::hypot(i + 0.5 - 20, j + 0.5 - 20) > 17)
                            for (BitPlane* p : {&lattice.hum, &lattice.act, &lattice.cld}) p->set(i, j, k, false);
        }
        const auto before = counts(lattice);
        CellMotion motion(c.extent);
        for (int step = 0; step < 150; ++step) {
            motion.step(lattice, o, step);
            ASSERT_EQ(counts(lattice), before) << int(c.field.kind) << " step " << step;
        }
        EXPECT_EQ(motion.crowded_out(), 0u);
    }
}

// Where all air runs together there is no room for its contents; what is lost is counted.
TEST(CellMotion, ConvergenceCrowdsOut) {
    const Extent e{41, 41, 1};
    AutomatonOptions o = still_options(e);
    o.wind.fields = {grid_field({2, 2, 1}, [](int i, int j, int) { return Vec3(i == 0 ? 8 : -8, j == 0 ? 8 : -8, 0); }, {0, 0, 5}, 410)};
    Lattice lattice = random_lattice(e, 0.7, 1);
    const std::uint64_t before = lattice.cld.count();
    CellMotion motion(e);
    for (int step = 0; step < 200; ++step) motion.step(lattice, o, step);
    EXPECT_GT(motion.crowded_out(), 100u);
    EXPECT_LT(lattice.cld.count(), before);
}

// One step from the definition: positions, the closest to each centre, then the others in the order of their cells.
TEST(CellMotion, IsTheNaiveTwin) {
    for (unsigned seed = 1; seed <= 6; ++seed) {
        const Extent e{23, 17, 5};
        AutomatonOptions o = still_options(e, 20);
        o.boundaries = {seed % 2 ? Boundary::periodic : Boundary::open, Boundary::open,
                        seed % 3 ? Boundary::open : Boundary::periodic};
        o.wind.keyframes = {{0, {{0, {3, -2}}}}};
        o.wind.fields = {circulation(WindFieldKind::vortex, 90, 25, 200, 150), circulation(WindFieldKind::roll, 77, 9)};
        o.wind.fields[1].top_m = 100;
        Lattice lattice = random_lattice(e, 0.15 * seed, seed);
        struct Content {
            std::array<std::int64_t, 3> at;
            std::array<bool, 3> bits;
        };
        const std::int64_t size[3] = {e.x * 2048, e.y * 2048, e.z * 2048};
        const Boundary sides[3] = {o.boundaries.x, o.boundaries.y, o.boundaries.z};
        std::vector<Content> contents;
        for (int k = 0; k < e.z; ++k)
            for (int j = 0; j < e.y; ++j)
                for (int i = 0; i < e.x; ++i) {
                    Content c{{}, {lattice.hum.get(i, j, k), lattice.act.get(i, j, k), lattice.cld.get(i, j, k)}};
                    if (!c.bits[0] && !c.bits[1] && !c.bits[2]) continue;
                    const Vec3 from(i + 0.5, j + 0.5, k + 0.5);
                    const Vec3 way = mean_wind(o.wind, 20.0 * from, 0, 1) / 20.0;
                    bool stays = true;
                    for (int axis = 0; axis < 3; ++axis) {
                        std::int64_t at = std::llround(from[axis] * 2048) + std::llround(way[axis] * 2048);
                        if (sides[axis] == Boundary::periodic) at = ((at % size[axis]) + size[axis]) % size[axis];
                        stays = stays && at >= 0 && at < size[axis];
                        c.at[std::size_t(axis)] = at;
                    }
                    if (stays) contents.push_back(c);
                }
        using Cell = std::array<std::int64_t, 3>;
        const auto square = [](const Content& c, const Cell& cell) {
            double sum = 0;
            for (std::size_t axis = 0; axis < 3; ++axis) {
                const double d = double(c.at[axis]) - (double(cell[axis]) * 2048 + 1024);
                sum += d * d;
            }
            return sum;
        };
        std::map<Cell, std::size_t> held;
        std::vector<std::size_t> waiting;
        const auto home = [&](std::size_t n) {
            return Cell{contents[n].at[0] / 2048, contents[n].at[1] / 2048, contents[n].at[2] / 2048};
        };
        for (std::size_t n = 0; n < contents.size(); ++n) {
            const auto found = held.find(home(n));
            if (found == held.end() || square(contents[n], home(n)) < square(contents[found->second], home(n)))
                held[home(n)] = n;
        }
        for (std::size_t n = 0; n < contents.size(); ++n)
            if (held.at(home(n)) != n) waiting.push_back(n);
        for (const std::size_t n : waiting) {
            double best = std::numeric_limits<double>::infinity();
            std::optional<Cell> chosen;
            for (int dz = -14; dz <= 14; ++dz)
                for (int dy = -14; dy <= 14; ++dy)
                    for (int dx = -14; dx <= 14; ++dx) {
                        if (dx * dx + dy * dy + dz * dz > 196) continue;
                        const Cell there{home(n)[0] + dx, home(n)[1] + dy, home(n)[2] + dz};
                        Cell folded = there;
                        bool inside = true;
                        for (std::size_t axis = 0; axis < 3; ++axis) {
                            const std::int64_t cells = size[axis] / 2048;
                            if (sides[axis] == Boundary::periodic) folded[axis] = ((folded[axis] % cells) + cells) % cells;
                            inside = inside && folded[axis] >= 0 && folded[axis] < cells;
                        }
                        if (!inside || held.contains(folded) || square(contents[n], there) >= best) continue;
                        best = square(contents[n], there);
                        chosen = folded;
                    }
            if (chosen) held[*chosen] = n;
        }
        CellMotion motion(e);
        motion.step(lattice, o, 0);
        for (int k = 0; k < e.z; ++k)
            for (int j = 0; j < e.y; ++j)
                for (int i = 0; i < e.x; ++i) {
                    const auto found = held.find({i, j, k});
                    const std::array<bool, 3> expected =
                        found == held.end() ? std::array<bool, 3>{} : contents[found->second].bits;
                    const std::array<bool, 3> got{lattice.hum.get(i, j, k), lattice.act.get(i, j, k), lattice.cld.get(i, j, k)};
                    ASSERT_EQ(got, expected) << seed << ": " << i << ", " << j << ", " << k;
                }
    }
}

AutomatonOptions cloudy_vortex() {
    AutomatonOptions o;
    o.extent = {64, 64, 12};
    o.placement = {{0, 0, 500}, 50};
    o.seed = 8;
    o.field.background = {0.001, 0.0001, 0.1};
    Ellipsoid e;
    e.centre_m = {2400, 1600, 800};
    e.semi_axes_m = {400, 300, 250};
    e.centre = {0.3, 0.01, 0.05};
    o.field.ellipsoids = {e};
    o.wind.keyframes = {{0, {{0, {0, 0}}, {2000, {2, 0}}}}};
    o.wind.fields = {circulation(WindFieldKind::vortex, 1000, 12, 1600, 1600)};
    return o;
}

// The content of the last cell goes into the first, which is taken for good: held in the last cell, at its place in
// the first, it has the wind of the first, which is none.
TEST(CellMotion, AContentThatIsHeldAcrossASeamFeelsTheWindOfItsPlace) {
    AutomatonOptions o = still_options({8, 1, 1});
    o.boundaries.x = Boundary::periodic;
    o.wind.fields = {grid_field(
        {8, 1, 1}, [](int i, int, int) { return Vec3(i == 7 ? 10 : 0, 0, 0); }, {5, 5, 5}, 10)};
    Lattice lattice = empty_lattice(o.extent);
    lattice.cld.set(0, 0, 0, true);
    lattice.cld.set(7, 0, 0, true);
    CellMotion motion(o.extent);
    for (int step = 0; step < 5; ++step) {
        motion.step(lattice, o, step);
        EXPECT_TRUE(lattice.cld.get(0, 0, 0) && lattice.cld.get(7, 0, 0)) << step;
    }
}

// Ellipsoids move on the same way as the bits: half a turn in pi R / v seconds.
TEST(CellMotion, EllipsoidsDriftWithTheField) {
    AutomatonOptions o = cloudy_vortex();
    o.wind.keyframes.clear();
    o.time_step_s = 3.14159265358979323846 * 800 / 9.6 / 40;
    Automaton automaton(o);
    for (int step = 0; step < 40; ++step) automaton.step();
    const Vec3 centre = automaton.ellipsoids().at(0).ellipsoid.centre_m;
    EXPECT_NEAR(centre.x, 800, 2);
    EXPECT_NEAR(centre.y, 1600, 2);
    EXPECT_EQ(centre.z, 800);
    AutomatonOptions rising = o;
    rising.wind.fields = {circulation(WindFieldKind::thermal, 2000, 2, 2400, 1600)};
    rising.time_step_s = 10;
    Automaton risen(rising);
    for (int step = 0; step < 20; ++step) risen.step();
    EXPECT_GT(risen.ellipsoids().at(0).ellipsoid.centre_m.z, 850);
}

TEST(CellMotion, ThreadsChangeNoBit) {
    const auto run = [] {
        Automaton automaton(cloudy_vortex());
        for (int step = 0; step < 60; ++step) automaton.step();
        return automaton.hash();
    };
    EXPECT_EQ(test::with_threads(1, run), test::with_threads(4, run));
}

TEST(CellMotion, ASavedStateGoesOnExactly) {
    const AutomatonOptions o = cloudy_vortex();
    Automaton straight(o), resumed(o);
    for (int step = 0; step < 40; ++step) straight.step();
    const std::vector<std::byte> bytes = straight.save();
    resumed.restore(bytes);
    for (int step = 0; step < 40; ++step) {
        straight.step();
        resumed.step();
        ASSERT_EQ(resumed.hash(), straight.hash()) << step;
    }
    EXPECT_EQ(resumed.save(), straight.save());
    AutomatonOptions calm = o;
    calm.wind = {};
    Automaton other(calm);
    EXPECT_THROW(other.restore(bytes), Error);
}

TEST(CellMotion, RefusesWhatItCannotMove) {
    AutomatonOptions o = cloudy_vortex();
    o.wind.fields[0].radius_m = 0;
    EXPECT_THROW(Automaton{o}, Error);
    o.wind.fields[0].radius_m = 1e-3;
    o.wind.fields[0].speed_m_per_s = 1000;
    o.wind.fields[0].top_m = -5;
    EXPECT_THROW(Automaton{o}, Error);
    o = cloudy_vortex();
    o.wind.fields = {grid_field({1, 2, 1}, [](int, int j, int) { return Vec3(j * 1e12, 0, 0); })};
    Automaton automaton(o);
    EXPECT_THROW(for (int step = 0; step < 9; ++step) automaton.step(), Error);
}

}  // namespace
}  // namespace nephos
