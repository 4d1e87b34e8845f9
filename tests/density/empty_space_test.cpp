// SPDX-License-Identifier: Apache-2.0

// Empty space in fields of coverage: what rays leave in one step.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "density/detail.h"
#include "density/metaballs.h"

namespace nephos {
namespace {

using Place = std::array<int, 3>;
constexpr int kCells = CoverageField::kBrickCells, kLongest = kCells + 1, kFarthest = 8;

// Small clouds far apart, dense and thin, in a lattice that repeats.
CoverageField scattered(bool periodic) {
    const Extent extent{64, 48, 20};
    std::vector<float> values(extent.cells(), 0.0f);
    for (int cloud = 0; cloud < 14; ++cloud) {
        const Vec3 centre(std::fmod(cloud * 0.754877666, 1) * extent.x, std::fmod(cloud * 0.569840291, 1) * extent.y,
                          std::fmod(cloud * 0.362718, 1) * extent.z);
        const double radius = 1.5 + cloud % 4, most = cloud % 3 == 0 ? 0.02 : 0.5;
        for (int k = 0; k < extent.z; ++k)
            for (int j = 0; j < extent.y; ++j)
                for (int i = 0; i < extent.x; ++i) {
                    const double share = glm::length(Vec3(i, j, k) + Vec3(0.5) - centre) / radius;
                    float& value = values[linear_index(extent, i, j, k)];
                    value = std::max(value, float(most * (1 - share)));
                }
    }
    DetailSetting setting;
    setting.extinction_per_m = 0.15;
    setting.metaball_radius_cells = 1.5;
    if (periodic) setting.boundaries.x = setting.boundaries.y = Boundary::periodic;
    return CoverageField(DensityGrid::from_dense(values, extent, {Vec3(-1000, 300, 900), 40}), setting);
}

bool inside(const CoverageField& field, const Place& brick) {
    for (std::size_t axis = 0; axis < 3; ++axis)
        if (brick[axis] < 0 || brick[axis] >= field.bricks()[axis]) return false;
    return true;
}

// -1 where there is no cloud.
std::int32_t number_at(const CoverageField& field, const Place& brick) {
    const auto& bricks = field.bricks();
    return inside(field, brick) ? field.table()[std::size_t((brick[2] * bricks[1] + brick[1]) * bricks[0] + brick[0])]
                                : -1;
}

// By how much D has to be larger for a cell to hold cloud; cells counted from the field's corner.
float least_factor(const CoverageField& field, const Place& cell) {
    Place brick, in;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        brick[axis] = cell[axis] >= 0 ? cell[axis] / kCells : -1;
        in[axis] = cell[axis] - brick[axis] * kCells;
    }
    const std::int32_t number = number_at(field, brick);
    int most = 0;
    for (int n = 0; n < 27 && number >= 0; ++n) {
        const int x = 2 * in[0] + n % 3, y = 2 * in[1] + n / 3 % 3, z = 2 * in[2] + n / 9;
        const std::size_t node = std::size_t((z * CoverageField::kBrickNodes + y) * CoverageField::kBrickNodes + x);
        most = std::max<int>(most, field.nodes()[std::size_t(number) * CoverageField::kBrickBytes + 2 * node]);
    }
    return most == 0 ? 1000.0f : field.erosion().cloud_odds() * float(255 - most) / float(most);
}

// The edge of the largest cube that begins at a place and meets nothing, at most `longest`; 0: the place itself does.
template <class Meets>
int edge_of_cube(const Place& from, int octant, int longest, const Meets& meets) {
    for (int edge = 1; edge <= longest; ++edge)
        for (int n = 0; n < edge * edge * edge; ++n) {
            const Place step{n % edge, n / edge % edge, n / edge / edge};
            Place at;
            for (std::size_t axis = 0; axis < 3; ++axis)
                at[axis] = from[axis] + ((octant >> axis & 1) != 0 ? step[axis] : -step[axis]);
            if (meets(at)) return edge - 1;
        }
    return longest;
}

class EmptySpace : public testing::TestWithParam<bool> {};

TEST_P(EmptySpace, CubesOfCellsAreTheLargestThereAre) {
    const CoverageField field = scattered(GetParam());
    const float most = GetParam() ? kMostInImages : 1;
    const auto occupied = [&](const Place& cell) { return least_factor(field, cell) < most; };
    std::size_t occupied_cells = 0, long_cubes = 0;
    ASSERT_EQ(field.cells().size(), field.places().size() * CoverageField::kCellBytes + 3);
    for (std::size_t n = 0; n < field.places().size(); n += 11) {
        const int index = field.places()[n], nx = field.bricks()[0], ny = field.bricks()[1];
        for (int c = 0; c < kCells * kCells * kCells; ++c) {
            const Place cell{index % nx * kCells + c % kCells, index / nx % ny * kCells + c / kCells % kCells,
                             index / nx / ny * kCells + c / kCells / kCells};
            for (int octant = 0; octant < 8; ++octant) {
                const int byte = field.cells()[n * CoverageField::kCellBytes + std::size_t(64 * octant + c)];
                const int edge = edge_of_cube(cell, octant, kLongest, occupied);
                ASSERT_EQ(std::max(byte - CoverageField::kOccupied, 0), edge) << n << " " << c << " " << octant;
                long_cubes += edge == kLongest;
                if (edge > 0) continue;
                const float factor = least_factor(field, cell);
                EXPECT_LE(float(byte) * CoverageField::kFactorStep, factor);
                EXPECT_GT(float(byte + 1) * CoverageField::kFactorStep, factor * 0.9999f);
                ++occupied_cells;
            }
        }
    }
    EXPECT_GT(occupied_cells, 500u);
    EXPECT_GT(long_cubes, 100u);
}

TEST_P(EmptySpace, CubesOfBricksAreTheLargestThereAre) {
    const CoverageField field = scattered(GetParam());
    const auto holds = [&](const Place& brick) { return number_at(field, brick) >= 0; };
    std::size_t empty = 0;
    for (int z = 0; z < field.bricks()[2]; ++z)
        for (int y = 0; y < field.bricks()[1]; ++y)
            for (int x = 0; x < field.bricks()[0]; ++x) {
                const std::int32_t word = number_at(field, {x, y, z});
                if (word >= 0) continue;
                ++empty;
                for (int octant = 0; octant < 8; ++octant)
                    ASSERT_EQ((word >> (3 * octant) & 7) + 1, edge_of_cube({x, y, z}, octant, kFarthest, holds));
            }
    EXPECT_GT(empty, 100u);
}

// No place in a cell that is clear at D itself has cloud, and neither has any brick without a number.
TEST_P(EmptySpace, IsEmpty) {
    const CoverageField field = scattered(GetParam());
    const auto& bricks = field.bricks();
    std::size_t empty = 0, cloud = 0;
    for (int n = 0; n < 60000; ++n) {
        const double edge = field.node_m() * 8;
        const Vec3 share(std::fmod(n * 0.754877666, 1), std::fmod(n * 0.569840291, 1), std::fmod(n * 0.362718, 1));
        const Vec3 from = share * edge * Vec3(bricks[0], bricks[1], bricks[2]);
        const Place brick{int(from.x / edge), int(from.y / edge), int(from.z / edge)};
        const std::int32_t number = number_at(field, brick);
        bool clear = number < 0;
        if (number >= 0) {
            const Vec3 in = (from - edge * Vec3(brick[0], brick[1], brick[2])) / (2 * field.node_m());
            const std::size_t cell = std::size_t((int(in.z) * kCells + int(in.y)) * kCells + int(in.x));
            clear = float(field.cells()[std::size_t(number) * CoverageField::kCellBytes + cell]) *
                        CoverageField::kFactorStep >= 1;
        }
        const float density = detailed_density_at(field, field.corner_m() + from, 2);
        if (density > 0) ++cloud;
        if (!clear) continue;
        ++empty;
        EXPECT_EQ(density, 0.0f);
    }
    EXPECT_GT(empty, 10000u);
    EXPECT_GT(cloud, 100u);
}

INSTANTIATE_TEST_SUITE_P(Lattices, EmptySpace, testing::Bool(),
                         [](const auto& of) { return of.param ? "Periodic" : "Open"; });

}  // namespace
}  // namespace nephos
