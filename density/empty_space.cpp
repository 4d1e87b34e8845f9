// SPDX-License-Identifier: Apache-2.0
#include "density/empty_space.h"

#include <algorithm>
#include <bit>

#include <tbb/parallel_for.h>

#include "density/detail_kernels.h"
#include "density/detail_scalar.h"

namespace nephos {
namespace {

namespace text = detail_text;

constexpr int kEdge = CoverageField::kBrickNodes, kCells = CoverageField::kBrickCells;
constexpr std::size_t kBrickBytes = CoverageField::kBrickBytes;

}  // namespace

namespace {

// Bits of the rows of cells at one z: 16 for each of four y. Those of a brick fill the lowest four of each.
using Rows = std::uint64_t;
using BrickRows = std::array<Rows, kCells>;  // by z
static_assert(kCells == 4);
constexpr int kRowBits = 16;

// A cell may hold cloud when one of its nodes does: then t is at least `least`.
BrickRows occupied_cells(const std::uint8_t* nodes, unsigned least) {
    std::array<std::uint16_t, kEdge * kEdge> rows;  // a bit for each node
    for (std::size_t row = 0; row < rows.size(); ++row) {
        unsigned bits = 0;
        for (std::size_t x = 0; x < kEdge; ++x) bits |= unsigned(nodes[2 * (row * kEdge + x)] >= least) << x;
        rows[row] = std::uint16_t(bits);
    }
    BrickRows occupied{};
    for (std::size_t z = 0; z < kCells; ++z) {
        for (std::size_t y = 0; y < kCells; ++y) {
            unsigned any = 0;
            for (std::size_t m = 0; m < 9; ++m) any |= rows[(2 * z + m / 3) * kEdge + 2 * y + m % 3];
            any |= any >> 1 | any >> 2;  // the three nodes of a cell
            const unsigned cells = (any & 1) | (any >> 1 & 2) | (any >> 2 & 4) | (any >> 3 & 8);
            occupied[z] |= Rows(cells) << (kRowBits * y);
        }
    }
    return occupied;
}

// Rows of a brick, and of those beside it in x, at 12 y and 12 z: those of a word are next to each other.
struct RowsAround {
    std::array<std::array<std::uint16_t, 3 * kCells>, 3 * kCells> of{};  // z, y

    Rows at(int z, int y) const {
        Rows rows = 0;
        for (int n = 0; n < kCells; ++n)
            rows |= Rows(of[std::size_t(z)][std::size_t(y + n)]) << (kRowBits * n);
        return rows;
    }
    void set(int z, int y, Rows rows) {
        for (int n = 0; n < kCells; ++n)
            of[std::size_t(z)][std::size_t(y + n)] = std::uint16_t(rows >> (kRowBits * n));
    }
};

// Chessboard distances of a brick's cells: the least half edge of a cube around a cell that meets one with cloud. The
// cubes grow by one on all axes at a time; bits that leave a row of 16 do not get as far as the brick's own.
void set_clearance(const RowsAround& near, std::uint8_t* out) {
    std::array<Rows, 3 * kCells> along_y;  // of the brick's own y: what is up to `distance` away
    for (int z = 0; z < 3 * kCells; ++z) along_y[std::size_t(z)] = near.at(z, kCells);
    std::fill_n(out, kCells * kCells * kCells, std::uint8_t(kCells));
    std::array<Rows, kCells> left;  // bits of cells without a distance
    left.fill(0x000F000F000F000Full);
    for (int distance = 0; distance < kCells; ++distance) {
        for (int z = 0; distance > 0 && z < 3 * kCells; ++z)
            along_y[std::size_t(z)] |= near.at(z, kCells - distance) | near.at(z, kCells + distance);
        for (int z = 0; z < kCells; ++z) {
            Rows any = 0;
            for (int k = kCells + z - distance; k <= kCells + z + distance; ++k) any |= along_y[std::size_t(k)];
            for (int n = 0; n < distance; ++n) any |= any << 1 | any >> 1;
            Rows found = any >> kCells & left[std::size_t(z)];
            left[std::size_t(z)] &= ~found;
            for (; found != 0; found &= found - 1) {
                const int bit = std::countr_zero(found);
                out[(z * kCells + bit / kRowBits) * kCells + bit % kRowBits] = std::uint8_t(distance);
            }
        }
    }
}

}  // namespace

std::vector<std::uint8_t> clearance_of_cells(std::span<const std::uint8_t> nodes, std::span<const std::int32_t> places,
                                             std::span<const std::int32_t> table, const std::array<int, 3>& bricks,
                                             float least_coverage, float most) {
    unsigned least = 0;  // t of cloud; coverage rises with it
    const auto coverage = [most](float t) { return text::coverage_of(most * t / (1 - t + most * t)); };
    while (least < 256 && !(coverage(float(least) / 255) > least_coverage)) ++least;
    std::vector<BrickRows> occupied(places.size());
    tbb::parallel_for(std::size_t{0}, places.size(),
                      [&](std::size_t n) { occupied[n] = occupied_cells(&nodes[n * kBrickBytes], least); });
    constexpr BrickRows kNone{}, kAll{0x000F000F000F000Full, 0x000F000F000F000Full, 0x000F000F000F000Full,
                                      0x000F000F000F000Full};
    std::vector<std::uint8_t> clearance(places.size() * kCells * kCells * kCells + 3, 0);  // kernels read words
    tbb::parallel_for(std::size_t{0}, places.size(), [&](std::size_t n) {
        if (occupied[n] == kAll) return;
        const auto at = brick_at(places[n], bricks);
        const auto rows_of = [&](int x, int y, int z) -> const BrickRows& {
            if (x < 0 || y < 0 || z < 0 || x >= bricks[0] || y >= bricks[1] || z >= bricks[2]) return kNone;
            const std::int32_t number =
                table[(std::size_t(z) * std::size_t(bricks[1]) + std::size_t(y)) * std::size_t(bricks[0]) +
                      std::size_t(x)];
            return number < 0 ? kNone : occupied[std::size_t(number)];
        };
        RowsAround near;
        for (int z = 0; z < 3; ++z) {
            for (int y = 0; y < 3; ++y) {
                const int by = at[1] + y - 1, bz = at[2] + z - 1;
                const BrickRows &low = rows_of(at[0] - 1, by, bz), &own = rows_of(at[0], by, bz),
                                &high = rows_of(at[0] + 1, by, bz);
                for (std::size_t k = 0; k < kCells; ++k)
                    near.set(kCells * z + int(k), kCells * y,
                             low[k] | own[k] << kCells | high[k] << (2 * kCells));
            }
        }
        set_clearance(near, &clearance[n * kCells * kCells * kCells]);
    });
    return clearance;
}

// Chessboard distances by two scans: each takes the least of the 13 neighbours that it has passed (A. Rosenfeld and
// J. L. Pfaltz 1968, "Distance functions on digital pictures", with weights of 1).
void set_distances(std::span<std::int32_t> table, const std::array<int, 3>& bricks) {
    constexpr int kFarthest = 127;
    std::vector<std::uint8_t> distance(table.size());
    for (std::size_t n = 0; n < table.size(); ++n) distance[n] = table[n] >= 0 ? 0 : kFarthest;
    const auto row_of = [&](int y, int z) {
        return &distance[(std::size_t(z) * std::size_t(bricks[1]) + std::size_t(y)) * std::size_t(bricks[0])];
    };
    const auto scan = [&](int direction) {
        for (int k = 0; k < bricks[2]; ++k) {
            for (int j = 0; j < bricks[1]; ++j) {
                const int z = direction > 0 ? k : bricks[2] - 1 - k, y = direction > 0 ? j : bricks[1] - 1 - j;
                std::uint8_t* const row = row_of(y, z);
                const int neighbours[4][2] = {{y - direction, z},
                                              {y - 1, z - direction},
                                              {y, z - direction},
                                              {y + 1, z - direction}};
                for (const auto [ny, nz] : neighbours) {
                    if (ny < 0 || ny >= bricks[1] || nz < 0 || nz >= bricks[2]) continue;
                    const std::uint8_t* const other = row_of(ny, nz);
                    for (int x = 0; x < bricks[0]; ++x) {
                        const int least = std::min({other[std::max(x - 1, 0)], other[x],
                                                    other[std::min(x + 1, bricks[0] - 1)]});
                        row[x] = std::uint8_t(std::min<int>(row[x], least + 1));
                    }
                }
                for (int i = 1; i < bricks[0]; ++i) {
                    const int x = direction > 0 ? i : bricks[0] - 1 - i;
                    row[x] = std::uint8_t(std::min<int>(row[x], row[x - direction] + 1));
                }
            }
        }
    };
    scan(1);
    scan(-1);
    for (std::size_t n = 0; n < table.size(); ++n)
        if (table[n] < 0) table[n] = -std::int32_t(distance[n]);
}

}  // namespace nephos
