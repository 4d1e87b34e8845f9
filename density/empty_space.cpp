// SPDX-License-Identifier: Apache-2.0
#include "density/empty_space.h"

#include <algorithm>

#include <tbb/parallel_for.h>

#include "density/detail_kernels.h"
#include "density/detail_scalar.h"

namespace nephos {
namespace {

namespace text = detail_text;

constexpr int kEdge = CoverageField::kBrickNodes, kCells = CoverageField::kBrickCells;
constexpr std::size_t kBrickBytes = CoverageField::kBrickBytes;

}  // namespace

// Cells as bits: a row of three bricks' cells along x in a word.
std::vector<std::uint8_t> clearance_of_cells(std::span<const std::uint8_t> nodes, std::span<const std::int32_t> places,
                                             std::span<const std::int32_t> table, const std::array<int, 3>& bricks,
                                             float least_coverage) {
    std::array<bool, 256> cloud{};
    for (std::size_t t = 0; t < cloud.size(); ++t) cloud[t] = text::coverage_of(float(t) / 255) > least_coverage;
    // Four bits for each row of cells of each brick: a cell may hold cloud when one of its nodes does.
    std::vector<std::array<std::uint8_t, kCells * kCells>> occupied(places.size());
    tbb::parallel_for(std::size_t{0}, places.size(), [&](std::size_t n) {
        const std::uint8_t* const of_brick = &nodes[n * kBrickBytes];
        std::array<std::uint16_t, kEdge * kEdge> rows{};  // a bit for each node
        for (std::size_t row = 0; row < rows.size(); ++row)
            for (std::size_t x = 0; x < kEdge; ++x)
                rows[row] = std::uint16_t(rows[row] | (cloud[of_brick[2 * (row * kEdge + x)]] ? 1u << x : 0u));
        for (std::size_t cell = 0; cell < kCells * kCells; ++cell) {
            const std::size_t y = cell % kCells, z = cell / kCells;
            unsigned any = 0;
            for (std::size_t m = 0; m < 9; ++m) any |= rows[(2 * z + m / 3) * kEdge + 2 * y + m % 3];
            occupied[n][cell] = 0;
            for (unsigned x = 0; x < kCells; ++x)
                if ((any >> 2 * x & 7u) != 0) occupied[n][cell] = std::uint8_t(occupied[n][cell] | 1u << x);
        }
    });
    std::vector<std::uint8_t> clearance(places.size() * kCells * kCells * kCells + 3, 0);  // kernels read words
    constexpr int kSide = 3 * kCells;
    using Rows = std::array<std::uint16_t, kSide * kSide>;
    tbb::parallel_for(std::size_t{0}, places.size(), [&](std::size_t n) {
        const auto at = brick_at(places[n], bricks);
        std::uint8_t* const out = &clearance[n * kCells * kCells * kCells];
        if (std::ranges::all_of(occupied[n], [](std::uint8_t row) { return row == (1u << kCells) - 1; })) return;
        Rows near{};
        for (int m = 0; m < 27; ++m) {
            const int o[3] = {m % 3, m / 3 % 3, m / 9};
            int b[3];
            bool inside = true;
            for (std::size_t axis = 0; axis < 3; ++axis) {
                b[axis] = at[axis] + o[axis] - 1;
                inside = inside && b[axis] >= 0 && b[axis] < bricks[axis];
            }
            if (!inside) continue;
            const std::int32_t number =
                table[(std::size_t(b[2]) * std::size_t(bricks[1]) + std::size_t(b[1])) * std::size_t(bricks[0]) +
                       std::size_t(b[0])];
            if (number < 0) continue;
            for (int cell = 0; cell < kCells * kCells; ++cell) {
                std::uint16_t& to =
                    near[std::size_t((o[2] * kCells + cell / kCells) * kSide + o[1] * kCells + cell % kCells)];
                to = std::uint16_t(to | occupied[std::size_t(number)][std::size_t(cell)] << kCells * o[0]);
            }
        }
        std::fill_n(out, kCells * kCells * kCells, std::uint8_t(kCells));
        for (int distance = 0; distance < kCells; ++distance) {
            for (int cell = 0; cell < kCells * kCells * kCells; ++cell) {
                const unsigned row = near[std::size_t((kCells + cell / 16) * kSide + kCells + cell / 4 % 4)];
                if (out[cell] == kCells && (row >> (kCells + cell % 4) & 1u) != 0) out[cell] = std::uint8_t(distance);
            }
            Rows wider = near;
            for (std::uint16_t& row : wider) row = std::uint16_t(row | row << 1 | row >> 1);
            near = wider;
            for (std::size_t i = 0; i < near.size(); ++i) {
                if (i % kSide > 0) near[i] |= wider[i - 1];
                if (i % kSide + 1 < kSide) near[i] |= wider[i + 1];
            }
            wider = near;
            for (std::size_t i = 0; i < near.size(); ++i) {
                if (i >= kSide) near[i] |= wider[i - kSide];
                if (i + kSide < near.size()) near[i] |= wider[i + kSide];
            }
        }
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
