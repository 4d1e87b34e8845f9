// SPDX-License-Identifier: Apache-2.0
#include "density/detail.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>
#include <hwy/targets.h>
#include <tbb/global_control.h>

#include "core/error.h"
#include "density/detail_noise.h"
#include "density/metaballs.h"

namespace nephos {
namespace {

constexpr double kCell = 40;

// Random clouds: a field of domes, as the automaton makes them.
DensityGrid domes(Extent extent, std::uint32_t seed) {
    std::vector<float> values(extent.cells(), 0.0f);
    std::uint32_t state = seed * 2654435761u + 1;
    const auto random = [&state] {
        state = state * 1664525u + 1013904223u;
        return double(state >> 8) / 16777216;
    };
    for (int dome = 0; dome < 24; ++dome) {
        const double cx = random() * extent.x, cy = random() * extent.y, radius = 4 + 8 * random(),
                     height = 4 + 9 * random(), most = 0.1 + 0.5 * random();
        for (int k = 0; k < extent.z; ++k)
            for (int j = 0; j < extent.y; ++j)
                for (int i = 0; i < extent.x; ++i) {
                    const double r = std::hypot((i + 0.5 - cx) / radius, (j + 0.5 - cy) / radius, (k - 1) / height);
                    float& q = values[linear_index(extent, i, j, k)];
                    if (r < 1 && k > 0) q = std::max(q, float(most * (1 - r) * (0.6 + 0.4 * random())));
                }
    }
    return DensityGrid::from_dense(values, extent, {Vec3(-1000, 300, 900), kCell});
}

DetailSetting cumulus_setting() {
    DetailSetting setting;
    setting.extinction_per_m = 0.15;
    setting.metaball_radius_cells = 1.5;
    setting.options.apron_cells = 0;
    return setting;
}

double mass_of(const CoverageField& field, double footprint) {
    const auto& bricks = field.bricks();
    const double edge = field.node_m() * (CoverageField::kBrickNodes - 1);
    std::array<int, 3> count{};
    for (std::size_t axis = 0; axis < 3; ++axis) count[axis] = int(std::lround(bricks[axis] * edge / footprint));
    const std::vector<float> values = detailed_density(field, field.corner_m(), count, footprint);
    return std::accumulate(values.begin(), values.end(), 0.0) * footprint * footprint * footprint;
}

TEST(DetailNoise, IsDistributedEvenlyAndTiles) {
    for (const auto& [bytes, edge] : {std::pair(large_noise_bytes(), kLargeNoiseVoxels),
                                      std::pair(small_noise_bytes(), kSmallNoiseVoxels)}) {
        std::array<double, 256> count{};
        for (const std::uint8_t byte : bytes) ++count[byte];
        const double expected = double(bytes.size()) / 256;
        for (const double of_value : count) EXPECT_NEAR(of_value, expected, 0.02 * expected);
        // Across the faces neighbours differ as they do inside.
        const auto n = std::size_t(edge);
        const auto difference = [&](std::size_t x) {
            double sum = 0;
            for (std::size_t row = 0; row < n * n; ++row)
                sum += std::abs(int(bytes[row * n + x]) - int(bytes[row * n + (x + 1) % n]));
            return sum / double(n * n);
        };
        double inside = 0;
        for (std::size_t x = 0; x + 1 < n; ++x) inside += difference(x) / double(n - 1);
        EXPECT_NEAR(difference(n - 1), inside, 0.25 * inside);
    }
}

TEST(DetailNoise, WordsHaveTheirNeighbours) {
    const auto bytes = large_noise_bytes();
    const auto at = [&](std::size_t x, std::size_t y, std::size_t z) {
        return std::uint32_t(bytes[(z * 128 + y % 128) * 128 + x % 128]);
    };
    for (const auto& [x, y, z] : {std::array<std::size_t, 3>{0, 0, 0}, {127, 5, 64}, {77, 127, 127}, {127, 127, 1}})
        EXPECT_EQ(detail_noise().large[(z * 128 + y) * 128 + x],
                  at(x, y, z) | at(x + 1, y, z) << 8 | at(x, y + 1, z) << 16 | at(x + 1, y + 1, z) << 24);
    EXPECT_EQ(detail_noise().small.size(), first_of_level(kSmallNoiseLevels));
}

// Kernels of every instruction set against the scalar reference.
TEST(Detail, KernelsAgreeWithTheReference) {
    const DensityGrid grid = domes({40, 32, 20}, 3);
    DetailSetting setting = cumulus_setting();
    setting.options.stretch = 3;
    setting.along = Vec2(0.6, 0.8);
    setting.drift_m = Vec3(1234.5, -321, 0);
    DetailSetting sheared = setting;
    sheared.bands = {170, {{-30, 20}, {-10, 0}, {15, 40}, {30, 70}}};
    const CoverageField alike(grid, setting), apart(grid, sheared);
    const std::int64_t targets = hwy::SupportedTargets();
    for (std::int64_t rest = targets; rest != 0; rest &= rest - 1) {
        hwy::SetSupportedTargetsForTest(rest & -rest);
        for (const auto& [of, footprint] : std::vector<std::pair<const CoverageField*, double>>{
                 {&alike, 30.0}, {&alike, 10.0}, {&alike, 1.5}, {&apart, 30.0}, {&apart, 10.0}, {&apart, 1.5}}) {
            const CoverageField& field = *of;
            const Vec3 corner = grid.placement().origin_m + Vec3(300, 250, 0);
            const std::array<int, 3> count{23, 7, int(700 / footprint)};
            const auto values = detailed_density(field, corner, count, footprint);
            double worst = 0, sum = 0;
            for (std::size_t n = 0; n < values.size(); ++n) {
                const Vec3 at(double(n % 23), double(n / 23 % 7), double(n / 23 / 7));
                const float expected =
                    detailed_density_at(field, corner + footprint * (at + Vec3(0.5)), float(footprint));
                worst = std::max(worst, double(std::abs(expected - values[n])));
                sum += double(expected);
            }
            EXPECT_LT(worst, 1e-3) << hwy::TargetName(rest & -rest) << ", " << footprint;
            EXPECT_GT(sum, 1);
        }
    }
    hwy::SetSupportedTargetsForTest(0);
}

TEST(Detail, KeepsTheMass) {
    for (const std::uint32_t seed : {1u, 2u, 3u}) {
        const DensityGrid grid = domes({64, 64, 20}, seed);
        const CoverageField field(grid, cumulus_setting());
        const double mass = grid.sum() * kCell * kCell * kCell;
        EXPECT_NEAR(mass_of(field, 20) / mass, 1, 0.01) << seed;
        EXPECT_NEAR(mass_of(field, 10) / mass, 1, 0.02) << seed;
        DetailSetting sheared = cumulus_setting();
        sheared.bands = {160, {{-600, 0}, {-300, 0}, {0, 0}, {300, 0}, {600, 0}}};
        EXPECT_NEAR(mass_of(CoverageField(grid, sheared), 10) / mass, 1, 0.02) << seed;
    }
}

// In a layer of one density, which looks the same from everywhere but for its noise.
TEST(Detail, EachHeightDriftsWithItsOwnWind) {
    const Extent extent{48, 48, 20};
    const DensityGrid grid =
        DensityGrid::from_dense(std::vector<float>(extent.cells(), 0.08f), extent, {Vec3(-1000, 300, 900), kCell});
    DetailSetting setting = cumulus_setting();
    setting.options.thermals = 0;
    DetailSetting later = setting;
    later.drift_m = {50, -20, 0};
    later.bands = {160, {{-120, 30}, {-60, 0}, {0, 0}, {90, 10}, {200, -40}}};
    const CoverageField before(grid, setting), after(grid, later);
    double worst = 0;
    int some = 0;
    for (int n = 0; n < 4000; ++n) {
        const int band = n % 5;
        const double middle = 160 * (band + 0.5), at_height = middle + 50 * (n * 17 % 101 / 50.0 - 1);
        const Vec3 place = grid.placement().origin_m + Vec3(500 + n * 37 % 900, 500 + n * 53 % 900, at_height);
        const Vec3 way = later.drift_m + Vec3(later.bands.apart_m[std::size_t(band)], 0.0);
        const float was = detailed_density_at(before, place, 3), is = detailed_density_at(after, place + way, 3);
        some += was > 0 && was < 0.08f * 4 ? 1 : 0;
        worst = std::max(worst, double(std::abs(was - is)));
    }
    EXPECT_LT(worst, 0.02);
    EXPECT_GT(some, 500);
}

// Where one band passes into the next, there is neither more nor less cloud than elsewhere, and no step.
TEST(Detail, BandsPassIntoEachOther) {
    const Extent extent{64, 64, 20};
    const DensityGrid grid =
        DensityGrid::from_dense(std::vector<float>(extent.cells(), 0.08f), extent, {Vec3(0, 0, 900), kCell});
    DetailSetting setting = cumulus_setting();
    setting.options.thermals = 0;
    setting.options.wisps = 0;
    setting.bands = {160, {{-500, 300}, {-200, 100}, {0, 0}, {200, -100}, {500, -300}}};
    const CoverageField field(grid, setting);
    const auto plane_at = [&](double height) {
        return detailed_density(field, grid.placement().origin_m + Vec3(300, 300, height), {200, 200, 1}, 10);
    };
    const auto mean_of = [](const std::vector<float>& values) {
        return std::accumulate(values.begin(), values.end(), 0.0) / double(values.size());
    };
    const double in_band = mean_of(plane_at(395)), between = mean_of(plane_at(475));
    EXPECT_NEAR(between / in_band, 1, 0.1);
    double usual = 0, largest = 0;
    for (double height = 322; height < 480; height += 1) {
        const std::vector<float> low = plane_at(height), high = plane_at(height + 1);
        double change = 0;
        for (std::size_t n = 0; n < low.size(); ++n) change += double(std::abs(high[n] - low[n]));
        usual += change / 158;
        largest = std::max(largest, change);
    }
    EXPECT_LT(largest, 2 * usual);
    EXPECT_GT(usual, 0);
}

// The same places in air that has drifted, and in a grid that has moved with it.
TEST(Detail, DriftsWithTheWind) {
    const DensityGrid grid = domes({40, 40, 20}, 5);
    const Extent extent = grid.extent();
    Placement moved = grid.placement();
    const Vec3 way(8 * kCell, -4 * kCell, 0);
    moved.origin_m += way;
    const CoverageField before(grid, cumulus_setting());
    DetailSetting later = cumulus_setting();
    later.drift_m = way;
    const CoverageField after(DensityGrid::from_dense(grid.to_dense(), extent, moved), later);
    double worst = 0;
    for (int n = 0; n < 4000; ++n) {
        const Vec3 place = grid.placement().origin_m + Vec3(n * 37 % 1600, n * 53 % 1600, n * 11 % 800) + Vec3(0.25);
        worst = std::max(worst, double(std::abs(detailed_density_at(before, place, 3) -
                                                detailed_density_at(after, place + way, 3))));
    }
    EXPECT_LT(worst, 0.02);  // places in the noise are single precision
}

TEST(Detail, FieldIsThatOfTheMetaballs) {
    const DensityGrid grid = domes({40, 32, 20}, 7);
    DetailSetting setting = cumulus_setting();
    setting.options.thermals = 0;
    const CoverageField field(grid, setting);
    // Nodes lie at corners of half cells; so do the middles of voxels half a cell further on a grid refined twice.
    const Placement& placement = grid.placement();
    const float half = field.erosion().half_density;
    std::size_t compared = 0;
    for (std::size_t n = 0; n < field.places().size(); ++n) {
        const std::int32_t at = field.places()[n];
        const auto& bricks = field.bricks();
        const Vec3 brick(at % bricks[0], at / bricks[0] % bricks[1], at / bricks[0] / bricks[1]);
        for (const int node : {0, 100, 364, 500, 728}) {
            const Vec3 place = field.corner_m() + field.node_m() * (8.0 * brick + Vec3(node % 9, node / 9 % 9, node / 81));
            double sum = 0, weight = 0;
            const Vec3 cells = (place - placement.origin_m) / kCell;
            for (int k = -2; k <= 2; ++k)
                for (int j = -2; j <= 2; ++j)
                    for (int i = -2; i <= 2; ++i) {
                        const Vec3 cell = glm::floor(cells) + Vec3(i, j, k);
                        const double f = metaball_field(glm::length(cell + Vec3(0.5) - cells) / 1.5);
                        weight += f;
                        sum += f * double(grid.value(int(cell.x), int(cell.y), int(cell.z)));
                    }
            const double density = sum / weight, t = density / (density + double(half));
            EXPECT_NEAR(field.nodes()[n * CoverageField::kBrickBytes + 2 * std::size_t(node)], 255 * t, 0.51);
            ++compared;
        }
    }
    EXPECT_GT(compared, 200u);
}

TEST(Detail, DissolvingCloudIsTornAndGrowingIsNot) {
    const DensityGrid grid = domes({64, 64, 20}, 13);
    std::vector<float> moist(grid.extent().cells());
    for (std::size_t n = 0; n < moist.size(); ++n) moist[n] = n % 64 < 32 ? 0.02f : 0.2f;
    const DensityGrid moisture = DensityGrid::from_dense(moist, grid.extent(), grid.placement());
    const CoverageField with(grid, cumulus_setting(), &moisture), without(grid, cumulus_setting());
    // Edges between cloud and air along lines, for each place that is cloud.
    const auto edges_of = [&](const CoverageField& field, int first) {
        int cloudy = 0, edges = 0;
        for (int line = 0; line < 400; ++line) {
            bool last = false;
            for (int n = 0; n < 150; ++n) {
                const Vec3 place = grid.placement().origin_m + Vec3(first * kCell + 90 + 7 * n, 40 + line * 97 % 2400,
                                                                    60 + line * 31 % 600);
                const bool cloud = detailed_density_at(field, place, 4) > 0;
                cloudy += cloud ? 1 : 0;
                edges += cloud != last ? 1 : 0;
                last = cloud;
            }
        }
        return double(edges) / cloudy;
    };
    EXPECT_GT(edges_of(with, 0) / edges_of(without, 0), 1.05);   // dissolves
    EXPECT_NEAR(edges_of(with, 32) / edges_of(without, 32), 1, 0.1);  // grows
}

TEST(Detail, RefinedGridHasTheSameDensity) {
    const DensityGrid grid = domes({40, 40, 20}, 17);
    const CoverageField field(grid, cumulus_setting());
    for (const int refine : {1, 3, 4}) {
        const DensityGrid fine = resample_with_detail(field, grid.extent(), grid.placement(), refine);
        EXPECT_EQ(fine.extent(), (Extent{40 * refine, 40 * refine, 20 * refine}));
        const double voxel = kCell / refine;
        EXPECT_DOUBLE_EQ(fine.placement().cell_size_m, voxel);
        std::size_t cloudy = 0;
        for (int n = 0; n < 5000; ++n) {
            const int at[3] = {n * 7 % fine.extent().x, n * 13 % fine.extent().y, n * 5 % fine.extent().z};
            const Vec3 place = grid.placement().origin_m + voxel * Vec3(at[0] + 0.5, at[1] + 0.5, at[2] + 0.5);
            const float value = fine.value(at[0], at[1], at[2]);
            EXPECT_NEAR(value, detailed_density_at(field, place, float(voxel)), 2e-3);
            cloudy += value > 0 ? 1 : 0;
        }
        EXPECT_GT(cloudy, 100u);
    }
}

TEST(Detail, DoesNotDependOnTheNumberOfThreads) {
    const DensityGrid grid = domes({64, 64, 20}, 19);
    std::vector<std::vector<std::uint8_t>> nodes;
    std::vector<std::vector<float>> cells;
    for (const std::size_t threads : {1u, 2u, 3u}) {
        const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
        const CoverageField field(grid, cumulus_setting());
        nodes.push_back(field.nodes());
        cells.push_back(field.cell_density());
    }
    EXPECT_EQ(nodes[0], nodes[1]);
    EXPECT_EQ(nodes[0], nodes[2]);
    EXPECT_EQ(cells[0], cells[1]);
    EXPECT_EQ(cells[0], cells[2]);
}

TEST(Detail, PeriodicSidesMeet) {
    const DensityGrid grid = domes({32, 32, 20}, 23);
    DetailSetting setting = cumulus_setting();
    setting.options.thermals = 0;
    setting.boundaries.x = setting.boundaries.y = Boundary::periodic;
    const CoverageField field(grid, setting);
    const auto t_at = [&](double x, double y, double z) {  // a node, cells from the lattice's corner
        const Vec3 nodes = (grid.placement().origin_m + kCell * Vec3(x, y, z) - field.corner_m()) / field.node_m();
        const int at[3] = {int(std::lround(nodes.x)), int(std::lround(nodes.y)), int(std::lround(nodes.z))};
        const auto& bricks = field.bricks();
        const std::int32_t brick =
            field.table()[std::size_t((at[2] / 8 * bricks[1] + at[1] / 8) * bricks[0] + at[0] / 8)];
        if (brick < 0) return 0;
        return int(field.nodes()[std::size_t(brick) * CoverageField::kBrickBytes +
                                 2 * std::size_t((at[2] % 8 * 9 + at[1] % 8) * 9 + at[0] % 8)]);
    };
    int some = 0;
    for (int y = 0; y < 32; ++y) {
        for (int z = 1; z < 18; ++z) {
            EXPECT_EQ(t_at(0, y, z), t_at(32, y, z));
            EXPECT_EQ(t_at(y, 0, z), t_at(y, 32, z));
            some += t_at(0, y, z) > 0 ? 1 : 0;
        }
    }
    EXPECT_GT(some, 20);
}

// With the same noise on both sides: no seam where a periodic lattice meets its image.
TEST(Detail, RepeatsWithPeriodicSides) {
    const DensityGrid grid = domes({40, 32, 20}, 29);
    DetailSetting setting = cumulus_setting();
    setting.boundaries.x = setting.boundaries.y = Boundary::periodic;
    setting.drift_m = {777, -333, 0};
    const CoverageField field(grid, setting);
    EXPECT_DOUBLE_EQ(field.period_m().x, 40 * kCell);
    EXPECT_DOUBLE_EQ(field.period_m().y, 32 * kCell);
    const Vec3 corner = grid.placement().origin_m;
    int some = 0;
    for (int n = 0; n < 4000; ++n) {
        const double along = n * 7.3, up = 40 + n * 31 % 700;
        const Vec3 west = corner + Vec3(n % 60 - 20, std::fmod(along, 32 * kCell), up),
                   south = corner + Vec3(std::fmod(along, 40 * kCell), n % 60 - 20, up);
        for (const float footprint : {1.0f, 20.0f}) {
            const float density = detailed_density_at(field, west, footprint);
            some += density > 0 ? 1 : 0;
            EXPECT_NEAR(density, detailed_density_at(field, west + Vec3(40 * kCell, 0, 0), footprint), 0.01);
            EXPECT_NEAR(detailed_density_at(field, south, footprint),
                        detailed_density_at(field, south + Vec3(0, 32 * kCell, 0), footprint), 0.01);
        }
        const Vec3 far = field.at_home(west - field.corner_m() + Vec3(-3 * 40, 7 * 32, 0) * kCell),
                   near = field.at_home(west - field.corner_m());
        EXPECT_NEAR(glm::length(far - near), 0, 1e-6);
    }
    EXPECT_GT(some, 300);
    setting.options.to_horizon = false;
    EXPECT_EQ(CoverageField(grid, setting).period_m().x, 0);
}

TEST(Detail, ThinsOutTowardsOpenSides) {
    const DensityGrid grid = DensityGrid::from_dense(std::vector<float>(64 * 64 * 8, 0.5f), {64, 64, 8}, {Vec3(0), kCell});
    DetailSetting setting = cumulus_setting();
    setting.options.strength = setting.options.thermals = 0;
    setting.options.apron_cells = 8;
    setting.boundaries.y = Boundary::periodic;
    const CoverageField field(grid, setting);
    const auto at = [&](double x, double y) {
        return double(detailed_density_at(field, Vec3(x, y, 4) * kCell, 10));
    };
    const double whole = at(32, 32);
    EXPECT_NEAR(whole, 0.5, 0.02);
    EXPECT_LT(at(0.5, 32), 0.02 * whole);
    EXPECT_NEAR(at(4, 32), 0.5 * whole, 0.1 * whole);
    EXPECT_NEAR(at(60, 32), 0.5 * whole, 0.1 * whole);
    EXPECT_NEAR(at(12, 32), whole, 0.02 * whole);
    EXPECT_NEAR(at(32, 1), whole, 0.02 * whole);  // periodic
    setting.options.apron_cells = 0;
    EXPECT_GT(detailed_density_at(CoverageField(grid, setting), Vec3(1, 32, 4) * kCell, 10), 0.4f);
}

TEST(Detail, RefusesOptionsOutOfRange) {
    const DensityGrid grid = domes({16, 16, 8}, 1);
    for (const auto change : {+[](DetailOptions& o) { o.size_m = 1; }, +[](DetailOptions& o) { o.strength = 2; },
                              +[](DetailOptions& o) { o.stretch = 0.5; }, +[](DetailOptions& o) { o.wisps = -1; },
                              +[](DetailOptions& o) { o.thermals = 1.5; },
                              +[](DetailOptions& o) { o.mean_free_path_m = 0.5; },
                              +[](DetailOptions& o) { o.apron_cells = 65; }}) {
        DetailSetting setting = cumulus_setting();
        change(setting.options);
        EXPECT_THROW(CoverageField(grid, setting), Error);
    }
    const CoverageField field(grid, cumulus_setting());
    EXPECT_THROW(resample_with_detail(field, grid.extent(), grid.placement(), 9), Error);
}

// A tenth of the density: with the mean free path of three quarters of a cell next to nothing would be cloud. By itself
// the half density follows the cloud, a scene's own does not.
TEST(Detail, ThinCloudIsNotTorn) {
    const DensityGrid grid = domes({40, 40, 20}, 29);
    std::vector<float> thin = grid.to_dense(), thick = thin;
    for (float& q : thin) q *= 0.1f;
    for (float& q : thick) q = std::min(3 * q, 1.0f);
    const DensityGrid veil = DensityGrid::from_dense(thin, grid.extent(), grid.placement());
    DetailSetting setting = cumulus_setting();
    const double usual = 1 / (2 * 0.15 * 30);
    const DensityGrid dense = DensityGrid::from_dense(thick, grid.extent(), grid.placement());
    EXPECT_FLOAT_EQ(CoverageField(dense, setting).erosion().half_density, float(usual));
    const CoverageField field(veil, setting);
    double mass = 0, squares = 0;
    for (int k = 0; k < 20; k += 4)
        for (int j = 0; j < 40; j += 4)
            for (int i = 0; i < 40; i += 4) {
                double sum = 0;
                for (int n = 0; n < 64; ++n) sum += double(veil.value(i + n % 4, j + n / 4 % 4, k + n / 16));
                mass += sum;
                squares += sum * sum / 64;
            }
    EXPECT_NEAR(double(field.erosion().half_density), 0.7 * squares / mass, 1e-7);
    EXPECT_LT(double(field.erosion().half_density), 0.5 * usual);
    // The mass is kept.
    EXPECT_NEAR(mass_of(field, 20) / (kCell * kCell * kCell), veil.sum(), 0.03 * veil.sum());
    setting.options.mean_free_path_m = 30;
    EXPECT_FLOAT_EQ(CoverageField(veil, setting).erosion().half_density, float(usual));
}

TEST(Detail, EmptyGridHasNone) {
    const CoverageField field(DensityGrid::from_dense(std::vector<float>(512, 0.0f), {8, 8, 8}, {Vec3(0), 40}),
                              cumulus_setting());
    EXPECT_TRUE(field.places().empty());
    EXPECT_EQ(detailed_density_at(field, Vec3(100, 100, 100), 1), 0.0f);
}

}  // namespace
}  // namespace nephos
