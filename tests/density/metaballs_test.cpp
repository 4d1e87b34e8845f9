// SPDX-License-Identifier: Apache-2.0

// The metaball field against its polynomial, its integrals against quadrature, and the two normalisations
// against what they promise: exactly 1 in saturated regions, the right extinction on average.

#include "density/metaballs.h"

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include <glm/common.hpp>
#include <gtest/gtest.h>

#include "core/error.h"

namespace nephos {
namespace {

DensityGrid uniform_grid(Extent extent, float value, const Placement& placement = {}) {
    return DensityGrid::from_dense(std::vector<float>(extent.cells(), value), extent, placement);
}

DensityGrid random_grid(Extent extent, std::uint64_t seed, const Placement& placement = {}) {
    std::mt19937_64 random(seed);
    std::vector<float> values(extent.cells());
    for (float& v : values) v = random() % 3 ? 0.0f : float(random() % 1000 + 1) / 1000.0f;
    return DensityGrid::from_dense(values, extent, placement);
}

// Wyvill's polynomial: 1 - 22/9 a^2 + 17/9 a^4 - 4/9 a^6.
TEST(Metaballs, FieldIsThePolynomial) {
    EXPECT_EQ(metaball_field(0), 1.0);
    EXPECT_EQ(metaball_field(1), 0.0);
    EXPECT_EQ(metaball_field(1.5), 0.0);
    EXPECT_NEAR(metaball_field(0.5), 0.5, 1e-15);  // the wyvill field's half-way point
    double previous = 1;
    for (int n = 1; n <= 1000; ++n) {
        const double a = n / 1000.0, s = a * a;
        EXPECT_NEAR(metaball_field(a), 1 - 22.0 / 9 * s + 17.0 / 9 * s * s - 4.0 / 9 * s * s * s, 1e-14);
        EXPECT_LT(metaball_field(a), previous);
        previous = metaball_field(a);
    }
}

// The integral of f along the straight line that passes the centre at distance b R, in units of R. In closed
// form, with w = h^2 - s^2 and h^2 = 1 - b^2; the integrals of w^2 and w^3 over -h..h are 16/15 h^5 and 32/35 h^7.
double metaball_line_integral(double b) {
    if (!(b < 1)) return 0;
    const double h2 = 1 - b * b;
    return h2 * h2 * std::sqrt(h2) * (16.0 / 27.0 + 128.0 / 315.0 * h2);
}

// D at a point of the world, straight from the formula: all lattice points in reach, cells outside the grid 0.
double density_at(const DensityGrid& grid, const Vec3& point_m, double radius) {
    const Vec3 at = (point_m - grid.placement().origin_m) / grid.placement().cell_size_m;
    const int reach = int(radius) + 2;
    const glm::ivec3 cell(glm::floor(at));
    double sum = 0, weight = 0;
    for (int k = cell.z - reach; k <= cell.z + reach; ++k) {
        for (int j = cell.y - reach; j <= cell.y + reach; ++j) {
            for (int i = cell.x - reach; i <= cell.x + reach; ++i) {
                const Vec3 d = Vec3(i + 0.5, j + 0.5, k + 0.5) - at;
                const double f = metaball_field(std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z) / radius);
                weight += f;
                sum += f * double(grid.value(i, j, k));
            }
        }
    }
    return sum / weight;
}

// The oracle itself, by symmetry, for a box that is all cloud: on a face half of the weight lies inside, on an edge
// a quarter and on a corner an eighth; values as far inside of a face as outside add up to 1; nothing beyond reach.
// The box's corner is at a negative place, and so are the cells outside of it.
TEST(Metaballs, TheOracleIsSymmetricAtTheFacesOfABox) {
    const Vec3 corner{-3, -50, -700};
    const double cell = 12.5;
    const DensityGrid grid = uniform_grid({24, 24, 24}, 1.0f, {corner, cell});
    for (const double radius : {1.0, 1.3, 2.0, 3.5}) {
        const auto at = [&](double x, double y, double z) {
            return density_at(grid, corner + cell * Vec3{x, y, z}, radius);
        };
        EXPECT_NEAR(at(12.3, 11.9, 12.6), 1, 1e-12) << radius;
        EXPECT_NEAR(at(0, 12.3, 11.9), 0.5, 1e-12) << radius;
        EXPECT_NEAR(at(12.3, 24, 11.9), 0.5, 1e-12) << radius;
        EXPECT_NEAR(at(0, 12.3, 24), 0.25, 1e-12) << radius;
        EXPECT_NEAR(at(0, 0, 0), 0.125, 1e-12) << radius;
        for (double inside = 0.05; inside < radius; inside += 0.1)
            EXPECT_NEAR(at(inside, 12.3, 11.9) + at(-inside, 12.3, 11.9), 1, 1e-12)
                << radius << " " << inside;
        EXPECT_EQ(at(-radius - 0.5, 12.3, 11.9), 0) << radius;
    }
}

// Midpoint rule with 20000 points along the chord.
TEST(Metaballs, LineIntegralMatchesQuadrature) {
    for (double b : {0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 1.0, 2.0}) {
        double sum = 0;
        constexpr int kPoints = 20000;
        for (int n = 0; n < kPoints; ++n) {
            const double s = -1 + (n + 0.5) * 2 / kPoints;
            sum += metaball_field(std::sqrt(b * b + s * s)) * 2 / kPoints;
        }
        EXPECT_NEAR(metaball_line_integral(b), sum, 1e-7) << b;
    }
}

TEST(Metaballs, NormalisationIsTheCellOverTheIntegral) {
    for (double radius : {1.0, 2.0, 3.7}) {
        double integral = 0;
        constexpr int kShells = 20000;
        for (int n = 0; n < kShells; ++n) {
            const double a = (n + 0.5) / kShells;
            integral += metaball_field(a) * 4 * std::numbers::pi * a * a / kShells;
        }
        EXPECT_NEAR(metaball_normalisation(radius) * integral * radius * radius * radius, 1.0, 1e-7);
    }
}

// A renderer adds up, along a ray, the line integrals of the metaballs that the ray passes. Over many
// parallel rays through a saturated slab the mean must be the slab's thickness, and no ray may differ by more
// than the documented ripple.
TEST(Metaballs, RaysThroughASaturatedRegionSeeItsThickness) {
    for (const auto& [radius, ripple] : {std::pair{2.0, 0.022}, std::pair{3.0, 0.005}}) {
        constexpr int kLevels = 20, kRays = 16;
        double mean = 0;
        const int reach = int(std::ceil(radius)) + 1;
        for (int ray = 0; ray < kRays * kRays; ++ray) {
            const double x = (ray % kRays + 0.5) / kRays, y = (ray / kRays + 0.5) / kRays;
            double depth = 0;  // of kLevels layers of cells, in cell edges
            for (int j = -reach; j <= reach; ++j) {
                for (int i = -reach; i <= reach; ++i) {
                    const double b = std::hypot(i + 0.5 - x, j + 0.5 - y) / radius;
                    depth += kLevels * radius * metaball_line_integral(b);
                }
            }
            depth *= metaball_normalisation(radius);
            EXPECT_NEAR(depth, kLevels, kLevels * ripple);
            mean += depth / (kRays * kRays);
        }
        EXPECT_NEAR(mean, kLevels, kLevels * 1e-3);
    }
}

TEST(Metaballs, SaturatedIsExactlyOneAnywhere) {
    const Extent extent{24, 24, 24};
    const DensityGrid grid = uniform_grid(extent, 1.0f, {{-100, 30, 7}, 12.5});
    for (double radius : {1.0, 1.3, 2.0, 3.5, 8.0}) {
        const DensityGrid fine = resample(grid, 2, radius);
        const int margin = int(2 * radius) + 2;
        for (int k = margin; k < 48 - margin; ++k) ASSERT_EQ(fine.value(k, 24, 24), 1.0f) << radius;
        EXPECT_EQ(fine.max_value(), 1.0f);
    }
}

TEST(Metaballs, ResampledVoxelsAreTheFieldAtTheirCentres) {
    const Extent extent{13, 9, 11};
    const Placement placement{{50, 60, 70}, 8};
    const DensityGrid grid = random_grid(extent, 21, placement);
    for (const auto& [refine, radius] :
         {std::pair{1, 2.0}, std::pair{2, 1.0}, std::pair{3, 2.5}, std::pair{8, 1.5}}) {
        const DensityGrid fine = resample(grid, refine, radius);
        ASSERT_EQ(fine.extent(), (Extent{13 * refine, 9 * refine, 11 * refine}));
        EXPECT_EQ(fine.placement().origin_m, placement.origin_m);
        EXPECT_DOUBLE_EQ(fine.placement().cell_size_m, 8.0 / refine);
        const auto dense = fine.to_dense();
        std::uint64_t active = 0;
        for (int k = 0; k < fine.extent().z; ++k) {
            for (int j = 0; j < fine.extent().y; ++j) {
                for (int i = 0; i < fine.extent().x; ++i) {
                    const float value = dense[linear_index(fine.extent(), i, j, k)];
                    active += value > 0;
                    if ((i + 3 * j + 7 * k) % (refine > 3 ? 97 : 5) != 0) continue;
                    const double size = 8.0 / refine;
                    const Vec3 centre{50 + (i + 0.5) * size, 60 + (j + 0.5) * size, 70 + (k + 0.5) * size};
                    ASSERT_NEAR(value, density_at(grid, centre, radius), 1e-6) << i << " " << j << " " << k;
                }
            }
        }
        EXPECT_EQ(fine.active_voxels(), active);
    }
}

// Where all is cloud a periodic axis has no faces: 1 up to the last voxel of it, and less at the faces of
// open axes.
TEST(Metaballs, SaturatedIsOneUpToPeriodicFaces) {
    const DensityGrid grid = uniform_grid({8, 8, 8}, 1.0f);
    const Boundary open = Boundary::open, periodic = Boundary::periodic;
    for (double radius : {1.0, 1.5, 2.0, 8.0}) {
        const DensityGrid all = resample(grid, 2, radius, {periodic, periodic, periodic});
        for (const float value : all.to_dense()) ASSERT_EQ(value, 1.0f) << radius;
    }
    const DensityGrid layers = resample(grid, 2, 2.0, {periodic, periodic, open});
    const DensityGrid box = resample(grid, 2, 2.0);
    for (int j = 0; j < 16; ++j) {
        for (int i = 0; i < 16; ++i) {
            ASSERT_EQ(layers.value(i, j, 8), 1.0f);
            ASSERT_EQ(layers.value(i, j, 0), box.value(8, 8, 0));
            ASSERT_LT(layers.value(i, j, 15), 0.9f);
        }
    }
    EXPECT_LT(box.value(0, 8, 8), 0.9f);
}

// The twin of periodic axes: the grid written out again and again along them, open all around. Also where a
// metaball is wider than the grid, and where little of it is cloud.
TEST(Metaballs, PeriodicAxesAreCopiesOfTheGrid) {
    const Extent extent{13, 4, 9};
    constexpr int kCopies = 5;  // 2 x 4 voxels to either side: as far as the largest radius reaches
    for (int axes = 1; axes < 8; ++axes) {
        for (const auto& [refine, radius] : {std::pair{2, 2.0}, std::pair{3, 8.0}}) {
            DensityGrid grid = random_grid(extent, 31, {{50, 60, 70}, 8});
            if (refine == 2) {
                std::vector<float> few(extent.cells());
                few[linear_index(extent, 12, 0, 8)] = few[linear_index(extent, 3, 3, 0)] = 0.5f;
                grid = DensityGrid::from_dense(few, extent, {{50, 60, 70}, 8});
            }
            const int cx = axes & 1 ? kCopies : 1, cy = axes & 2 ? kCopies : 1, cz = axes & 4 ? kCopies : 1;
            const Extent many{extent.x * cx, extent.y * cy, extent.z * cz};
            std::vector<float> copies(many.cells());
            for (int k = 0; k < many.z; ++k) {
                for (int j = 0; j < many.y; ++j) {
                    for (int i = 0; i < many.x; ++i) {
                        copies[linear_index(many, i, j, k)] =
                            grid.value(i % extent.x, j % extent.y, k % extent.z);
                    }
                }
            }
            const auto boundary = [](int copied) { return copied > 1 ? Boundary::periodic : Boundary::open; };
            const DensityGrid fine =
                resample(grid, refine, radius, {boundary(cx), boundary(cy), boundary(cz)});
            const DensityGrid twin = resample(DensityGrid::from_dense(copies, many, {}), refine, radius);
            const Extent e = fine.extent();
            const int x0 = cx / 2 * e.x, y0 = cy / 2 * e.y, z0 = cz / 2 * e.z;
            for (int k = 0; k < e.z; ++k) {
                for (int j = 0; j < e.y; ++j) {
                    for (int i = 0; i < e.x; ++i) {
                        ASSERT_EQ(fine.value(i, j, k), twin.value(i + x0, j + y0, k + z0))
                            << axes << " " << refine << ": " << i << " " << j << " " << k;
                    }
                }
            }
        }
    }
}

TEST(Metaballs, OnePerVoxelInDocumentedOrder) {
    const Extent extent{19, 10, 9};
    const Placement placement{{1000, -500, 250}, 20};
    const DensityGrid grid = random_grid(extent, 31, placement);
    const auto balls = metaballs(grid, 2.5);
    std::vector<Metaball> expected;
    for (int bz = 0; bz < 9; bz += 8) {
        for (int by = 0; by < 10; by += 8) {
            for (int bx = 0; bx < 19; bx += 8) {
                for (int n = 0; n < 512; ++n) {
                    const int i = bx + n % 8, j = by + n / 8 % 8, k = bz + n / 64;
                    const float q = grid.value(i, j, k);
                    if (i >= 19 || j >= 10 || k >= 9 || q == 0) continue;
                    expected.push_back({float(1000 + (i + 0.5) * 20), float(-500 + (j + 0.5) * 20),
                                        float(250 + (k + 0.5) * 20), 50.0f, q});
                }
            }
        }
    }
    EXPECT_EQ(balls, expected);
    EXPECT_EQ(balls.size(), grid.active_voxels());
    // Tiles (blocks of one value) and leaves give the same list.
    const auto full = metaballs(uniform_grid({16, 16, 16}, 0.5f), 2);
    ASSERT_EQ(full.size(), 4096u);
    EXPECT_EQ(full[1].x - full[0].x, 50.0f);
    EXPECT_TRUE(metaballs(DensityGrid(), 2).empty());
}

TEST(Metaballs, RejectRadiiOutOfRange) {
    const DensityGrid grid = uniform_grid({4, 4, 4}, 1.0f);
    for (double radius : {0.99, 8.01, std::nan("")}) {
        EXPECT_THROW(metaballs(grid, radius), Error) << radius;
        EXPECT_THROW(resample(grid, 2, radius), Error) << radius;
    }
    EXPECT_THROW(resample(grid, 0, 2), Error);
    EXPECT_THROW(resample(grid, 9, 2), Error);
}

}  // namespace
}  // namespace nephos
