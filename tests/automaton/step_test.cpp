// SPDX-License-Identifier: Apache-2.0

// Whole steps of the kernels against the naive twin, bit for bit, on random scenes of any size and boundary;
// and the promise that threads and instruction sets do not change them.

#include <random>

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include "automaton/automaton.h"
#include "automaton/kernels.h"
#include "tests/automaton/each_target.h"
#include "tests/reference/reference_automaton.h"
#include "tests/reference/with_threads.h"

namespace nephos {
namespace {

class Dice {
  public:
    explicit Dice(unsigned seed) : engine_(seed) {}
    double real(double low, double high) { return std::uniform_real_distribution<>(low, high)(engine_); }
    int integer(int low, int high) { return std::uniform_int_distribution<>(low, high)(engine_); }
    bool coin() { return integer(0, 1) == 1; }
    double pick(std::initializer_list<double> values) {
        return *(values.begin() + integer(0, int(values.size()) - 1));
    }

  private:
    std::mt19937 engine_;
};

Boundary any_boundary(Dice& dice) { return dice.coin() ? Boundary::periodic : Boundary::open; }

Probabilities any_probabilities(Dice& dice) {
    const auto p = [&] { return dice.pick({0, 0, 1e-6, 0.001, 0.01, 0.05, 0.2, 0.3, 0.7, 1}); };
    return {p(), p(), p()};
}

// A scene that visits every path: sparse and dense draws, tiny and odd extents, winds beyond any word.
AutomatonOptions any_options(Dice& dice) {
    AutomatonOptions o;
    o.extent = {dice.integer(1, dice.coin() ? 20 : 300), dice.integer(1, 40), dice.integer(1, 20)};
    o.boundaries = {any_boundary(dice), any_boundary(dice), any_boundary(dice)};
    o.placement = {{dice.real(-1e4, 1e4), dice.real(-1e4, 1e4), dice.real(0, 3000)}, dice.pick({10, 33, 50})};
    o.time_step_s = dice.pick({1, 7.5, 60});
    o.seed = std::uint64_t(dice.integer(0, 1 << 30)) << dice.integer(0, 33);
    o.field.background = any_probabilities(dice);
    const Vec3& origin = o.placement.origin_m;
    const double cell = o.placement.cell_size_m;
    for (int i = dice.integer(0, 6); i > 0; --i) {
        Ellipsoid e;
        e.centre_m = {origin.x + dice.real(-5, o.extent.x + 5) * cell,
                      origin.y + dice.real(-5, o.extent.y + 5) * cell,
                      origin.z + dice.real(-3, o.extent.z + 3) * cell};
        const auto axis = [&](int n) { return dice.real(0.5, std::min(30.0, 15.0 * n)) * cell; };
        const int n = std::min(o.extent.x, o.extent.y);
        e.semi_axes_m = {axis(n), axis(n), axis(o.extent.z)};
        e.yaw_deg = dice.real(-400, 400);
        e.centre = any_probabilities(dice);
        e.rim = any_probabilities(dice);
        e.fade_in_s = dice.pick({0, 40});
        e.life_s = dice.pick({kForever, 100});
        e.carried = dice.coin();
        o.field.ellipsoids.push_back(e);
    }
    if (dice.integer(0, 2) == 0) {
        o.field.profile = {{0, {{origin.z + 4 * cell, any_probabilities(dice)}, {origin.z + 9 * cell, any_probabilities(dice)}}},
                           {50, {{origin.z, any_probabilities(dice)}}}};
    }
    if (dice.integer(0, 2) == 0) {
        SampleGrid grid{origin, Vec3(cell * 7.3), {4, 3, 2}, 1, {}};
        for (int n = 0; n < 24; ++n) grid.values.push_back(float(dice.coin() ? 0.02 : dice.real(0, 1)));
        o.field.grids.push_back({ProbabilityKind(dice.integer(0, 2)), {}, {}, std::make_shared<const SampleGrid>(grid)});
    }
    if (dice.coin()) {
        const auto speed = [&] { return dice.pick({0, 0.3, -2, 40, 3000, -1e5}) * dice.real(0.5, 1); };
        o.wind.keyframes = {{0, {{origin.z, {speed(), speed()}}, {origin.z + 900, {speed(), speed()}}}},
                            {200, {{origin.z, {speed(), speed()}}}}};
    }
    return o;
}

Lattice any_lattice(Dice& dice, Extent e) {
    Lattice l{BitPlane(e), BitPlane(e), BitPlane(e)};
    const double hum = dice.real(0, 1), act = dice.pick({0, 0.01, 0.3}), cld = dice.pick({0, 0.001, 0.5});
    for (int k = 0; k < e.z; ++k) {
        for (int j = 0; j < e.y; ++j) {
            for (int i = 0; i < e.x; ++i) {
                l.hum.set(i, j, k, dice.real(0, 1) < hum);
                l.act.set(i, j, k, dice.real(0, 1) < act);
                l.cld.set(i, j, k, dice.real(0, 1) < cld);
            }
        }
    }
    return l;
}

// floor((n + 1) d) - floor(n d): what a layer moves in step n under a constant displacement of d cells /
// 2^32.
class LayerMotion {
  public:
    std::int64_t next(std::int64_t displacement) {
        const __int128 before = sum_ >> 32;
        sum_ += displacement;
        return std::int64_t((sum_ >> 32) - before);
    }

  private:
    __int128 sum_ = 0;
};

TEST(Step, EqualsTheNaiveTwinOnRandomScenes) {
    for (unsigned seed = 1; seed <= 60; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        Dice dice(seed);
        const AutomatonOptions o = any_options(dice);
        Automaton automaton(o, any_lattice(dice, o.extent));
        reference::Cells twin = reference::to_cells(automaton.hum(), automaton.act(), automaton.cld());
        std::vector<LayerMotion> motion_x(std::size_t(o.extent.z)), motion_y(std::size_t(o.extent.z));
        for (std::uint32_t step = 0; step < 4; ++step) {
            const std::vector<ActiveEllipsoid> ellipsoids = automaton.ellipsoids();
            const double time = automaton.time_s();
            automaton.step();
            twin = reference::grow(twin, o.boundaries);
            reference::extinguish_and_bear(twin, o, step, ellipsoids);
            for (int k = 0; k < o.extent.z; ++k) {
                const double height = o.placement.origin_m.z + (k + 0.5) * o.placement.cell_size_m;
                const Displacement d = displacement_of_step(wind_at(o.wind, height, time), o.time_step_s,
                                                            o.placement.cell_size_m);
                reference::advect_layer(twin, o.boundaries, k, motion_x[std::size_t(k)].next(d.x),
                                        motion_y[std::size_t(k)].next(d.y));
            }
            ASSERT_EQ(reference::to_cells(automaton.hum(), automaton.act(), automaton.cld()), twin)
                << "step " << step;
        }
    }
}

// The largest extent on each axis in turn; the last block of an axis has the coordinate 8191.
TEST(Step, EqualsTheNaiveTwinOnTheLongestAxes) {
    for (const Extent extent : {Extent{65536, 2, 1}, Extent{3, 65536, 1}, Extent{5, 1, 65536}}) {
        Dice dice(unsigned(extent.x));
        AutomatonOptions o;
        o.extent = extent;
        o.boundaries = {Boundary::periodic, Boundary::open, Boundary::periodic};
        o.field.background = {0.02, 0.003, 0.3};
        Automaton automaton(o, any_lattice(dice, extent));
        reference::Cells twin = reference::to_cells(automaton.hum(), automaton.act(), automaton.cld());
        automaton.step();
        twin = reference::grow(twin, o.boundaries);
        reference::extinguish_and_bear(twin, o, 0, {});
        ASSERT_EQ(reference::to_cells(automaton.hum(), automaton.act(), automaton.cld()), twin) << extent.x;
    }
}

TEST(FirstState, EqualsTheNaiveTwinOnRandomScenes) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        Dice dice(seed);
        AutomatonOptions o = any_options(dice);
        o.initial = InitialState::field;
        const std::vector<ActiveEllipsoid> ellipsoids = Automaton(o).ellipsoids();
        const reference::Cells twin = reference::first_state(o, ellipsoids);
        test::with_each_target([&] {
            const Automaton automaton(o);
            EXPECT_TRUE(reference::to_cells(automaton.hum(), automaton.act(), automaton.cld()) == twin);
        });
    }
}

std::vector<std::string> hashes_of(const AutomatonOptions& options, int steps) {
    Automaton automaton(options);
    std::vector<std::string> hashes{automaton.hash().hex()};
    for (int i = 0; i < steps; ++i) {
        automaton.step();
        hashes.push_back(automaton.hash().hex());
    }
    return hashes;
}

AutomatonOptions busy_options(unsigned seed) {
    Dice dice(seed);
    AutomatonOptions o = any_options(dice);
    o.extent = {203, 150, 37};
    o.field.background = {0.01, 0.002, 0.2};
    o.initial = InitialState::field;
    return o;
}

TEST(Determinism, ThreadsDoNotChangeTheBits) {
    const AutomatonOptions options = busy_options(7);
    const auto expected = hashes_of(options, 6);
    for (std::size_t threads : {1, 2, 3, 4, 8, 32}) {
        EXPECT_EQ(test::with_threads(threads, [&] { return hashes_of(options, 6); }), expected)
            << threads << " threads";
    }
}

#if HWY_ARCH_X86 && !defined(__SSSE3__) && HWY_DISABLED_TARGETS == 0
// A build for any x86-64 processor has kernels for those without AVX2, too.
TEST(Determinism, KernelsHaveTheTargetsBelowAvx2) {
    constexpr std::int64_t kBelow = HWY_SSSE3 | HWY_SSE4;
    EXPECT_EQ(HWY_TARGETS & kBelow, kBelow);
    EXPECT_EQ(HWY_STATIC_TARGET & (HWY_SCALAR | HWY_EMU128), HWY_STATIC_TARGET);
}
#endif

TEST(Determinism, InstructionSetsDoNotChangeTheBits) {
    for (unsigned seed : {3u, 7u, 11u}) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        const AutomatonOptions options = busy_options(seed);
        const auto expected = hashes_of(options, 4);
        test::with_each_target([&] { EXPECT_EQ(hashes_of(options, 4), expected); });
    }
}

// Its distances overflow single precision, and vector units disagree about which of a number and none is the larger.
TEST(Determinism, InstructionSetsAgreeAboutTheThinnestEllipsoid) {
    AutomatonOptions o{.extent = {16, 16, 16}, .seed = 3};
    o.field.background = {0.05, 0.004, 0.2};
    Ellipsoid e;
    e.centre_m = {225, 225, 25};
    e.semi_axes_m = {300, 300, 1e-40};
    e.centre = {0.2, 0.2, 0.1};
    o.field.ellipsoids = {e};
    const auto expected = hashes_of(o, 4);
    test::with_each_target([&] { EXPECT_EQ(hashes_of(o, 4), expected); });
}

// Kernels decide sparse births in float32, and again in double where that may be wrong: two events in a million. Here
// are 3.7 million, with two frequent draws whose sums are rounded, beside the twin, which has doubles alone.
TEST(Determinism, InstructionSetsDecideCloseEventsAsDoublesDo) {
    AutomatonOptions o{.extent = {256, 256, 256}, .seed = 5};
    o.field.background = {0.11, 0.093, 0};
    const Lattice start{BitPlane(o.extent), BitPlane(o.extent), BitPlane(o.extent)};
    reference::Cells twin = reference::to_cells(start.hum.view(), start.act.view(), start.cld.view());
    reference::extinguish_and_bear(twin, o, 0, {});
    test::with_each_target([&] {
        Automaton automaton(o, start);
        automaton.step();
        EXPECT_TRUE(reference::to_cells(automaton.hum(), automaton.act(), automaton.cld()) == twin);
    });
}

// Rows of 1 to 17 words, with and without bits of padding: their first words have every alignment that words
// have within a vector, and their last vectors every number of words. Each starts from its own state, with a
// background alone and with ellipsoids, and is compared with the naive twin.
TEST(Determinism, InstructionSetsDrawRowsOfAnyLength) {
    for (int words = 1; words <= 17; ++words) {
        for (int x : {64 * words - 63, 64 * words - 40, 64 * words}) {
            SCOPED_TRACE("x = " + std::to_string(x));
            Dice dice{unsigned(x)};
            AutomatonOptions o = any_options(dice);
            o.extent = {x, 9, 9};
            o.wind = {};
            o.field.background = {0.2, 0.01, 0.1};
            if (dice.coin()) o.field.ellipsoids.clear();
            const Lattice start = any_lattice(dice, o.extent);
            reference::Cells twin = reference::to_cells(start.hum.view(), start.act.view(), start.cld.view());
            const std::vector<ActiveEllipsoid> ellipsoids = Automaton(o, start).ellipsoids();
            twin = reference::grow(twin, o.boundaries);
            reference::extinguish_and_bear(twin, o, 0, ellipsoids);
            test::with_each_target([&] {
                Automaton automaton(o, start);
                automaton.step();
                EXPECT_EQ(reference::to_cells(automaton.hum(), automaton.act(), automaton.cld()), twin);
            });
        }
    }
}

// Extinction of any density of cloud where p varies: thin cloud is decided cell by cell, from bounds on p, thick cloud by whole
// layers, and each instruction set gives the bits of the naive twin. Births as frequent are beside it, and blocks of two
// segments, of which the last is cut on each axis. An ellipsoid has p = 0 at its centre, another p = 1.
TEST(Determinism, InstructionSetsExtinguishThinAndThickCloud) {
    AutomatonOptions o{.extent = {521, 19, 12}, .seed = 77};
    o.boundaries = {Boundary::periodic, Boundary::open, Boundary::open};
    o.placement.cell_size_m = 10;
    const auto ellipsoid = [&](double x, const Probabilities& centre, const Probabilities& rim) {
        Ellipsoid e;
        e.centre_m = {x, 90, 55};
        e.semi_axes_m = {900, 130, 70};
        e.yaw_deg = 7;
        e.centre = centre;
        e.rim = rim;
        o.field.ellipsoids.push_back(e);
    };
    ellipsoid(600, {0.9, 0.4, 0.1}, {0.2, 0, 0.35});
    ellipsoid(1700, {0.5, 0.001, 0}, {0, 0, 0.3});
    ellipsoid(3000, {1, 0.3, 0.05}, {0, 0, 0.35});
    ellipsoid(3600, {0.3, 0.3, 0.2}, {0.1, 0, 0.9});
    for (const double background_ext : {1e-6, 0.02, 0.1, 0.2, 0.3, 0.9, 1.0}) {
        for (const double density : {0.004, 0.02, 0.1, 0.24, 0.26, 1.0}) {
            SCOPED_TRACE("ext " + std::to_string(background_ext) + ", cloud " + std::to_string(density));
            o.field.background = {0, 0.26, background_ext};
            Dice dice{5};
            Lattice start{BitPlane(o.extent), BitPlane(o.extent), BitPlane(o.extent)};
            for (int k = 0; k < o.extent.z; ++k)
                for (int j = 0; j < o.extent.y; ++j)
                    for (int i = 0; i < o.extent.x; ++i) start.cld.set(i, j, k, dice.real(0, 1) < density);
            reference::Cells twin = reference::to_cells(start.hum.view(), start.act.view(), start.cld.view());
            reference::extinguish_and_bear(twin, o, 0, Automaton(o, start).ellipsoids());
            test::with_each_target([&] {
                Automaton automaton(o, start);
                automaton.step();
                EXPECT_TRUE(reference::to_cells(automaton.hum(), automaton.act(), automaton.cld()) == twin);
            });
        }
    }
}

TEST(Determinism, EveryStepOfADrawnOutScatterIsReproduced) {
    AutomatonOptions o{.extent = {96, 64, 16}};
    o.wind.keyframes = {{0, {{0, {25, -12}}}}};
    o.field.scatters = {{.count = 12,
                         .x_m = {0, 4800},
                         .y_m = {0, 3200},
                         .z_m = {200, 500},
                         .semi_axis_x_m = {300, 700},
                         .semi_axis_y_m = {200, 500},
                         .semi_axis_z_m = {100, 300},
                         .yaw_deg = {0, 180},
                         .life_s = {400, 900},
                         .fade_in_s = 60,
                         .fade_out_s = 60,
                         .replace = true}};
    EXPECT_EQ(hashes_of(o, 120), hashes_of(o, 120));
    AutomatonOptions other = o;
    other.seed = o.seed + 1;
    EXPECT_NE(hashes_of(o, 3), hashes_of(other, 3));
}

}  // namespace
}  // namespace nephos
