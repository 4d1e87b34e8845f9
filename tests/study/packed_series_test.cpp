// SPDX-License-Identifier: Apache-2.0

// Packed series: every bit comes back, and what is damaged is refused.

#include "study/packed_series.h"

#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <random>

#include "study/run_statistics.h"
#include <gtest/gtest.h>

#include "core/bytes.h"
#include "core/error.h"
#include "tests/study/hand_packed.h"

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

// A header by hand: each series with a scale, or as floats.
class HandMade {
  public:
    explicit HandMade(int series) { writer_.put(std::uint8_t(series)); }
    HandMade& scaled(int by = -1, int has_scale = 1) {
        writer_.put(std::uint8_t(has_scale));
        writer_.put(std::array<double, 3>{0, 8, 1});
        writer_.put(std::int8_t(by));
        return *this;
    }
    HandMade& plain(int series = 1) {
        for (int n = 0; n < series; ++n) writer_.put(std::uint8_t(0));
        return *this;
    }
    // Values are all 0.
    std::string with_values(std::size_t count) {
        for (std::size_t n = 0; n < count; ++n) writer_.put(std::uint32_t(0));
        return packed();
    }
    std::string packed() const { return test::hand_packed(writer_.bytes()); }
    // Its first bytes alone.
    std::string cut(std::size_t bytes) const { return test::hand_packed(writer_.bytes().first(bytes)); }
    std::size_t size() const { return writer_.bytes().size(); }

  private:
    ByteWriter writer_;
};

void expect_damaged(const std::string& packed, std::size_t count) {
    try {
        unpack_series(packed, count);
        ADD_FAILURE() << "is accepted";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::io);
        EXPECT_STREQ(error.what(), "packed series are damaged");
    }
}

// Whose sum of bytes is right: what zlib cannot see the reader of the header has to.
TEST(PackedSeries, FaultsOfAHeaderAreSeen) {
    EXPECT_EQ(unpack_series(HandMade(3).scaled().scaled(0).plain().with_values(6), 6).size(), 6u);
    EXPECT_EQ(unpack_series(HandMade(64).plain(64).with_values(128), 128).size(), 128u);
    for (const int by : {1, 2, 3, 127, -2, -128}) {
        SCOPED_TRACE(by);
        expect_damaged(HandMade(3).scaled().scaled(by).scaled().with_values(6), 6);
    }
    expect_damaged(HandMade(3).plain().scaled(0).scaled().with_values(6), 6);
    expect_damaged(HandMade(1).scaled(-1, 2).with_values(6), 6);
    expect_damaged(HandMade(0).with_values(6), 6);
    expect_damaged(HandMade(0).with_values(0), 0);
    for (int series = 65; series <= 255; ++series) {
        SCOPED_TRACE(series);
        expect_damaged(HandMade(series).plain(series).with_values(std::size_t(series)), std::size_t(series));
    }
    const HandMade two = HandMade(2).scaled().scaled(0);
    for (std::size_t bytes = 0; bytes <= two.size(); ++bytes) {
        SCOPED_TRACE(bytes);
        expect_damaged(two.cut(bytes), 2);
    }
    for (const std::size_t count : {1u, 5u, 7u}) {
        SCOPED_TRACE(count);
        expect_damaged(HandMade(2).scaled().scaled().with_values(count), count);
    }
    for (const std::size_t count : {4u, 8u}) {
        SCOPED_TRACE(count);
        expect_damaged(HandMade(2).scaled().scaled().with_values(6), count);
    }
}

// Returns for each series whether it is stored by its scale.
std::vector<bool> stored_by_scale(const std::string& packed, std::size_t count) {
    std::vector<std::byte> bytes(4096 + 4 * count);
    uLongf size = uLongf(bytes.size());
    EXPECT_EQ(packed.front(), '\1');
    EXPECT_EQ(uncompress(static_cast<Bytef*>(static_cast<void*>(bytes.data())), &size,
                         static_cast<const Bytef*>(static_cast<const void*>(packed.data() + 1)),
                         uLong(packed.size() - 1)),
              Z_OK);
    bytes.resize(size);
    ByteReader reader(bytes);
    std::vector<bool> stored(reader.get<std::uint8_t>());
    for (std::size_t n = 0; n < stored.size(); ++n) {
        stored[n] = reader.get<std::uint8_t>() == 1;
        if (stored[n]) reader.skip(3 * sizeof(double) + 1);
    }
    return stored;
}

// Cells of an odd size above an odd floor; the first states have no cloud, and no base.
TEST(PackedSeries, EverySeriesOfARunIsOfWholeNumbers) {
    Scene scene;
    scene.automaton.extent = {70, 30, 12};
    scene.automaton.boundaries = {Boundary::periodic, Boundary::periodic, Boundary::open};
    scene.automaton.placement = {{0, 0, 412.7}, 37.3};
    scene.automaton.initial = InitialState::empty;
    scene.automaton.field.background = {0.003, 1e-4, 0.12};
    SweepOptions options;
    options.steps = {120, 120, {}};
    options.clouds_every = 0;
    const RunResult run = run_for_statistics(scene, options, false);
    ASSERT_EQ(run.series.size(), 121 * kSeries.size());
    EXPECT_TRUE(std::isnan(run.series[4 * 121])) << "no base without cloud";
    EXPECT_GT(run.series[120], 0) << "no cloud at the end";
    const std::string packed = pack_series(run.series, run.scales);
    EXPECT_EQ(stored_by_scale(packed, run.series.size()), std::vector<bool>(kSeries.size(), true));
    EXPECT_LT(packed.size(), 121 * kSeries.size() * 2) << "half of their floats";
    expect_bits_back(run.series, packed);
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
