// SPDX-License-Identifier: Apache-2.0

// The background by height, by time and from grids: the constant background where it is constant, exactly the stated
// probability in every cell where it is not.

#include "automaton/background.h"

#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "automaton/automaton.h"
#include "core/error.h"

namespace nephos {
namespace {

ProbabilityGrid grid_of(ProbabilityKind kind, const std::vector<float>& values, double spacing_m) {
    SampleGrid grid{{spacing_m / 2, spacing_m / 2, spacing_m / 2}, Vec3(spacing_m), {int(values.size()), 1, 1}, 1, values};
    return {.of = kind, .file = {}, .grid = {}, .samples = std::make_shared<const SampleGrid>(std::move(grid))};
}

AutomatonOptions small_options() {
    AutomatonOptions o;
    o.extent = {90, 30, 20};
    o.placement = {{0, 0, 0}, 50};
    o.seed = 12;
    o.field.background = {0.05, 0.01, 0.2};
    Ellipsoid e;
    e.centre_m = {2000, 700, 500};
    e.centre = {0.4, 0.02, 0.05};
    e.rim = {0.1, 0, 0.1};
    o.field.ellipsoids = {e};
    return o;
}

TEST(Background, IsLinearInHeightAndTime) {
    const std::vector<BackgroundKeyframe> profile{{0, {{100, {0.1, 0, 0.5}}, {300, {0.3, 0.2, 0.1}}}},
                                                  {60, {{0, {0.5, 0, 0}}}}};
    EXPECT_EQ(background_at(profile, 200, 0), (Probabilities{0.2, 0.1, 0.3}));
    EXPECT_EQ(background_at(profile, -9, -1), (Probabilities{0.1, 0, 0.5}));
    EXPECT_EQ(background_at(profile, 999, 60), (Probabilities{0.5, 0, 0}));
    EXPECT_DOUBLE_EQ(background_at(profile, 300, 15).hum, 0.35);
    EXPECT_DOUBLE_EQ(background_at(profile, 300, 1e9).hum, 0.5);
}

// One background said in four ways gives the same bits.
TEST(Background, AConstantOneHasTheSameBitsHoweverItIsGiven) {
    const AutomatonOptions plain = small_options();
    AutomatonOptions profile = plain, grids = plain;
    profile.field.profile = {{0, {{0, plain.field.background}, {700, plain.field.background}}},
                             {300, {{0, plain.field.background}}}};
    profile.field.background = {1, 1, 1};
    for (const auto& [kind, p] : {std::pair{ProbabilityKind::hum, 0.05f}, {ProbabilityKind::act, 0.01f}, {ProbabilityKind::ext, 0.2f}})
        grids.field.grids.push_back(grid_of(kind, {p, p, p}, 1000));
    grids.field.profile = {{0, {{0, {1, 1, 1}}}}};
    Automaton a(plain), b(profile), c(grids);
    ASSERT_EQ(a.hash(), b.hash());
    ASSERT_EQ(a.hash(), c.hash());
    for (int step = 0; step < 60; ++step) {
        a.step();
        b.step();
        c.step();
        ASSERT_EQ(a.hash(), b.hash()) << step;
        ASSERT_EQ(a.hash(), c.hash()) << step;
    }
}

// Fresh vapour in each layer, against the binomial distribution of its probability: both ways of drawing, sparse and
// dense, with bounds of four standard deviations. Nothing is active, so hum only grows.
TEST(Background, EveryLayerHasItsProbability) {
    AutomatonOptions o;
    o.extent = {200, 160, 24};
    o.placement = {{0, 0, 0}, 50};
    o.initial = InitialState::empty;
    o.field.background = {0.9, 0, 0};
    o.field.profile = {{0, {{100, {0, 0, 0}}, {700, {0.02, 0, 0}}, {720, {0.3, 0, 0}}, {1100, {0.8, 0, 0}}}}};
    Automaton automaton(o);
    automaton.step();
    for (int k = 0; k < o.extent.z; ++k) {
        const double p = background_at(o.field.profile, (k + 0.5) * 50, 0).hum, n = 200 * 160;
        std::uint64_t count = 0;
        for (int j = 0; j < o.extent.y; ++j)
            for (int i = 0; i < o.extent.x; ++i) count += automaton.hum().get(i, j, k);
        EXPECT_NEAR(double(count), n * p, 4 * std::sqrt(n * p * (1 - p)) + 1e-9) << k;
    }
}

// The same along x from a grid, of extinction: cells that are cloud survive as often as it says.
TEST(Background, EveryColumnOfAGridHasItsProbability) {
    AutomatonOptions o;
    o.extent = {64, 200, 40};
    o.placement = {{0, 0, 0}, 50};
    o.field.background = {};
    o.field.grids = {grid_of(ProbabilityKind::ext, {0, 0.04f, 0.04f, 0.6f, 1}, 640)};
    Lattice start{BitPlane(o.extent), BitPlane(o.extent), BitPlane(o.extent)};
    for (int k = 0; k < o.extent.z; ++k)
        for (int j = 0; j < o.extent.y; ++j)
            for (int i = 0; i < o.extent.x; ++i) start.cld.set(i, j, k, true);
    Automaton automaton(o, std::move(start));
    automaton.step();
    for (int i = 0; i < o.extent.x; ++i) {
        const double p = sample_at(*o.field.grids[0].samples, {(i + 0.5) * 50, 0, 0}, 0), n = 200 * 40;
        std::uint64_t count = 0;
        for (int k = 0; k < o.extent.z; ++k)
            for (int j = 0; j < o.extent.y; ++j) count += !automaton.cld().get(i, j, k);
        EXPECT_NEAR(double(count), n * p, 4 * std::sqrt(n * p * (1 - p)) + 1e-9) << i;
    }
}

// The profile is that of the step's own time.
TEST(Background, FollowsTheTime) {
    AutomatonOptions o;
    o.extent = {64, 64, 8};
    o.initial = InitialState::empty;
    o.field.background = {};
    o.field.profile = {{0, {{0, {0, 0, 0}}}}, {30, {{0, {0, 0, 0}}}}, {31, {{0, {1, 0, 0}}}}};
    Automaton automaton(o);
    for (int step = 0; step < 4; ++step) automaton.step();  // at 0, 10, 20 and 30 s
    std::uint64_t count = 0;
    const auto count_hum = [&] {
        count = 0;
        for (std::size_t n = 0; n < automaton.hum().word_count(); ++n) count += std::uint64_t(automaton.hum().words[n] != 0);
        return count;
    };
    EXPECT_EQ(count_hum(), 0u);
    automaton.step();
    EXPECT_EQ(count_hum(), automaton.hum().word_count());
}

// A fading ellipsoid in a varying background comes from no effect: at weight 0 nothing is born, at half of it half.
TEST(Background, FadingEllipsoidsComeFromNoEffect) {
    AutomatonOptions o;
    o.extent = {64, 64, 32};
    o.initial = InitialState::empty;
    o.field.background = {0.9, 0, 0};
    o.field.profile = {{0, {{0, {0, 0, 0}}, {1e4, {1e-6, 0, 0}}}}};
    Ellipsoid e;
    e.centre_m = {1600, 1600, 800};
    e.semi_axes_m = {1e5, 1e5, 1e5};
    e.centre = e.rim = {0.8, 0, 0};
    o.field.ellipsoids = {e};
    for (const double weight : {0.25, 0.5, 1.0}) {
        AutomatonOptions faded = o;
        faded.field.ellipsoids[0].birth_s = -weight * 100;
        faded.field.ellipsoids[0].fade_in_s = 100;
        Automaton automaton(faded);
        automaton.step();
        std::uint64_t count = 0;
        for (int k = 0; k < 32; ++k)
            for (int j = 0; j < 64; ++j)
                for (int i = 0; i < 64; ++i) count += automaton.hum().get(i, j, k);
        const double n = 64 * 64 * 32, p = 0.8 * weight;
        EXPECT_NEAR(double(count), n * p, 4 * std::sqrt(n * p * (1 - p))) << weight;
    }
}

TEST(Background, RefusesBadOptions) {
    AutomatonOptions o = small_options();
    o.field.profile = {{0, {{5, {}}, {5, {}}}}};
    EXPECT_THROW(Automaton{o}, Error);
    o.field.profile = {{0, {{5, {2, 0, 0}}}}};
    EXPECT_THROW(Automaton{o}, Error);
    o.field.profile.clear();
    o.field.grids = {grid_of(ProbabilityKind::act, {0, 1.5f}, 10)};
    EXPECT_THROW(Automaton{o}, Error);
    o.field.grids = {{.of = ProbabilityKind::act, .file = "never-read.vdb", .grid = {}, .samples = {}}};
    EXPECT_THROW(Automaton{o}, Error);
    o.field.grids = {grid_of(ProbabilityKind::act, {0}, 10), grid_of(ProbabilityKind::act, {0}, 10)};
    EXPECT_THROW(Automaton{o}, Error);
}

}  // namespace
}  // namespace nephos
