// SPDX-License-Identifier: Apache-2.0
#include "density/empty_space.h"

#include <algorithm>
#include <bit>

#include <tbb/parallel_for.h>

#include "density/detail_kernels.h"

namespace nephos {
namespace {

constexpr int kEdge = CoverageField::kBrickNodes, kCells = CoverageField::kBrickCells;
constexpr std::size_t kBrickBytes = CoverageField::kBrickBytes, kCellsOfBrick = kCells * kCells * kCells;

// The largest t of the 27 nodes of each cell of a brick, x fastest.
void find_most(const std::uint8_t* nodes, std::uint8_t* most) {
    constexpr std::size_t kRow = 2 * kEdge;  // bytes: t and growth by turns
    std::uint8_t rows[kEdge][kCells][kRow];  // the largest of three rows of nodes; z, cells' y
    for (std::size_t z = 0; z < kEdge; ++z) {
        for (std::size_t y = 0; y < kCells; ++y) {
            const std::uint8_t* const first = nodes + (z * kEdge + 2 * y) * kRow;
            for (std::size_t x = 0; x < kRow; ++x)
                rows[z][y][x] = std::max(std::max(first[x], first[kRow + x]), first[2 * kRow + x]);
        }
    }
    for (std::size_t z = 0; z < kCells; ++z) {
        for (std::size_t y = 0; y < kCells; ++y) {
            std::uint8_t row[kRow];
            for (std::size_t x = 0; x < kRow; ++x)
                row[x] = std::max(std::max(rows[2 * z][y][x], rows[2 * z + 1][y][x]), rows[2 * z + 2][y][x]);
            for (std::size_t x = 0; x < kCells; ++x)
                *most++ = std::max(std::max(row[4 * x], row[4 * x + 2]), row[4 * x + 4]);
        }
    }
}

// Bits of the rows of cells at one z: 16 for each of four y. Those of a brick fill the lowest four of each.
using Rows = std::uint64_t;
using BrickRows = std::array<Rows, kCells>;  // by z
static_assert(kCells == 4);
constexpr int kRowBits = 16;

// CoverageField::cells() of each largest t of nodes, where a cell is occupied; else a byte more than CoverageField::kOccupied.
std::array<std::uint8_t, 256> bytes_of_most(float cloud_odds, float most) {
    std::array<std::uint8_t, 256> bytes;
    bytes.fill(CoverageField::kOccupied + 1);
    for (int t = 1; t < 256; ++t) {
        const float factor = cloud_odds * float(255 - t) / float(t);
        if (factor < most) bytes[std::size_t(t)] = std::uint8_t(factor / CoverageField::kFactorStep);
    }
    return bytes;
}

BrickRows occupied_cells(const std::uint8_t* cells) {
    BrickRows occupied{};
    for (std::size_t n = 0; n < kCellsOfBrick; ++n) {
        const bool may = cells[n] <= CoverageField::kOccupied;
        occupied[n / 16] |= Rows(may) << (kRowBits * (n / 4 % 4) + n % 4);
    }
    return occupied;
}

// Rows of a brick, in bits 4..7 of each 16, and of the 26 bricks around it: of 12 z, each three words of four y.
using RowsAround = std::array<std::array<Rows, 3>, 3 * kCells>;

// Rows of four y, `up` of them beyond a brick's own, -4..4.
Rows rows_from(const std::array<Rows, 3>& words, int up) {
    if (up == 0) return words[1];
    if (up == kCells || up == -kCells) return words[up > 0 ? 2 : 0];
    const int bits = kRowBits * (up > 0 ? up : -up);
    return up > 0 ? words[1] >> bits | words[2] << (64 - bits) : words[1] << bits | words[0] >> (64 - bits);
}

// Four bits, each in a byte.
constexpr std::array<std::uint32_t, 16> kBytes = [] {
    std::array<std::uint32_t, 16> bytes{};
    for (std::uint32_t n = 0; n < 16; ++n) bytes[n] = (n & 1) | (n & 2) << 7 | (n & 4) << 14 | (n & 8) << 21;
    return bytes;
}();

// Adds the edges of the empty cubes that begin at a brick's cells, less by one, for each octant. Cubes grow along x, y and
// z, one after the other, by one cell at a time. A bit that leaves its 16 does not get as far as the brick's own.
void add_edges(const RowsAround& near, std::uint8_t* cells) {
    constexpr int kLongest = kCells + 1;  // of a cube that begins at any cell, what is known around the brick
    for (int along_x = 0; along_x < 2; ++along_x) {
        RowsAround met = near;  // what the cube's edge along x meets
        std::array<BrickRows, 4> longer[kLongest - 1];  // by octants: where a cube of this edge, from 2 on, meets nothing
        for (int edge = 2; edge <= kLongest; ++edge) {
            for (std::size_t z = 0; z < met.size(); ++z)
                for (std::size_t y = 0; y < 3; ++y)
                    met[z][y] |= along_x != 0 ? near[z][y] >> (edge - 1) : near[z][y] << (edge - 1);
            for (int along_y = 0; along_y < 2; ++along_y) {
                std::array<Rows, 3 * kCells> plane;
                for (std::size_t z = 0; z < met.size(); ++z) {
                    plane[z] = met[z][1];
                    for (int n = 1; n < edge; ++n) plane[z] |= rows_from(met[z], along_y != 0 ? n : -n);
                }
                for (int along_z = 0; along_z < 2; ++along_z) {
                    BrickRows& out = longer[edge - 2][std::size_t(along_y + 2 * along_z)];
                    for (std::size_t z = 0; z < kCells; ++z) {
                        const std::size_t from = z + kCells - (along_z != 0 ? 0 : std::size_t(edge - 1));
                        out[z] = 0;
                        for (std::size_t n = 0; n < std::size_t(edge); ++n) out[z] |= plane[from + n];
                        out[z] = ~out[z] >> kCells;
                    }
                }
            }
        }
        for (std::size_t of = 0; of < 4; ++of) {
            std::uint8_t* const to = cells + kCellsOfBrick * (std::size_t(along_x) + 2 * of);
            for (std::size_t row = 0; row < kCellsOfBrick / 4; ++row) {
                std::uint32_t four = 0;
                for (const auto& rows : longer) four += kBytes[rows[of][row / 4] >> (kRowBits * (row % 4)) & 0xF];
                for (std::size_t n = 0; n < 4; ++n)
                    to[4 * row + n] = std::uint8_t(to[4 * row + n] + (four >> (8 * n) & 255));
            }
        }
    }
}

}  // namespace

std::vector<std::uint8_t> cells_of(std::span<const std::uint8_t> nodes, std::span<const std::int32_t> places,
                                   std::span<const std::int32_t> table, const std::array<int, 3>& bricks,
                                   float cloud_odds, float most) {
    std::vector<BrickRows> occupied(places.size());
    std::vector<std::uint8_t> cells(places.size() * CoverageField::kCellBytes + 3, 0);  // kernels read words
    const auto bytes = bytes_of_most(cloud_odds, most);
    tbb::parallel_for(std::size_t{0}, places.size(), [&](std::size_t n) {
        std::uint8_t* const of_brick = &cells[n * CoverageField::kCellBytes];
        find_most(&nodes[n * kBrickBytes], of_brick);
        for (std::size_t cell = 0; cell < kCellsOfBrick; ++cell) of_brick[cell] = bytes[of_brick[cell]];
        occupied[n] = occupied_cells(of_brick);
        for (std::size_t octant = 1; octant < 8; ++octant)
            std::copy_n(of_brick, kCellsOfBrick, of_brick + octant * kCellsOfBrick);
    });
    constexpr BrickRows kNone{}, kAll{0x000F000F000F000Full, 0x000F000F000F000Full, 0x000F000F000F000Full,
                                      0x000F000F000F000Full};
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
        for (std::size_t z = 0; z < 3; ++z) {
            for (std::size_t y = 0; y < 3; ++y) {
                const int by = at[1] + int(y) - 1, bz = at[2] + int(z) - 1;
                const BrickRows &low = rows_of(at[0] - 1, by, bz), &own = rows_of(at[0], by, bz),
                                &high = rows_of(at[0] + 1, by, bz);
                for (std::size_t k = 0; k < kCells; ++k)
                    near[kCells * z + k][y] = low[k] | own[k] << kCells | high[k] << (2 * kCells);
            }
        }
        add_edges(near, &cells[n * CoverageField::kCellBytes]);
    });
    return cells;
}

// The largest empty cube that begins at a brick is one longer than the least of those at its seven neighbours in the
// octant, which a scan against the octant's direction has passed.
void set_distances(std::span<std::int32_t> table, const std::array<int, 3>& bricks) {
    constexpr std::uint8_t kFarthest = 8;
    const auto nx = std::size_t(bricks[0]), ny = std::size_t(bricks[1]), nz = std::size_t(bricks[2]);
    std::array<std::vector<std::uint8_t>, 8> edges;
    tbb::parallel_for(std::size_t{0}, edges.size(), [&](std::size_t octant) {
        std::vector<std::uint8_t>& edge = edges[octant];
        edge.resize(table.size());
        const std::vector<std::uint8_t> beyond(nx, kFarthest);  // outside there is no cloud
        std::vector<std::uint8_t> least(nx);
        for (std::size_t k = 0; k < nz; ++k) {
            for (std::size_t j = 0; j < ny; ++j) {
                const bool up_x = (octant & 1) != 0, up_y = (octant & 2) != 0, up_z = (octant & 4) != 0;
                const std::size_t z = up_z ? nz - 1 - k : k, y = up_y ? ny - 1 - j : j;
                const auto row_of = [&](std::size_t back_y, std::size_t back_z) -> const std::uint8_t* {
                    if (back_y > j || back_z > k) return beyond.data();
                    return &edge[((up_z ? z + back_z : z - back_z) * ny + (up_y ? y + back_y : y - back_y)) * nx];
                };
                const std::uint8_t *const a = row_of(1, 0), *const b = row_of(0, 1), *const c = row_of(1, 1);
                for (std::size_t x = 0; x < nx; ++x) least[x] = std::min({a[x], b[x], c[x]});
                const std::size_t first = (z * ny + y) * nx;
                std::uint8_t before = kFarthest, least_before = kFarthest;
                for (std::size_t i = 0; i < nx; ++i) {
                    const std::size_t x = up_x ? nx - 1 - i : i;
                    const int shortest = std::min({before, least_before, least[x]});
                    before = table[first + x] >= 0 ? std::uint8_t{0} : std::uint8_t(std::min<int>(shortest + 1, kFarthest));
                    least_before = least[x];
                    edge[first + x] = before;
                }
            }
        }
    });
    for (std::size_t n = 0; n < table.size(); ++n) {
        if (table[n] >= 0) continue;
        std::uint32_t word = 0x80000000u;
        for (std::size_t octant = 0; octant < edges.size(); ++octant)
            word |= std::uint32_t(edges[octant][n] - 1) << (3 * octant);
        table[n] = std::int32_t(word);
    }
}

}  // namespace nephos
