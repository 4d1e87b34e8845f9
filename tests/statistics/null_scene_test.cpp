// SPDX-License-Identifier: Apache-2.0

// The scene that has an answer in closed form: without vapour (p_hum = 0) cells are independent, and with p of activation
// and e of extinction
//
//     f = p (1 - e) / (1 - (1 - p)(1 - e)) of the cells are cloud,    C = 1 - (1 - f)^nz of the columns are covered,
//
// so shadows are random, and every statistic of them is known.

#include <cmath>

#include "statistics/cloud_sizes.h"
#include "statistics/cloud_statistics.h"
#include "statistics/clouds.h"
#include "statistics/series.h"
#include "statistics/structure.h"
#include <gtest/gtest.h>

#include "automaton/automaton.h"

namespace nephos {
namespace {

constexpr double kAct = 1e-3, kExt = 0.05;
constexpr int kLevels = 20;

AutomatonOptions null_scene() {
    AutomatonOptions options;
    options.extent = {256, 128, kLevels};
    options.boundaries = {Boundary::periodic, Boundary::periodic, Boundary::open};
    options.field.background = {0, kAct, kExt};
    options.initial = InitialState::empty;
    options.seed = 5;
    return options;
}

BitPlane copy_of(const BitPlaneView& view) {
    BitPlane plane(view.extent);
    std::copy_n(view.words, view.word_count(), plane.words().begin());
    return plane;
}

TEST(NullScene, StatisticsAreThoseInClosedForm) {
    const double f = kAct * (1 - kExt) / (1 - (1 - kAct) * (1 - kExt)), p = 1 - std::pow(1 - f, kLevels),
                 q = 1 - p;
    const double columns = 256 * 128, edges = 4 * p * q;  // two pairs a column
    Automaton automaton(null_scene());
    std::vector<double> cover, fraction;
    std::uint64_t cells = 0, deaths = 0, perimeter = 0;
    double small[5] = {}, overlap = 0, correlation = 0;
    int snapshots = 0;
    BitPlane before;
    for (int step = 0; step < 2200; ++step) {
        automaton.step();
        if (step < 200) continue;  // ten times the time in which the start is forgotten
        const BitPlaneView cld = automaton.cld();
        const CloudCounts counts = count_cloud(cld, automaton.options().boundaries);
        cover.push_back(double(counts.columns) / columns);
        fraction.push_back(double(counts.cells) / columns / kLevels);
        perimeter += counts.edges;
        if (step > 200) {
            cells += before.count();
            deaths += count_deaths_and_replace(before, cld);
        } else {
            before = copy_of(cld);
        }
        if (step % 100 != 0) continue;  // independent of each other
        ++snapshots;
        for (const ConnectedCloud& cloud : clouds_2d(cld, automaton.options().boundaries))
            if (cloud.cells <= 4) ++small[cloud.cells];
        overlap += level_overlaps(cld).front().mean;
        correlation +=
            shadow_correlation(shadow_of(cld).view(), automaton.options().boundaries).front().value;
    }
    const Judgement judgement = judge(cover, true);
    EXPECT_EQ(judgement.regime, Regime::steady);
    const SeriesMean mean = mean_over(cover, judgement), mean_f = mean_over(fraction, judgement);
    EXPECT_NEAR(mean.mean, p, 4 * mean.error);
    EXPECT_NEAR(mean_f.mean, f, 4 * mean_f.error);
    EXPECT_NEAR(mean.deviation * mean.deviation, p * q / columns, 0.3 * p * q / columns);
    EXPECT_NEAR(double(perimeter) / double(cover.size()) / columns, edges, 0.01 * edges);
    // rho(n) of f falls as ((1 - p)(1 - e))^n: tau = (1 + r) / (1 - r) = 38.
    const double r = (1 - kAct) * (1 - kExt);
    EXPECT_NEAR(mean_f.tau, (1 + r) / (1 - r), 0.5 * (1 + r) / (1 - r));
    EXPECT_NEAR(double(cells) / double(deaths), 1 / kExt, 0.01 / kExt);
    // Lattice animals: clouds of 1 to 4 columns in a random shadow, per column.
    const double expected[5] = {
        0, p * std::pow(q, 4), 2 * p * p * std::pow(q, 6),
        std::pow(p, 3) * (2 * std::pow(q, 8) + 4 * std::pow(q, 7)),
        std::pow(p, 4) * (2 * std::pow(q, 10) + 8 * std::pow(q, 9) + 9 * std::pow(q, 8))};
    for (int size = 1; size <= 4; ++size) {
        const double number = expected[size] * columns * snapshots;
        EXPECT_NEAR(small[size], number, 5 * std::sqrt(number)) << size;
    }
    EXPECT_NEAR(overlap / snapshots, 0, 0.01);
    EXPECT_NEAR(correlation / snapshots, 0, 0.01);
}

}  // namespace
}  // namespace nephos
