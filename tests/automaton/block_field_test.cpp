// SPDX-License-Identifier: Apache-2.0

// Bounds of an ellipsoid on the blocks of a row, which choose how a block is drawn and so belong to the random stream:
// vectors against the formulas one block at a time, to the bit.

#include "automaton/block_field.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "tests/automaton/each_target.h"

namespace nephos {
namespace {

struct OneBlock {
    float base_a, base_b;
    bool touched, covered;
    std::array<float, 3> bound;
};

OneBlock naive(const FieldEllipsoid& e, const BlockEllipsoid& seen, double dy, int bx) {
    const double dx = bx * kBlockEdge + 0.5 - e.centre_x;
    OneBlock one{float(e.xx * dx + e.xy * dy), float(e.yx * dx + e.yy * dy), false, false, {}};
    const float a = one.base_a + 3.5f * (seen.xx + seen.xy);
    const float b = one.base_b + 3.5f * (seen.yx + seen.yy);
    const float c = seen.base_c + 3.5f * seen.zz;
    const float square = a * a + b * b + c * c;
    const float outside = (1 + e.block_reach) * (1 + e.block_reach);
    const float distance = std::sqrt(square);
    const float nearest = std::max(0.0f, distance - e.block_reach), farthest = distance + e.block_reach;
    one.touched = !(square > outside * 1.0001f) && nearest < 1;
    one.covered = farthest < 1;
    const float inner = (1 - nearest * nearest) * (1 - nearest * nearest);
    const float outer = farthest < 1 ? (1 - farthest * farthest) * (1 - farthest * farthest) : 0;
    for (std::size_t d = 0; d < 3; ++d) {
        const float highest = std::max(e.rim[d] + e.span[d] * inner, e.rim[d] + e.span[d] * outer) * 1.00001f;
        one.bound[d] = std::clamp(highest, 0.0f, 1.0f);
    }
    return one;
}

TEST(BlockField, RowsOfBlocksAreSeenAsOneByOne) {
    std::mt19937 random(7);
    const auto real = [&](double low, double high) {
        return std::uniform_real_distribution<>(low, high)(random);
    };
    int touched = 0, covered = 0;
    for (int round = 0; round < 400; ++round) {
        const double long_axis = real(1, 90), angle = real(0, 7);
        FieldEllipsoid e{.centre_x = real(-40, 200), .centre_y = real(-20, 60), .centre_z = real(-5, 30)};
        e.xx = std::cos(angle) / long_axis, e.xy = std::sin(angle) / long_axis;
        e.yx = -std::sin(angle) / real(1, 60), e.yy = std::cos(angle) / real(1, 60);
        e.zz = 1 / real(1, 40);
        e.block_reach = float(3.5 * (std::abs(e.xx) + std::abs(e.xy) + e.zz));
        for (std::size_t d = 0; d < 3; ++d)
            e.rim[d] = float(real(0, 0.4)), e.span[d] = float(real(-0.4, 0.8));
        const double dy = real(-30, 30);
        const BlockEllipsoid seen{.base_c = float(e.zz * real(-20, 20)),
                                  .xx = float(e.xx),
                                  .xy = float(e.xy),
                                  .yx = float(e.yx),
                                  .yy = float(e.yy),
                                  .zz = float(e.zz),
                                  .source = &e};
        const int bx = int(real(0, 20));
        test::with_each_target([&] {
            EllipsoidInRow row;
            find_in_row(e, seen, dy, bx, row);
            for (std::size_t n = 0; n < EllipsoidInRow::kBlocks; ++n) {
                const OneBlock one = naive(e, seen, dy, bx + int(n));
                ASSERT_EQ(row.touched >> n & 1, unsigned{one.touched})
                    << "round " << round << ", block " << n;
                ASSERT_EQ(row.covered >> n & 1, unsigned{one.covered})
                    << "round " << round << ", block " << n;
                touched += one.touched;
                covered += one.covered;
                if (!one.touched) continue;
                ASSERT_EQ(std::bit_cast<std::uint32_t>(row.base_a[n]),
                          std::bit_cast<std::uint32_t>(one.base_a));
                ASSERT_EQ(std::bit_cast<std::uint32_t>(row.base_b[n]),
                          std::bit_cast<std::uint32_t>(one.base_b));
                for (std::size_t d = 0; d < 3; ++d) ASSERT_EQ(row.bound[d][n], one.bound[d]) << "draw " << d;
            }
        });
    }
    EXPECT_GT(touched, 1000);
    EXPECT_GT(covered, 100);
}

}  // namespace
}  // namespace nephos
