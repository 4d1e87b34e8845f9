// SPDX-License-Identifier: Apache-2.0

// Connected components against flood fill, sizes against a known distribution, indices of organisation.

#include "statistics/clouds.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <numbers>
#include <random>

#include "statistics/cloud_sizes.h"
#include "statistics/cloud_statistics.h"
#include "statistics/organisation.h"
#include <gtest/gtest.h>

#include "tests/statistics/random_planes.h"

namespace nephos {
namespace {

using Step = std::array<int, 3>;

constexpr std::array<Step, 6> kFaces{{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};
constexpr std::array<Step, 4> kCorners{{{1, 1, 0}, {-1, 1, 0}, {1, -1, 0}, {-1, -1, 0}}};

// The mean of positions along an axis, cell by cell; along a periodic one the circular mean, 0 where it has no direction.
class NaiveMean {
  public:
    NaiveMean(int cells, Boundary boundary) : cells_(cells), periodic_(boundary == Boundary::periodic) {}
    void add(int at) {
        const double angle = 2 * std::numbers::pi * (at + 0.5) / cells_;
        ++count_;
        sum_ += at + 0.5;
        sine_ += std::sin(angle);
        cosine_ += std::cos(angle);
    }
    double value() const {
        if (!periodic_) return sum_ / count_;
        if (std::hypot(sine_, cosine_) < 1e-9 * count_) return 0;
        return std::atan2(sine_, cosine_) / (2 * std::numbers::pi) * cells_;
    }

  private:
    int cells_;
    bool periodic_;
    double count_ = 0, sum_ = 0, sine_ = 0, cosine_ = 0;
};

// The components of a plane by flood fill.
std::vector<ConnectedCloud> flood_fill(const BitPlane& plane, const Boundaries& b, bool corners) {
    const Extent e = plane.extent();
    std::vector<bool> done(e.cells());
    std::vector<ConnectedCloud> clouds;
    for (std::size_t start = 0; start < e.cells(); ++start) {
        const int i0 = int(start % std::size_t(e.x)), j0 = int(start / std::size_t(e.x) % std::size_t(e.y)),
                  k0 = int(start / std::size_t(e.x) / std::size_t(e.y));
        if (done[start] || !plane.get(i0, j0, k0)) continue;
        ConnectedCloud cloud;
        cloud.lowest = cloud.highest = k0;
        bool low[3] = {}, high[3] = {};
        NaiveMean means[3] = {{e.x, b.x}, {e.y, b.y}, {e.z, b.z}};
        std::deque<Step> open{{i0, j0, k0}};
        done[start] = true;
        while (!open.empty()) {
            const auto [i, j, k] = open.front();
            open.pop_front();
            ++cloud.cells;
            cloud.lowest = std::min(cloud.lowest, k);
            cloud.highest = std::max(cloud.highest, k);
            const int at[3] = {i, j, k}, size[3] = {e.x, e.y, e.z};
            for (int axis = 0; axis < 3; ++axis) {
                means[axis].add(at[axis]);
                low[axis] |= at[axis] == 0;
                high[axis] |= at[axis] == size[axis] - 1;
            }
            const auto visit = [&](const Step& step, bool face) {
                const int x = test::neighbour(i, step[0], e.x, b.x),
                          y = test::neighbour(j, step[1], e.y, b.y),
                          z = test::neighbour(k, step[2], e.z, b.z);
                if (x < 0 || y < 0 || z < 0) return;
                if (!plane.get(x, y, z)) {
                    cloud.edges += face;
                    return;
                }
                const std::size_t next = linear_index(e, x, y, z);
                if (!done[next]) open.push_back({x, y, z});
                done[next] = true;
            };
            for (const Step& step : kFaces)
                if (e.z > 1 || step[2] == 0) visit(step, true);
            if (corners)
                for (const Step& step : kCorners) visit(step, false);
        }
        const bool open_x = b.x == Boundary::open, open_y = b.y == Boundary::open;
        cloud.cut = (open_x && (low[0] || high[0])) || (open_y && (low[1] || high[1])) ||
                    (e.z > 1 && b.z == Boundary::open && (low[2] || high[2]));
        cloud.spans = (open_x && low[0] && high[0]) || (open_y && low[1] && high[1]);
        cloud.x = means[0].value();
        cloud.y = means[1].value();
        if (e.z > 1) cloud.z = means[2].value();
        clouds.push_back(cloud);
    }
    return clouds;
}

void expect_same(const std::vector<ConnectedCloud>& got, const std::vector<ConnectedCloud>& expected) {
    ASSERT_EQ(got.size(), expected.size());
    for (std::size_t n = 0; n < got.size(); ++n) {
        SCOPED_TRACE(n);
        EXPECT_EQ(got[n].cells, expected[n].cells);
        EXPECT_EQ(got[n].edges, expected[n].edges);
        EXPECT_EQ(got[n].lowest, expected[n].lowest);
        EXPECT_EQ(got[n].highest, expected[n].highest);
        EXPECT_EQ(got[n].cut, expected[n].cut);
        EXPECT_EQ(got[n].spans, expected[n].spans);
    }
}

void expect_near(double got, double expected, int cells, Boundary boundary) {
    const bool around = boundary == Boundary::periodic;
    EXPECT_NEAR(around ? std::remainder(got - expected, cells) : got - expected, 0, 1e-6) << got;
    EXPECT_GE(got, 0);
    EXPECT_LT(got, cells);
}

void expect_same_centroids(const std::vector<ConnectedCloud>& got,
                           const std::vector<ConnectedCloud>& expected, const Extent& e,
                           const Boundaries& b) {
    ASSERT_EQ(got.size(), expected.size());
    for (std::size_t n = 0; n < got.size(); ++n) {
        SCOPED_TRACE(n);
        expect_near(got[n].x, expected[n].x, e.x, b.x);
        expect_near(got[n].y, expected[n].y, e.y, b.y);
        expect_near(got[n].z, expected[n].z, e.z, b.z);
    }
}

void expect_all(const std::vector<ConnectedCloud>& got, const std::vector<ConnectedCloud>& expected,
                const Extent& e, const Boundaries& b) {
    expect_same(got, expected);
    expect_same_centroids(got, expected, e, b);
}

// What is counted before memory is taken: the runs of the shadow, one by one.
TEST(Clouds, RunsOfTheShadowAreCounted) {
    std::mt19937_64 random(31);
    for (const Extent extent :
         {Extent{1, 1, 1}, Extent{64, 3, 2}, Extent{65, 9, 1}, Extent{200, 7, 3}, Extent{129, 1, 5}}) {
        const BitPlane plane = test::random_cells(extent, 0.3, random), shadow = shadow_of(plane.view());
        std::uint64_t runs = 0;
        for (int j = 0; j < extent.y; ++j)
            for (int i = 0; i < extent.x; ++i)
                runs += shadow.get(i, j, 0) && (i == 0 || !shadow.get(i - 1, j, 0));
        EXPECT_EQ(count_shadow_runs(plane.view()), runs);
        EXPECT_GE(clouds_2d_bytes(extent, runs),
                  runs * (sizeof(CellRun) + 56) + clouds_2d(plane.view(), {}).size() * sizeof(ConnectedCloud))
            << "56 bytes of sums a cloud";
    }
}

TEST(Clouds, MatchFloodFill) {
    for (std::uint64_t seed = 1; seed < 80; ++seed) {
        SCOPED_TRACE(seed);
        std::mt19937_64 random(seed);
        const Extent flat{int(random() % 140) + 1, int(random() % 20) + 1, 1};
        const Extent deep{int(random() % 80) + 1, int(random() % 8) + 1, int(random() % 8) + 2};
        const Boundaries b = test::random_boundaries(random);
        const double p = 0.1 * double(1 + seed % 7);
        const BitPlane shadow = test::random_cells(flat, p, random),
                       cld = test::random_cells(deep, p / 2, random);
        const Boundaries from_above{b.x, b.y, Boundary::open};
        expect_all(clouds_2d(shadow.view(), b), flood_fill(shadow, from_above, false), flat, from_above);
        expect_all(clouds_2d(shadow.view(), b, Neighbours::eight), flood_fill(shadow, from_above, true), flat,
                   from_above);
        expect_all(clouds_3d(cld.view(), b), flood_fill(cld, b, false), deep, b);
        const std::vector<ConnectedCloud> sizes = cloud_sizes_2d(shadow.view(), b);
        expect_same(sizes, clouds_2d(shadow.view(), b));
        for (const ConnectedCloud& cloud : sizes) EXPECT_TRUE(cloud.x == 0 && cloud.y == 0 && cloud.z == 0);
        // What the shadow's edges sum up to is the perimeter of the state.
        std::uint64_t edges = 0;
        for (const ConnectedCloud& cloud : clouds_2d(shadow.view(), b)) edges += cloud.edges;
        EXPECT_EQ(edges, count_cloud(shadow.view(), b).edges);
    }
}

TEST(Clouds, CentroidsGoAroundPeriodicSides) {
    BitPlane cld({70, 5, 1});
    for (const int i : {68, 69, 0, 1}) cld.set(i, 2, 0, true);
    const std::vector<ConnectedCloud> around =
        clouds_2d(cld.view(), {Boundary::periodic, Boundary::open, Boundary::open});
    ASSERT_EQ(around.size(), 1u);
    EXPECT_NEAR(std::remainder(around[0].x, 70), 0, 1e-9);
    EXPECT_LT(around[0].x, 70);
    EXPECT_NEAR(around[0].y, 2.5, 1e-12);
    const std::vector<ConnectedCloud> apart = clouds_2d(cld.view(), {});
    ASSERT_EQ(apart.size(), 2u);
    EXPECT_NEAR(apart[0].x, 1, 1e-12);
    EXPECT_NEAR(apart[1].x, 69, 1e-12);
}

// Clouds drawn from a^-2.3 exactly: both estimates must find it within their errors; the edges 4 sqrt(a) make D = 1.
TEST(CloudSizes, FindAKnownExponent) {
    const SizeRange range{36, 40000};
    constexpr double kExponent = 2.3;
    std::vector<double> cumulative;
    double sum = 0;
    for (std::uint64_t a = range.first; a <= range.last; ++a)
        cumulative.push_back(sum += std::pow(double(a), -kExponent));
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> uniform(0, sum);
    std::vector<ConnectedCloud> clouds;
    for (int n = 0; n < 100'000; ++n) {
        ConnectedCloud cloud;
        cloud.cells = range.first + std::uint64_t(std::ranges::lower_bound(cumulative, uniform(random)) -
                                                  cumulative.begin());
        cloud.edges = std::uint64_t(std::llround(4000 * std::sqrt(double(cloud.cells))));
        clouds.push_back(cloud);
    }
    CloudSizes sizes(range), half(range);
    sizes.add(std::span(clouds).first(50'000));
    half.add(std::span(clouds).subspan(50'000));
    sizes.add(half);
    const Estimate likelihood = sizes.likelihood_exponent(), line = sizes.line_exponent();
    EXPECT_NEAR(likelihood.value, kExponent, 4 * likelihood.error);
    EXPECT_LT(likelihood.error, 0.01);
    EXPECT_NEAR(line.value, kExponent, 0.05);
    EXPECT_NEAR(sizes.fractal_dimension().value, 1, 1e-3);
    EXPECT_EQ(sizes.clouds(), 100'000u);
    CloudSizes few(range);
    few.add(std::span(clouds).first(10));
    EXPECT_TRUE(std::isnan(few.likelihood_exponent().value) && std::isnan(few.line_exponent().value));
}

// The exponent whose mean logarithm is the observed one, by bisection alone over the sums of all areas of the range; NaN
// where it is not within -19 .. 39.
Estimate naive_likelihood(const SizeRange& range, std::span<const ConnectedCloud> clouds) {
    double observed = 0, mean = 0, variance = 0;
    for (const ConnectedCloud& cloud : clouds)
        observed += std::log(double(cloud.cells)) / double(clouds.size());
    double low = -20, high = 40;
    for (int n = 0; n < 60; ++n) {
        const double t = (low + high) / 2;
        double sum = 0, first = 0, second = 0;
        for (std::uint64_t a = range.first; a <= range.last; ++a) {
            // Relative to the smallest area, and about the observed logarithm, so that no digits are lost.
            const double log_a = std::log(double(a)),
                         weight = std::exp(-t * (log_a - std::log(double(range.first))));
            sum += weight;
            first += weight * (log_a - observed);
            second += weight * (log_a - observed) * (log_a - observed);
        }
        mean = first / sum;
        variance = second / sum - mean * mean;
        (mean > 0 ? low : high) = t;
    }
    if (low < -19 || high > 39) return {std::nan(""), std::nan("")};
    return {(low + high) / 2, 1 / std::sqrt(double(clouds.size()) * variance)};
}

TEST(CloudSizes, LikelihoodMatchesPlainBisection) {
    std::mt19937_64 random(9);
    int found = 0, steep = 0, rising = 0, none = 0;
    for (int round = 0; round < 120; ++round) {
        SCOPED_TRACE(round);
        // Beyond areas of 1,024 the library integrates.
        const std::uint64_t first = 1 + random() % 60,
                            last = first + 1 + random() % (round % 4 == 0 ? 3000 : 900);
        // From all clouds at the small end of the range to all at its large one.
        const double power = std::pow(2.0, double(round % 12) - 6);
        std::vector<ConnectedCloud> clouds(24 + random() % 100);
        std::uniform_real_distribution<double> unit(0, 1);
        for (ConnectedCloud& cloud : clouds) {
            cloud.cells = first + std::uint64_t(std::pow(unit(random), power) * double(last - first) + 0.5);
            cloud.edges = cloud.cells;
        }
        CloudSizes sizes({first, last});
        sizes.add(clouds);
        const Estimate got = sizes.likelihood_exponent(), expected = naive_likelihood({first, last}, clouds);
        ASSERT_EQ(std::isnan(got.value), std::isnan(expected.value)) << got.value << " " << expected.value;
        if (std::isnan(expected.value)) {
            EXPECT_TRUE(std::isnan(got.error));
            ++none;
            continue;
        }
        ++found;
        steep += expected.value > 5;
        rising += expected.value < -5;
        EXPECT_NEAR(got.value, expected.value, 1e-6 * (1 + std::abs(expected.value)));
        EXPECT_NEAR(got.error, expected.error, 1e-5 * expected.error);
    }
    EXPECT_GT(found, 80);
    EXPECT_TRUE(steep > 0 && rising > 0 && none > 0) << steep << " " << rising << " " << none;
}

// Clouds that an open side cuts have lost an unknown part: neither estimate may see them.
TEST(CloudSizes, CutCloudsAreLeftOut) {
    const SizeRange range{36, 4000};
    std::vector<ConnectedCloud> whole, cut;
    for (std::uint64_t a = 36; a <= 4000; ++a)
        for (int n = 0; n < int(4e6 / std::pow(double(a), 2.5)); ++n) {
            whole.push_back({.cells = a, .edges = a});
            // A third more in small bins, none in large ones.
            if (a < 300 && n % 3 == 0) cut.push_back({.cells = a, .edges = a, .cut = true});
        }
    CloudSizes clean(range), both(range);
    clean.add(whole);
    both.add(whole);
    both.add(cut);
    EXPECT_EQ(both.line_exponent().value, clean.line_exponent().value);
    EXPECT_EQ(both.likelihood_exponent().value, clean.likelihood_exponent().value);
    EXPECT_EQ(both.clouds(), whole.size() + cut.size());
    EXPECT_EQ(both.count(size_bin(100)) - both.count_cut(size_bin(100)), clean.count(size_bin(100)));
}

TEST(CloudSizes, BinsHoldHalfOctaves) {
    EXPECT_EQ(size_bin(1), 0);
    EXPECT_EQ(size_bin(2), 2);
    EXPECT_EQ(size_bin(3), 3);
    EXPECT_EQ(size_bin(4), 4);
    for (std::uint64_t area = 1; area < 5000; ++area) {
        const double exact = 2 * std::log2(double(area));
        EXPECT_EQ(size_bin(area), int(std::floor(exact + 1e-9))) << area;
    }
}

// Points without size at random places: Iorg 0.500 +- 0.007 over 20 draws of 1,000; on a grid it is far below.
TEST(Organisation, OfRandomPointsIsAHalf) {
    const Extent extent{4096, 2048, 1};
    const Boundaries periodic{Boundary::periodic, Boundary::periodic, Boundary::open};
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> x(0, extent.x), y(0, extent.y);
    double sum = 0;
    for (int draw = 0; draw < 20; ++draw) {
        std::vector<ConnectedCloud> points(1000);
        for (ConnectedCloud& point : points) {
            point.cells = 1;
            point.x = x(random);
            point.y = y(random);
        }
        sum += organisation(points, extent, periodic).iorg;
    }
    EXPECT_NEAR(sum / 20, 0.5, 0.007);
    std::vector<ConnectedCloud> grid(32 * 16);
    for (int n = 0; n < 32 * 16; ++n) {
        grid[std::size_t(n)].cells = 1;
        grid[std::size_t(n)].x = n % 32 * 128;
        grid[std::size_t(n)].y = n / 32 * 128;
    }
    EXPECT_LT(organisation(grid, extent, periodic).iorg, 0.05);
    // Two clouds of four columns, eight apart: the definitions by hand.
    std::vector<ConnectedCloud> two(2);
    two[0].cells = two[1].cells = 4;
    two[1].x = 8;
    const Organisation pair = organisation(two, {100, 100, 1}, {});
    EXPECT_NEAR(pair.cop, 4 / (8 * std::sqrt(std::numbers::pi)), 1e-12);
    EXPECT_NEAR(pair.scai, 1000 * 2 / 5000.0 * 8 / std::hypot(100, 100), 1e-12);
    EXPECT_TRUE(std::isnan(organisation({}, extent, {}).iorg));
}

std::vector<ConnectedCloud> random_clouds(std::size_t count, const Extent& extent, std::mt19937_64& random) {
    std::uniform_real_distribution<double> unit(0, 1);
    std::vector<ConnectedCloud> clouds(count);
    for (ConnectedCloud& cloud : clouds) {
        cloud.cells = 1 + random() % 40;
        // Half of them in a corner, so that squares are empty or full.
        const double part = random() % 2 == 0 ? 0.1 : 1;
        cloud.x = part * unit(random) * extent.x;
        cloud.y = part * unit(random) * extent.y;
    }
    return clouds;
}

// The definitions, pair by pair.
Organisation naive_organisation(const std::vector<ConnectedCloud>& clouds, const Extent& extent,
                                const Boundaries& b) {
    const auto along = [](double from, double to, int cells, Boundary boundary) {
        const double d = std::abs(from - to);
        return boundary == Boundary::periodic ? std::min(d, cells - d) : d;
    };
    const std::size_t n = clouds.size();
    std::vector<double> nearest(n, 1e300);
    double logarithms = 0, potential = 0;
    for (std::size_t one = 0; one < n; ++one) {
        for (std::size_t other = one + 1; other < n; ++other) {
            const double dx = along(clouds[one].x, clouds[other].x, extent.x, b.x),
                         dy = along(clouds[one].y, clouds[other].y, extent.y, b.y);
            const double d = std::max(0.1, std::sqrt(dx * dx + dy * dy));
            nearest[one] = std::min(nearest[one], d);
            nearest[other] = std::min(nearest[other], d);
            logarithms += std::log(d);
            potential += (std::sqrt(double(clouds[one].cells)) + std::sqrt(double(clouds[other].cells))) / d;
        }
    }
    std::ranges::sort(nearest);
    const double columns = double(extent.x) * extent.y, pairs = double(n) * double(n - 1) / 2;
    double iorg = 0, before = 0;
    for (std::size_t k = 0; k < n; ++k) {
        const double g = 1 - std::exp(-double(n) / columns * std::numbers::pi * nearest[k] * nearest[k]);
        iorg += double(k) / double(n) * (g - before);
        before = g;
    }
    return {iorg + (1 - before),
            1000 * double(n) / (columns / 2) * std::exp(logarithms / pairs) / std::hypot(extent.x, extent.y),
            potential / std::sqrt(std::numbers::pi) / pairs};
}

TEST(Organisation, MatchesTheNaiveTwin) {
    std::mt19937_64 random(5);
    for (int round = 0; round < 60; ++round) {
        SCOPED_TRACE(round);
        const Extent extent{int(random() % 300) + 1, int(random() % 60) + 1, 1};
        const Boundaries b = test::random_boundaries(random);
        const std::vector<ConnectedCloud> clouds = random_clouds(random() % 200 + 2, extent, random);
        const Organisation got = organisation(clouds, extent, b),
                           expected = naive_organisation(clouds, extent, b);
        EXPECT_DOUBLE_EQ(got.iorg, expected.iorg);
        EXPECT_DOUBLE_EQ(got.scai, expected.scai);
        EXPECT_DOUBLE_EQ(got.cop, expected.cop);
    }
}

// Beyond 10,000 clouds a sample of pairs stands for all of them.
TEST(Organisation, OfManyCloudsSamplesPairs) {
    std::mt19937_64 random(6);
    const Extent extent{2048, 1024, 1};
    const Boundaries periodic{Boundary::periodic, Boundary::periodic, Boundary::open};
    const std::vector<ConnectedCloud> clouds = random_clouds(kMaxCloudsOfAllPairs + 1, extent, random);
    const Organisation got = organisation(clouds, extent, periodic),
                       expected = naive_organisation(clouds, extent, periodic);
    EXPECT_DOUBLE_EQ(got.iorg, expected.iorg);
    EXPECT_NEAR(got.scai, expected.scai, 0.001 * expected.scai);
    EXPECT_NEAR(got.cop, expected.cop, 0.001 * expected.cop);
    EXPECT_EQ(organisation(clouds, extent, periodic).cop, got.cop);
}

// The null value of a cover of 0.3 is 0.24, not 0.5.
TEST(Organisation, TheNullOfACoverIsNotAHalf) {
    const Extent extent{256, 128, 20};
    const Boundaries periodic{Boundary::periodic, Boundary::periodic, Boundary::open};
    const NullOrganisation null = null_organisation(extent, periodic, 0.3, 4, 1);
    EXPECT_NEAR(null.mean.iorg, 0.24, 0.02);
    EXPECT_LT(null.deviation.iorg, 0.02);
    EXPECT_EQ(null_organisation(extent, periodic, 0.3, 4, 1).mean.cop, null.mean.cop);
}

// With 0.7 % of 20 x 10 columns covered many draws have no two clouds; the others still have a mean.
TEST(Organisation, DrawsWithoutTwoCloudsAreLeftOut) {
    const Extent extent{20, 10, 1};
    const NullOrganisation null = null_organisation(extent, {}, 0.007, 40, 1);
    EXPECT_GT(null.mean.iorg, 0);
    EXPECT_GT(null.deviation.scai, 0);
    const NullOrganisation none = null_organisation(extent, {}, 0, 4, 1);
    EXPECT_TRUE(std::isnan(none.mean.iorg) && std::isnan(none.deviation.iorg));
}

}  // namespace
}  // namespace nephos
