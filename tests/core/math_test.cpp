// SPDX-License-Identifier: Apache-2.0
#include "core/math.h"

#include <cmath>

#include <gtest/gtest.h>

namespace nephos {
namespace {

TEST(Geometric, IsThePowerOfTheLibrary) {
    for (const double to : {1e-6, 0.3, 1.0, 2.0, 17.3, 1e9}) {
        for (int n = 0; n <= 1000; ++n) {
            const double unit = n / 1000.0, expected = 1e-3 * std::pow(to / 1e-3, unit);
            EXPECT_NEAR(geometric(1e-3, to, unit), expected, 1e-14 * expected) << to << " " << unit;
        }
    }
}

TEST(Geometric, IsExactWhereRootsAre) {
    EXPECT_EQ(geometric(1, 16, 0), 1);
    EXPECT_EQ(geometric(1, 16, 0.25), 2);
    EXPECT_EQ(geometric(1, 16, 0.75), 8);
    EXPECT_EQ(geometric(3, 48, 1), 48);
    EXPECT_EQ(geometric(7, 7, 0.123), 7);
    EXPECT_EQ(geometric(81, 1, 0.5), 9);
}

// Bits that std::pow() gives with one version of the C library and not with another.
TEST(Geometric, HasItsBitsEverywhere) { EXPECT_EQ(geometric(1e-6, 1e-2, 0.3712645), 0x1.004cb17f7b509p-15); }

}  // namespace
}  // namespace nephos
