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

// Cover, cloud cells and mean base of a small lattice over time; without cloud a base is NaN.
struct Scaled {
    std::vector<float> values;
    std::vector<SeriesScale> scales{{.divisor = 600}, {.divisor = 4200}, {.offset = 350, .scale = 50, .by = 0}};
};

Scaled scaled_series(std::size_t steps) {
    std::mt19937_64 random(3);
    Scaled result;
    std::vector<std::uint64_t> columns, levels;
    for (std::size_t n = 0; n < steps; ++n) columns.push_back(n % 50 == 0 ? 0 : 150 + random() % 40);
    for (const std::uint64_t column : columns) result.values.push_back(float(double(column) / 600));
    for (const std::uint64_t column : columns) result.values.push_back(float(double(2 * column) / 4200));
    for (const std::uint64_t column : columns)
        result.values.push_back(column == 0 ? std::numeric_limits<float>::quiet_NaN()
                                            : float(350 + double(3 * column + random() % 90) / double(column) * 50));
    return result;
}

void expect_bits_back(const std::vector<float>& values, const std::string& packed) {
    const std::vector<float> back = unpack_series(packed, values.size());
    ASSERT_EQ(back.size(), values.size());
    for (std::size_t n = 0; n < values.size(); ++n)
        EXPECT_EQ(std::bit_cast<std::uint32_t>(back[n]), std::bit_cast<std::uint32_t>(values[n])) << n;
}

TEST(PackedSeries, QuotientsOfWholeNumbersComeBack) {
    const Scaled series = scaled_series(301);
    const std::string packed = pack_series(series.values, series.scales), plain = pack_series(series.values);
    expect_bits_back(series.values, packed);
    EXPECT_LT(3 * packed.size(), 2 * plain.size());
    for (std::size_t at = 0; at < packed.size(); ++at) {
        std::string damaged = packed;
        damaged[at] = char(damaged[at] ^ 0x55);
        EXPECT_THROW(unpack_series(damaged, series.values.size()), Error) << at;
        EXPECT_THROW(unpack_series(packed.substr(0, at), series.values.size()), Error) << at;
    }
    EXPECT_THROW(unpack_series(packed, series.values.size() - 3), Error);
    EXPECT_THROW(unpack_series(packed, series.values.size() + 3), Error);
}

// One value that is no such quotient, and the series that are divided by its series: floats, as they are.
TEST(PackedSeries, WhatIsNoQuotientComesBackToo) {
    for (const std::size_t odd : {0u, 5u, 300u, 301u, 900u}) {
        for (const float value : {0.123F, -1.0F, std::numeric_limits<float>::infinity(), -0.0F}) {
            Scaled series = scaled_series(301);
            series.values[odd] = value;
            expect_bits_back(series.values, pack_series(series.values, series.scales));
        }
    }
    expect_bits_back({}, pack_series({}, scaled_series(1).scales));
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
