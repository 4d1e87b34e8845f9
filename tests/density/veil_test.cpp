// SPDX-License-Identifier: Apache-2.0

// Veils: equal to their naive twin, the same bits for any threads and vectors, carried by the wind, changing
// smoothly, covering what they are told to, and ending where they are told to.

#include "density/veil.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include "automaton/checkpoint.h"
#include "core/error.h"
#include "density/statistics.h"
#include "tests/reference/reference_veil.h"
#include "tests/reference/with_threads.h"

namespace nephos {
namespace {

constexpr Extent kExtent{45, 37, 21};  // no whole blocks
const Placement kPlacement{{-1000, 500, 5000}, 80};

Wind steady_wind(double east, double north) { return {{{0, {{0, {east, north}}}}}}; }

// Everything on: displaced ridges, a profile, a margin, trails.
VeilOptions every_option() {
    VeilOptions o;
    o.form = VeilForm::cirrus;
    o.octave_count = 3;
    o.wavelength_m = 1500;
    o.stretch = 3;
    o.stretch_up = 2;
    o.displacement = 0.4;
    o.evolution_m_per_s = 3;
    o.direction_deg = 33;
    o.coverage = 0.7;
    o.softness = 0.8;
    o.sheet = 0.1;
    o.base_m = 5100;
    o.top_m = 6500;
    o.soft_base_m = 600;
    o.soft_top_m = 150;
    o.fallstreak_m = 2500;
    o.margin_m = 400;
    o.seed = 0x123456789abcdef;
    return o;
}

std::vector<VeilOptions> every_form() {
    std::vector<VeilOptions> all;
    for (const VeilForm form :
         {VeilForm::cumulus, VeilForm::stratus, VeilForm::cirrus, VeilForm::cirrostratus}) {
        all.push_back(every_option());
        all.back().form = form;
    }
    return all;
}

std::string hash_text(const DensityGrid& grid) {
    const std::vector<float> values = grid.to_dense();
    return hash_of_bytes(std::as_bytes(std::span(values))).hex();
}

Vec3 centre(int i, int j, int k) {
    const double h = kPlacement.cell_size_m;
    const Vec3& o = kPlacement.origin_m;
    return {o.x + (i + 0.5) * h, o.y + (j + 0.5) * h, o.z + (k + 0.5) * h};
}

// Floats lie within a few 2^-18 of the twin's doubles: positions in a block are up to 20 lattice cells from
// its base, and q's slope is divided by the range of the thresholds.
TEST(Veil, EqualsTheTwinInEveryForm) {
    const Velocity wind{21, -7};
    for (const VeilOptions& options : every_form()) {
        const double time_s = 1234.5;
        const DensityGrid grid = veil_density(options, steady_wind(21, -7), kExtent, kPlacement, time_s);
        const VeilThresholds at = veil_thresholds(options);
        const test::ReferenceVeil twin(options, wind, time_s);
        const double h = kPlacement.cell_size_m;
        double worst = 0;
        for (int k = 0; k < kExtent.z; ++k) {
            for (int j = 0; j < kExtent.y; ++j) {
                for (int i = 0; i < kExtent.x; ++i) {
                    const Vec3 p = centre(i, j, k);
                    const double weight = twin.weight_at(p.z, (std::min(i, kExtent.x - 1 - i) + 0.5) * h,
                                                         (std::min(j, kExtent.y - 1 - j) + 0.5) * h);
                    double expected = twin.density(twin.sum_at(p), double(at.low), double(at.high), weight);
                    if (expected < 0x1p-10) expected = 0;
                    const double value = double(grid.value(i, j, k));
                    // Just below and just above the least density are as good as each other.
                    if (std::min(value, expected) == 0 && std::max(value, expected) < 0x1.01p-10) continue;
                    worst = std::max(worst, std::abs(value - expected));
                }
            }
        }
        EXPECT_LT(worst, 1e-4) << int(options.form);
        EXPECT_GT(grid.active_voxels(), kExtent.cells() / 10);
    }
}

// The golden hash holds for every kind of vector and any number of threads.
TEST(Veil, HasTheSameBitsEverywhere) {
    const char* const golden[] = {"85f7ef80d17388f4f8170e458bc8863a", "b1691d7f77cba4bee2875dbb31a34e75",
                                  "d3f29e3b8bf06530680838fb516c6341", "13ea5a5cc8f42d934956ee60bd63f0f5"};
    const std::vector<VeilOptions> forms = every_form();
    const auto hash = [&](std::size_t n) {
        return hash_text(veil_density(forms[n], steady_wind(9, 4), kExtent, kPlacement, 600));
    };
    for (std::size_t n = 0; n < forms.size(); ++n) {
        for (const std::size_t threads : {1, 2, 3, 5, 8}) {
            EXPECT_EQ(test::with_threads(threads, [&] { return hash(n); }), golden[n]) << threads;
        }
    }
    const std::int64_t supported = hwy::SupportedTargets();
    for (std::int64_t target = HWY_SCALAR; target > 0; target >>= 1) {
        if ((target & (supported | HWY_SCALAR)) == 0) continue;
        hwy::SetSupportedTargetsForTest(target);
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
        for (std::size_t n = 0; n < forms.size(); ++n)
            EXPECT_EQ(hash(n), golden[n]) << hwy::TargetName(target);
    }
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().DeInit();
}

// A part of a veil has the bits that the whole has there: what lies beyond a lattice does not matter.
TEST(Veil, IsAFunctionOfPlace) {
    VeilOptions options = every_option();
    options.margin_m = 0;
    const DensityGrid whole = veil_density(options, {}, kExtent, kPlacement, 0);
    const Placement inner{{-1000 + 16 * 80.0, 500 + 8 * 80.0, 5000}, 80};
    const DensityGrid part = veil_density(options, {}, {20, 20, 21}, inner, 0);
    double worst = 0;
    for (int k = 0; k < 21; ++k) {
        for (int j = 0; j < 20; ++j) {
            for (int i = 0; i < 20; ++i) {
                worst = std::max(
                    worst, std::abs(double(part.value(i, j, k)) - double(whole.value(i + 16, j + 8, k))));
            }
        }
    }
    EXPECT_LT(worst, 1e-4);
}

// A tile of 24 x 20 cells, seen through a window of two by two; fibres lie askew.
VeilOptions repeating(VeilForm form) {
    VeilOptions o = every_option();
    o.form = form;
    o.wavelength_m = 700;
    o.lacunarity = 2;
    o.stretch = 2;
    o.margin_m = 0;
    o.period_m = {24 * 80.0, 20 * 80.0};
    o.area = {.x_m = 100, .y_m = 900, .semi_a_m = 900, .semi_b_m = 700, .yaw_deg = 25, .softness = 0.3};
    return o;
}

// Beyond an edge of the period the veil goes on as at the opposite edge, at any time and in any wind.
TEST(Veil, RepeatsWithItsPeriod) {
    for (const VeilOptions& form : every_form()) {
        const VeilOptions options = repeating(form.form);
        const DensityGrid grid = veil_density(options, steady_wind(21, -7), {48, 40, 21}, kPlacement, 4321);
        double worst = 0, largest = 0, other = 0;
        for (int k = 0; k < 21; ++k) {
            for (int j = 0; j < 20; ++j) {
                for (int i = 0; i < 24; ++i) {
                    const double here = double(grid.value(i, j, k));
                    for (const auto& [di, dj] : {std::pair{24, 0}, {0, 20}, {24, 20}})
                        worst = std::max(worst, std::abs(double(grid.value(i + di, j + dj, k)) - here));
                    largest = std::max(largest, here);
                    other = std::max(other, std::abs(double(grid.value((i + 12) % 24, j, k)) - here));
                }
            }
        }
        EXPECT_LT(worst, 2e-4) << int(options.form);
        EXPECT_GT(largest, 0.2);
        EXPECT_GT(other, 0.2);  // and not with half of it
    }
}

// A place of the lattice that is n cells further shows the array rolled by n cells.
TEST(Veil, OfAPeriodRollsWithTheLattice) {
    const VeilOptions options = repeating(VeilForm::cirrus);
    const Extent tile{24, 20, 21};
    const DensityGrid home = veil_density(options, {}, tile, kPlacement, 50);
    for (const auto& [di, dj] : {std::pair{1, 0}, {5, 13}, {-7, 3}, {24, 20}}) {
        Placement moved = kPlacement;
        moved.origin_m += Vec3(di * 80.0, dj * 80.0, 0);
        const DensityGrid rolled = veil_density(options, {}, tile, moved, 50);
        double worst = 0;
        for (int k = 0; k < tile.z; ++k)
            for (int j = 0; j < tile.y; ++j)
                for (int i = 0; i < tile.x; ++i)
                    worst = std::max(worst, std::abs(double(rolled.value(i, j, k)) -
                                                     double(home.value((i + di + 24) % 24, (j + dj + 20) % 20, k))));
        EXPECT_LT(worst, 2e-4) << di << " " << dj;
    }
}

TEST(Veil, OfAPeriodEqualsTheTwin) {
    for (const VeilOptions& form : every_form()) {
        VeilOptions options = repeating(form.form);
        options.area = {};
        const DensityGrid grid = veil_density(options, steady_wind(3, 2), {24, 20, 21}, kPlacement, 100);
        const VeilThresholds at = veil_thresholds(options);
        const test::ReferenceVeil twin(options, {3, 2}, 100);
        double worst = 0;
        for (int n = 0; n < 300; ++n) {
            const int i = n * 7 % 24, j = n * 11 % 20, k = 1 + n * 5 % 19;
            const Vec3 p = centre(i, j, k);
            const double expected = twin.density(twin.sum_at(p), double(at.low), double(at.high), twin.weight_at(p.z, 1, 1));
            const double value = double(grid.value(i, j, k));
            if (std::min(value, expected) < 0x1.01p-10) continue;
            worst = std::max(worst, std::abs(value - expected));
        }
        EXPECT_LT(worst, 1e-4) << int(options.form);
    }
}

// Half as many wavelengths as fit, and an area as large as the tile.
TEST(Veil, ThatDoesNotFitIntoItsPeriodIsRefused) {
    VeilOptions wide = repeating(VeilForm::stratus);
    wide.wavelength_m = 5000;
    EXPECT_THROW(veil_density(wide, {}, {24, 20, 21}, kPlacement, 0), Error);
    VeilOptions area = repeating(VeilForm::stratus);
    area.area.semi_a_m = 1500;
    EXPECT_THROW(veil_density(area, {}, {24, 20, 21}, kPlacement, 0), Error);
}

// With octaves that stand still in the wind, the veil is moved and nothing else.
TEST(Veil, IsCarriedByTheWindOfItsTop) {
    VeilOptions options = every_option();
    options.evolution_m_per_s = 0;
    options.margin_m = 0;
    Wind wind{{{0, {{0, {3, 3}}, {options.top_m, {8, -4}}}}}};
    const DensityGrid before = veil_density(options, wind, kExtent, kPlacement, 0);
    const DensityGrid after =
        veil_density(options, wind, kExtent, kPlacement, 100);  // 10 cells east, 5 south
    double worst = 0;
    for (int k = 0; k < kExtent.z; ++k) {
        for (int j = 0; j + 5 < kExtent.y; ++j) {
            for (int i = 10; i < kExtent.x; ++i) {
                worst = std::max(
                    worst, std::abs(double(after.value(i, j, k)) - double(before.value(i - 10, j + 5, k))));
            }
        }
    }
    EXPECT_LT(worst, 1e-4);
}

TEST(Veil, FollowsAWindThatChanges) {
    const Wind wind{{{100, {{0, {10, 0}}}}, {200, {{0, {20, -10}}}}}};
    const auto way = [&](double time_s) { return wind_displacement_m(wind, 500, time_s); };
    EXPECT_EQ(way(0), (Vec3{0, 0, 0}));
    EXPECT_EQ(way(50), (Vec3{500, 0, 0}));
    EXPECT_EQ(way(150), (Vec3{1000 + 625, -125, 0}));
    EXPECT_EQ(way(300), (Vec3{1000 + 1500 + 2000, -500 - 1000, 0}));
    EXPECT_EQ(way(-10), (Vec3{-100, 0, 0}));
    EXPECT_EQ(wind_displacement_m({}, 0, 1000), (Vec3{0, 0, 0}));
}

// No popping: over a second the density changes little everywhere, over an hour the pattern is another one.
TEST(Veil, EvolvesSmoothly) {
    for (VeilOptions options : every_form()) {
        options.margin_m = 0;
        const auto at = [&](double time_s) {
            return veil_density(options, {}, kExtent, kPlacement, time_s).to_dense();
        };
        const auto difference = [](const std::vector<float>& a, const std::vector<float>& b) {
            double most = 0, sum = 0;
            for (std::size_t n = 0; n < a.size(); ++n) {
                const double d = std::abs(double(a[n]) - double(b[n]));
                most = std::max(most, d);
                sum += d;
            }
            return std::pair{most, sum / double(a.size())};
        };
        const std::vector<float> now = at(1000);
        const auto soon = difference(now, at(1001)), late = difference(now, at(4600));
        EXPECT_LT(soon.first, 0.08) << int(options.form);
        EXPECT_GT(late.second, 5 * soon.second);
        EXPECT_GT(late.second, 0.05);
    }
}

// The share of a level above the threshold, over an area of many wavelengths; the least density takes a
// little.
TEST(Veil, CoversWhatItIsTold) {
    for (const VeilForm form :
         {VeilForm::cumulus, VeilForm::stratus, VeilForm::cirrus, VeilForm::cirrostratus}) {
        for (const double coverage : {0.2, 0.6, 1.0}) {
            VeilOptions options;
            options.form = form;
            options.wavelength_m = 1000;
            options.octave_count = 3;
            options.displacement = 0.5;
            options.coverage = coverage;
            options.softness = 0;
            options.soft_base_m = options.soft_top_m = 0;
            const DensityGrid grid = veil_density(options, {}, {400, 400, 1}, {{0, 0, 400}, 100}, 0);
            EXPECT_NEAR(cloud_statistics(grid).cover, coverage, 0.04) << int(form);
            EXPECT_EQ(grid.max_value(), 1);
        }
    }
}

TEST(Veil, FadesTowardsTheSidesAndTheEnds) {
    VeilOptions options;
    options.form = VeilForm::stratus;
    options.sheet = 1;
    options.base_m = 5000;
    options.top_m = 5000 + 20 * 80;
    options.soft_base_m = 400;
    options.soft_top_m = 0;
    options.margin_m = 800;
    const DensityGrid grid = veil_density(options, {}, {60, 40, 21}, kPlacement, 0);
    EXPECT_EQ(grid.value(30, 20, 19), 1);
    EXPECT_EQ(grid.value(30, 20, 20), 0);  // above the top
    for (int n = 0; n < 12; ++n) {
        EXPECT_LE(grid.value(n, 20, 10), grid.value(n + 1, 20, 10));
        EXPECT_EQ(grid.value(n, 20, 10), grid.value(59 - n, 20, 10));
        EXPECT_EQ(grid.value(30, n, 10), grid.value(n, 20, 10));
    }
    EXPECT_LT(grid.value(0, 20, 10), 0.02f);
    EXPECT_EQ(grid.value(10, 20, 10), 1);
    for (int k = 0; k < 5; ++k) EXPECT_LT(grid.value(30, 20, k), grid.value(30, 20, k + 1));
}

// The area in a formula of its own: full inside, clear outside, in between a smoothstep; it stands or drifts.
TEST(Veil, IsLimitedToItsArea) {
    VeilOptions options;
    options.form = VeilForm::stratus;
    options.sheet = 1;
    options.soft_base_m = options.soft_top_m = 0;
    options.base_m = 5000;
    options.top_m = 6600;
    options.area = {
        .x_m = 900, .y_m = 1900, .semi_a_m = 1500, .semi_b_m = 700, .yaw_deg = 30, .softness = 0.4};
    const Wind wind = steady_wind(8, -4);
    for (const bool carried : {false, true}) {
        options.area.carried = carried;
        const double time_s = 50, x = carried ? 1300 : 900, y = carried ? 1700 : 1900;
        const DensityGrid grid = veil_density(options, wind, kExtent, kPlacement, time_s);
        int inside = 0, between = 0;
        for (int j = 0; j < kExtent.y; ++j) {
            for (int i = 0; i < kExtent.x; ++i) {
                const Vec3 from = centre(i, j, 5) - Vec3(x, y, 0);
                const double c = std::sqrt(0.75), s = 0.5;
                const double r =
                    std::hypot((from.x * c + from.y * s) / 1500, (from.y * c - from.x * s) / 700);
                const double t = std::clamp((1 - r) / 0.4, 0.0, 1.0), expected = t * t * (3 - 2 * t);
                EXPECT_NEAR(double(grid.value(i, j, 5)), expected, 0.002);
                inside += expected == 1;
                between += expected > 0 && expected < 1;
            }
        }
        EXPECT_GT(inside, 50);
        EXPECT_GT(between, 100);
    }
    options.area.semi_b_m = std::numeric_limits<double>::infinity();  // a strip
    const DensityGrid strip = veil_density(options, {}, kExtent, kPlacement, 0);
    EXPECT_EQ(strip.value(23, 15, 5), 1);
    EXPECT_EQ(strip.value(44, 36, 5), 0);
}

// A head of the pattern is found again below, behind by the parabola.
TEST(Veil, TrailsBehindAsAParabola) {
    VeilOptions options;
    options.form = VeilForm::stratus;
    options.octave_count = 1;
    options.wavelength_m = 800;
    options.stretch_up = 1000;  // the same pattern at all heights
    options.base_m = 5000;
    options.top_m = 5000 + 20 * 80;
    options.soft_base_m = options.soft_top_m = 0;
    options.fallstreak_m = 1600 * 25.6;
    const DensityGrid grid = veil_density(options, {}, {200, 4, 20}, {{0, 0, 5000}, 80}, 0);
    // 2.5, 4.5 and 16.5 cells below the top: (n / 20)^2 * 1600 * 25.6 m
    const auto behind_m = [](double cells) { return cells / 20 * cells / 20 * 1600 * 25.6; };
    for (const int k : {17, 15, 3}) {
        const int moved = int(std::lround((behind_m(20 - k - 0.5) - behind_m(0.5)) / 80));
        double worst = 0;
        for (int i = moved; i < 200; ++i) {
            worst =
                std::max(worst, std::abs(double(grid.value(i - moved, 2, k)) - double(grid.value(i, 2, 19))));
        }
        EXPECT_LT(worst, 0.13) << k;  // whole cells alone: half a cell of a pattern of ten
    }
}

TEST(Veil, StatisticsAreThoseOfItsVoxels) {
    const DensityGrid grid = veil_density(every_option(), {}, kExtent, kPlacement, 0);
    const CloudStatistics statistics = cloud_statistics(grid);
    std::uint64_t cells = 0, columns = 0;
    int low = kExtent.z, high = -1;
    for (int j = 0; j < kExtent.y; ++j) {
        for (int i = 0; i < kExtent.x; ++i) {
            bool any = false;
            for (int k = 0; k < kExtent.z; ++k) {
                if (!(grid.value(i, j, k) > 0)) continue;
                ++cells;
                any = true;
                low = std::min(low, k);
                high = std::max(high, k);
            }
            columns += any;
        }
    }
    EXPECT_GT(cells, 0u);
    EXPECT_EQ(statistics.cld, cells);
    EXPECT_EQ(statistics.hum, 0u);
    EXPECT_DOUBLE_EQ(statistics.cover, double(columns) / (kExtent.x * kExtent.y));
    EXPECT_DOUBLE_EQ(statistics.base_m, 5000 + low * 80);
    EXPECT_DOUBLE_EQ(statistics.top_m, 5000 + (high + 1) * 80);
    EXPECT_TRUE(
        std::isnan(cloud_statistics(DensityGrid::from_dense(std::vector<float>(8), {2, 2, 2}, {})).base_m));
}

TEST(Veil, RefusesBadOptionsByName) {
    const auto message = [](auto change) {
        VeilOptions options = every_option();
        change(options);
        try {
            veil_density(options, {}, kExtent, kPlacement, 0);
        } catch (const Error& error) {
            return std::string(error.what());
        }
        return std::string("no error");
    };
    const auto contains = [](const std::string& text, const char* part) {
        return text.find(part) != std::string::npos;
    };
    EXPECT_PRED2(contains, message([](VeilOptions& o) { o.coverage = 0; }), "coverage");
    EXPECT_PRED2(contains, message([](VeilOptions& o) { o.softness = std::nan(""); }), "softness");
    EXPECT_PRED2(contains, message([](VeilOptions& o) { o.octave_count = 13; }), "octaves");
    EXPECT_PRED2(contains, message([](VeilOptions& o) { o.persistence = 1; }), "persistence");
    EXPECT_PRED2(contains, message([](VeilOptions& o) { o.wavelength_m = 300; }), "two cells");
    EXPECT_PRED2(contains, message([](VeilOptions& o) { o.area.semi_a_m = 0; }), "area.semi_a_m");
    EXPECT_PRED2(contains, message([](VeilOptions& o) { o.area.softness = 2; }), "area.softness");
    EXPECT_PRED2(contains, message([](VeilOptions& o) { o.top_m = o.base_m; }), "top_m");
    EXPECT_PRED2(contains, message([](VeilOptions& o) { o.base_m = 7000, o.top_m = 8000; }),
                 "no cell's centre");
    EXPECT_PRED2(contains, message([](VeilOptions& o) { o.octaves = {{}, {{100, 500, 500}}}; }), "octave[1]");
    EXPECT_PRED2(contains, message([](VeilOptions& o) {
                     o.octaves = {{}, {}};
                     o.octaves[1].displacement_m.x = 1e6;
                     o.octaves[0].gain = 100;
                 }),
                 "displaced");
    const double infinity = std::numeric_limits<double>::infinity();
    EXPECT_THROW(veil_density(every_option(), {}, kExtent, kPlacement, infinity), Error);
}

}  // namespace
}  // namespace nephos
