// SPDX-License-Identifier: Apache-2.0

// Packed series: every bit comes back, and what is damaged is refused.

#include "study/packed_series.h"

#include <bit>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "core/error.h"

namespace nephos {
namespace {

TEST(PackedSeries, EveryBitComesBack) {
    std::mt19937_64 random(1);
    for (const std::size_t count : {0u, 1u, 2u, 7u, 301u, 5000u}) {
        std::vector<float> values;
        for (std::size_t n = 0; n < count; ++n)
            values.push_back(std::bit_cast<float>(std::uint32_t(random())));
        if (count > 4) {
            values[1] = std::numeric_limits<float>::quiet_NaN();
            values[2] = -0.0F;
            values[3] = std::numeric_limits<float>::infinity();
        }
        const std::vector<float> back = unpack_series(pack_series(values), count);
        ASSERT_EQ(back.size(), count);
        for (std::size_t n = 0; n < count; ++n)
            EXPECT_EQ(std::bit_cast<std::uint32_t>(back[n]), std::bit_cast<std::uint32_t>(values[n]));
    }
}

// A cover of 32,768 columns that wanders by a percent: a third of its bytes.
TEST(PackedSeries, CoverOverTimeIsSmall) {
    std::mt19937_64 random(2);
    std::normal_distribution<double> noise(0, 100);
    std::vector<float> cover;
    for (int n = 0; n < 301; ++n) cover.push_back(float(std::round(10000 + noise(random)) / 32768));
    EXPECT_LT(pack_series(cover).size(), 301 * 4 / 2);
    EXPECT_LT(pack_series(std::vector<float>(10000, 0.25F)).size(), 200u);
}

TEST(PackedSeries, DamageIsSeen) {
    std::vector<float> values;
    for (int n = 0; n < 100; ++n) values.push_back(float(std::sin(n)));
    const std::string packed = pack_series(values);
    for (std::size_t at = 0; at < packed.size(); ++at) {
        std::string damaged = packed;
        damaged[at] = char(damaged[at] ^ 0x55);
        EXPECT_THROW(unpack_series(damaged, 100), Error) << at;
        EXPECT_THROW(unpack_series(packed.substr(0, at), 100), Error) << at;
    }
    EXPECT_THROW(unpack_series(packed, 99), Error);
    EXPECT_THROW(unpack_series(packed, 101), Error);
    EXPECT_THROW(unpack_series(packed, std::size_t(1) << 40), Error) << "and no memory is asked for";
}

}  // namespace
}  // namespace nephos
