// SPDX-License-Identifier: Apache-2.0

// The random stream: known answers of Philox, counters that are never used twice, and probabilities that are
// what they claim to be, for the sparse and the dense draw.

#include "core/random.h"

#include <bit>
#include <cmath>
#include <random>
#include <set>
#include <utility>

#include <gtest/gtest.h>

#include "automaton/automaton.h"
#include "automaton/block_field.h"
#include "automaton/kernels.h"
#include "automaton/poisson.h"
#include "tests/reference/reference_automaton.h"

namespace nephos {
namespace {

// The three vectors for philox4x32-10 that Random123 publishes (kat_vectors).
TEST(Philox, GivesTheKnownAnswers) {
    EXPECT_EQ(philox(0, {0, 0, 0, 0}), (PhiloxWords{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
    EXPECT_EQ(philox(0xffffffffffffffff, {0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff}),
              (PhiloxWords{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
    EXPECT_EQ(philox(0x299f31d0a4093822, {0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}),
              (PhiloxWords{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

// Every counter that a few steps of a small lattice could use, every item of the field's domain, and the
// initial state: all different. The largest sub-indices are those of a dense draw in which all 512 cells tie.
TEST(Counters, AreNeverUsedTwice) {
    std::set<PhiloxWords> seen;
    std::size_t made = 0;
    const auto use = [&](const PhiloxWords& counter) {
        ++made;
        EXPECT_TRUE(seen.insert(counter).second);
    };
    using Time = std::pair<Domain, std::uint32_t>;
    for (const auto& [domain, step] : {Time{Domain::initial_state, 0}, Time{Domain::lattice, 0}, Time{Domain::lattice, 1},
                                       Time{Domain::lattice, 0xFFFFFFFE}}) {
        for (int block = 0; block < 8; ++block) {
            const int bx = (block & 1) * 8191, by = (block >> 1 & 1) * 8191, bz = (block >> 2) * 8191;
            use(block_counter(domain, Draw::counts, step, bx, by, bz, 0));
            for (Draw draw : {Draw::hum, Draw::act, Draw::ext}) {
                for (std::uint32_t sub = 0; sub < 32 + 512 / 4; ++sub) {
                    use(block_counter(domain, draw, step, bx, by, bz, sub));
                }
            }
            for (std::uint32_t sub = 0; sub < 512; ++sub) {
                use(block_counter(domain, Draw::births, step, bx, by, bz, sub));
                use(block_counter(domain, Draw::extinctions, step, bx, by, bz, sub));
            }
        }
    }
    for (std::uint32_t scatter : {0u, 1u, 65535u}) {
        for (std::uint32_t index : {0u, 1u, 99999u}) {
            for (std::uint32_t generation : {0u, 1u, 2u}) {
                for (std::uint32_t sub = 0; sub < 3; ++sub) {
                    use(item_counter(Domain::field, scatter, index, generation, sub));
                }
            }
        }
    }
    EXPECT_EQ(seen.size(), made);
}

TEST(Poisson, TablesHaveTheRightDistribution) {
    for (double rate : {1e-8, 1e-4, 0.01, 0.0625, 0.3, 1.0}) {
        const PoissonTable table = make_poisson_table(rate);
        const double mean = 512 * rate;
        double cumulative = 0, probability = 0;
        for (std::size_t n = 0; n < table.thresholds.size(); ++n) {
            probability = std::exp(double(n) * std::log(mean) - mean - std::lgamma(double(n) + 1));
            cumulative += probability;
            EXPECT_NEAR(table.thresholds[n] * 0x1p-32, cumulative, 1e-9) << "rate " << rate << ", n " << n;
        }
        const double next = std::exp(double(table.thresholds.size()) * std::log(mean) - mean -
                                     std::lgamma(double(table.thresholds.size()) + 1));
        EXPECT_GT(cumulative + next, 1 - 1e-9) << "rate " << rate << ": more events than the table holds";
    }
}

TEST(Poisson, CountsThresholdsAtOrBelowTheWord) {
    const PoissonTable table = make_poisson_table(0.01);
    for (std::size_t n = 0; n < table.thresholds.size(); ++n) {
        EXPECT_EQ(table.events(table.thresholds[n] - 1), int(n));
        EXPECT_EQ(table.events(table.thresholds[n]), int(n) + 1);
    }
    EXPECT_EQ(table.events(0), 0);
}

TEST(Poisson, LadderGivesTheLowestLevelThatSuffices) {
    const PoissonLadder ladder;
    for (float rate = 1e-9f; rate <= 1.0f; rate *= 1.013f) {
        const PoissonTable& level = ladder.level(rate);
        EXPECT_GE(level.rate, double(rate));
        if (level.rate > 0x1p-28) {
            EXPECT_LE(level.rate, 1.2500002 * double(rate));
        }
    }
    EXPECT_EQ(ladder.level(1.0f).rate, 1);
    EXPECT_EQ(ladder.level(0.125f).rate, 0.125);
    EXPECT_EQ(ladder.level(0.0f).rate, 0x1p-28);
}

TEST(SparseRate, IsMinusLogOfOneMinusP) {
    for (float p = 0; p <= 0.25f; p += 0.0007f) {
        EXPECT_NEAR(sparse_rate(p), -std::log1p(-double(p)), 1e-6 * double(p));
    }
}

// Counts how often each draw hits over many steps from a state in which every hit shows, and compares with p
// in units of the standard deviation; also pairs of neighbouring cells, which must be independent.
struct Frequency {
    double hits = 0, pairs = 0, cells = 0, pair_places = 0;
};

Frequency frequency_of(BitPlaneView plane, bool value) {
    Frequency f;
    const Extent& e = plane.extent;
    for (int k = 0; k < e.z; ++k) {
        for (int j = 0; j < e.y; ++j) {
            for (int i = 0; i < e.x; ++i) {
                const bool hit = plane.get(i, j, k) == value;
                f.hits += hit;
                f.cells += 1;
                if (i > 0) {
                    f.pairs += hit && plane.get(i - 1, j, k) == value;
                    f.pair_places += 1;
                }
            }
        }
    }
    return f;
}

void expect_probability(const Frequency& f, double p, const char* what) {
    const double sigma = std::sqrt(f.cells * p * (1 - p));
    EXPECT_NEAR(f.hits, f.cells * p, 4.5 * sigma) << what << ", p = " << p;
    const double pair_sigma = std::sqrt(f.pair_places * p * p) * 1.5;
    EXPECT_NEAR(f.pairs, f.pair_places * p * p, 4.5 * pair_sigma + 3) << what << " pairs, p = " << p;
}

// Each p visits another path: exact background level, the limit of births, that of extinctions in full blocks, dense with and
// without ties, certainty.
TEST(Births, HaveTheBackgroundsProbability) {
    for (double p : {1e-5, 0.001, 0.031, 0.032, 0.1, 0.124, 0.125, 0.3, 0.5, 0.997, 1.0, 0.0}) {
        AutomatonOptions o{.extent = {250, 199, 41}};
        o.field.background = {p, p, p};
        o.initial = InitialState::empty;
        Lattice start{BitPlane(o.extent), BitPlane(o.extent), BitPlane(o.extent)};
        for (int k = 0; k < o.extent.z; ++k) {
            for (int j = 0; j < o.extent.y; ++j) {
                for (int i = 0; i < o.extent.x; ++i) start.cld.set(i, j, k, true);
            }
        }
        o.seed = 5;
        Automaton automaton(o, std::move(start));
        automaton.step();
        expect_probability(frequency_of(automaton.hum(), true), p, "hum");
        expect_probability(frequency_of(automaton.act(), true), p, "act");
        expect_probability(frequency_of(automaton.cld(), false), p, "ext");
    }
}

// Sets each cell with the probability `density`.
BitPlane random_cloud(Extent extent, double density) {
    BitPlane cloud(extent);
    std::mt19937_64 words;
    for (int k = 0; k < extent.z; ++k)
        for (int j = 0; j < extent.y; ++j)
            for (int i = 0; i < extent.x; ++i) cloud.set(i, j, k, double(words() >> 11) * 0x1p-53 < density);
    return cloud;
}

// Cloud of each density visits another way of its extinction: by rank, on all cells, dense; at 0.24 and 0.26 blocks have fewer
// or more than 128 cells of cloud. Only these can be hit, each with p.
TEST(Births, ExtinguishCloudOfAnyDensityWithTheirProbability) {
    for (double density : {0.004, 0.03, 0.1, 0.24, 0.26}) {
        for (double p : {1e-4, 0.01, 0.12, 0.2, 0.24, 0.26}) {
            AutomatonOptions o{.extent = {250, 199, 41}, .seed = 11};
            o.field.background = {0, 0, p};
            Lattice start{BitPlane(o.extent), BitPlane(o.extent), random_cloud(o.extent, density)};
            const BitPlane before = start.cld;
            Automaton automaton(o, std::move(start));
            automaton.step();
            const BitPlaneView after = automaton.cld();
            double hits = 0;
            for (std::size_t n = 0; n < after.word_count(); ++n) {
                EXPECT_EQ(after.words[n] & ~before.words()[n], 0u);
                hits += std::popcount(before.words()[n] & ~after.words[n]);
            }
            const double cells = double(before.count());
            EXPECT_NEAR(hits, cells * p, 4.5 * std::sqrt(cells * p * (1 - p))) << "cloud " << density << ", p = " << p;
        }
    }
}

// Inside ellipsoids p differs from cell to cell. Cells are gathered by their p into classes, over many seeds,
// and each class must be hit as often as its p says; the sum over classes is a chi-square.
// `density` of cloud at the start, of which extinction hits a part.
double chi_square_per_class(const AutomatonOptions& base, int draw, int seeds, double density = 1) {
    constexpr int kClasses = 12;
    std::vector<double> expected(kClasses), variance(kClasses), hits(kClasses);
    double highest = 0;
    std::vector<double> p_of_cell;
    for (int seed = 1; seed <= seeds; ++seed) {
        AutomatonOptions o = base;
        o.seed = std::uint64_t(seed) * 7919;
        Lattice start{BitPlane(o.extent), BitPlane(o.extent), BitPlane(o.extent)};
        if (draw == kExt) start.cld = random_cloud(o.extent, density);
        const BitPlane cloud = start.cld;
        Automaton automaton(o, std::move(start));
        if (p_of_cell.empty()) {
            const auto ellipsoids = automaton.ellipsoids();
            for (int k = 0; k < o.extent.z; ++k) {
                for (int j = 0; j < o.extent.y; ++j) {
                    for (int i = 0; i < o.extent.x; ++i) {
                        p_of_cell.push_back(reference::probability(o, ellipsoids, draw, i, j, k));
                        highest = std::max(highest, p_of_cell.back());
                    }
                }
            }
        }
        automaton.step();
        const BitPlaneView plane = draw == kHum   ? automaton.hum()
                                   : draw == kAct ? automaton.act()
                                                  : automaton.cld();
        std::size_t n = 0;
        for (int k = 0; k < o.extent.z; ++k) {
            for (int j = 0; j < o.extent.y; ++j) {
                for (int i = 0; i < o.extent.x; ++i, ++n) {
                    if (draw == kExt && !cloud.view().get(i, j, k)) continue;
                    const double p = p_of_cell[n];
                    const auto c = std::size_t(std::min(kClasses - 1.0, p / highest * kClasses));
                    expected[c] += p;
                    variance[c] += p * (1 - p);
                    hits[c] += plane.get(i, j, k) != (draw == kExt);
                }
            }
        }
    }
    double chi_square = 0;
    for (std::size_t c = 0; c < kClasses; ++c) {
        if (variance[c] > 5)
            chi_square += (hits[c] - expected[c]) * (hits[c] - expected[c]) / variance[c] / kClasses;
        if (expected[c] == 0) {
            EXPECT_EQ(hits[c], 0);
        }
    }
    return chi_square;
}

TEST(Births, HaveTheEllipsoidsProbability) {
    for (double scale : {0.02, 0.2, 0.24, 0.9}) {  // births sparse three times, then dense
        AutomatonOptions o{.extent = {64, 56, 48}};
        o.placement.cell_size_m = 10;
        o.field.background = {0.05 * scale, 0, scale};
        Ellipsoid a;
        a.centre_m = {300, 260, 200};
        a.semi_axes_m = {310, 150, 190};
        a.yaw_deg = 30;
        a.centre = {scale, 0.8 * scale, 0.05 * scale};
        a.rim = {0.1 * scale, 0, 0.7 * scale};
        Ellipsoid b = a;
        b.centre_m = {420, 330, 280};
        b.yaw_deg = -70;
        o.field.ellipsoids = {a, b};
        for (int draw : {kHum, kAct, kExt}) {
            const double chi_square = chi_square_per_class(o, draw, 12);
            EXPECT_LT(chi_square, 2.7) << "draw " << draw << ", scale " << scale;  // P < 0.002 for 12 classes
            EXPECT_GT(chi_square, 0.1) << "draw " << draw << ", scale " << scale;
        }
        for (double density : {0.05, 0.24, 0.4}) {  // extinctions by rank, either way, and on all cells
            const double chi_square = chi_square_per_class(o, kExt, 24, density);
            EXPECT_LT(chi_square, 2.7) << "cloud " << density << ", scale " << scale;
            EXPECT_GT(chi_square, 0.1) << "cloud " << density << ", scale " << scale;
        }
    }
}

// p per cell in float32, as the kernels compute it, against the formula in double.
TEST(Field, EvaluatesTheFormulaOfItsHead) {
    AutomatonOptions o{.extent = {60, 50, 40}};
    o.placement = {{-3000, 5000, 800}, 25};
    o.boundaries = {Boundary::periodic, Boundary::open, Boundary::periodic};
    o.field.background = {0.01, 0.002, 0.4};
    std::vector<ActiveEllipsoid> ellipsoids;
    for (int n = 0; n < 5; ++n) {
        Ellipsoid e;
        e.centre_m = {-3000 + 300.0 * n, 5100 + 250.0 * n, 900 + 200.0 * n};
        e.semi_axes_m = {150 + 90.0 * n, 400, 120 + 60.0 * n};
        e.yaw_deg = 40.0 * n - 90;
        e.centre = {0.6, 0.1, 0.05};
        e.rim = {0.2, 0.003, 0.3};
        ellipsoids.push_back({e, 0.3 + 0.15 * n});
    }
    const Background background(o);
    const BlockField field(o, ellipsoids, background);
    std::vector<const FieldEllipsoid*> row;
    BlockPlan plan;
    for (int bz = 0; bz < 5; ++bz) {
        for (int by = 0; by < 7; ++by) {
            field.collect(by, bz, row);
            for (int bx = 0; bx < 8; ++bx) {
                field.plan_blocks(bx, by, bz, row, std::span(&plan, 1));
                for (int cell = 0; cell < 512; cell += 3) {
                    const int dx = cell % 8, dy = cell / 8 % 8, dz = cell / 64;
                    const int i = 8 * bx + dx, j = 8 * by + dy, k = 8 * bz + dz;
                    if (i >= 60 || j >= 50 || k >= 40) continue;
                    for (int draw : {kHum, kAct, kExt}) {
                        EXPECT_NEAR(double(probability_at(plan, draw, dx, dy, dz)),
                                    reference::probability(o, ellipsoids, draw, i, j, k), 2e-5)
                            << i << ' ' << j << ' ' << k << " draw " << draw;
                    }
                }
            }
        }
    }
}

TEST(Threshold, KeepsZeroAndOne) {
    EXPECT_EQ(probability_threshold(0.0f), 0u);
    EXPECT_EQ(probability_threshold(1.0f), kCertain);
    EXPECT_EQ(probability_threshold(0.5f), 0x80000000u);
    EXPECT_NEAR(probability_threshold(0.37f) * 0x1p-32, 0.37, 1e-7);
}

}  // namespace
}  // namespace nephos
