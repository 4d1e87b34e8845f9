// SPDX-License-Identifier: Apache-2.0

// NetCDF classic files: written and read back, damaged at every byte. That other programs read them is tested with scipy
// (tests/apps/command/sweep_test.py).

#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>

#include "study/netcdf_file.h"
#include <gtest/gtest.h>

#include "core/error.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

struct NetcdfTest : testing::Test {
    fs::path folder = fs::path(testing::TempDir()) / ("netcdf-" + std::to_string(::getpid()));
    void SetUp() override { fs::create_directories(folder); }
    void TearDown() override { fs::remove_all(folder); }
};

std::string content(const fs::path& path) {
    std::ifstream stream(path, std::ios::binary);
    std::ostringstream out;
    out << stream.rdbuf();
    return out.str();
}

void write_sample(const fs::path& path) {
    write_netcdf(path, {{"y", 3}, {"x", 5}}, {{"title", "a test"}},
                 {{"label",
                   NetcdfType::text,
                   {1},
                   {},
                   [](const auto& put) {
                       for (const char c : std::string("abcde")) put(c);
                   }},
                  {"mask",
                   NetcdfType::float32,
                   {0, 1},
                   {{"units", "1"}},
                   [](const auto& put) {
                       for (int n = 0; n < 15; ++n) put(n == 7 ? std::nan("") : n / 2.0);
                   }},
                  {"x", NetcdfType::int32, {1}, {}, [](const auto& put) {
                       for (int n = 0; n < 5; ++n) put(n - 2);
                   }}});
}

TEST_F(NetcdfTest, ReadsWhatItWrote) {
    const fs::path path = folder / "a.nc";
    write_sample(path);
    const NetcdfData mask = read_netcdf(path, "");
    EXPECT_EQ(mask.dimensions, (std::vector<std::string>{"y", "x"}));
    EXPECT_EQ(mask.sizes, (std::vector<std::uint64_t>{3, 5}));
    ASSERT_EQ(mask.values.size(), 15u);
    for (int n = 0; n < 15; ++n) {
        if (n == 7) {
            EXPECT_TRUE(std::isnan(mask.values[7]));
        } else {
            EXPECT_EQ(mask.values[std::size_t(n)], n / 2.0);
        }
    }
    EXPECT_EQ(read_netcdf(path, "x").values, (std::vector<double>{-2, -1, 0, 1, 2}));
    EXPECT_EQ(read_netcdf(path, "label").values.front(), 'a');
    write_sample(folder / "b.nc");
    EXPECT_EQ(content(path), content(folder / "b.nc")) << "equal content, equal bytes";
}

TEST_F(NetcdfTest, RefusesWhatItCannotRead) {
    const fs::path path = folder / "a.nc";
    write_sample(path);
    EXPECT_THROW(read_netcdf(path, "nothing"), Error);
    EXPECT_THROW(read_netcdf(folder / "none.nc", ""), Error);
    const std::string good = content(path);
    for (std::size_t size = 0; size + 1 < good.size(); size += 3) {
        std::ofstream(path, std::ios::binary) << good.substr(0, size);
        try {
            read_netcdf(path, "mask");  // what is cut off may lie behind the variable
            EXPECT_GT(size, good.size() - 32) << size;
        } catch (const Error&) {
        }
    }
    // Whatever a byte is, there is a result or an Error.
    for (std::size_t at = 0; at < good.size(); ++at) {
        std::string bad = good;
        bad[at] = char(bad[at] ^ 0xff);
        std::ofstream(path, std::ios::binary) << bad;
        try {
            read_netcdf(path, "mask");
        } catch (const Error&) {
        }
    }
    std::ofstream(path, std::ios::binary) << "\x89HDF\r\n\x1a\n";
    try {
        read_netcdf(path, "");
        FAIL();
    } catch (const Error& error) {
        EXPECT_NE(std::string(error.what()).find("nccopy"), std::string::npos);
    }
}

std::string number(std::uint64_t value, int bytes) {
    std::string out;
    for (int n = bytes - 1; n >= 0; --n) out += char(value >> 8 * n & 0xff);
    return out;
}

// Three records of three 16-bit numbers, 1 to 9, of the only variable; its values begin at `begin`, or after the header.
std::string one_record_variable(std::optional<std::uint64_t> begin) {
    const auto word = [](std::uint64_t value) { return number(value, 4); };
    const auto name = [&](char letter) { return word(1) + letter + std::string(3, '\0'); };
    std::string file = "CDF\x02" + word(3) + word(10) + word(2) + name('t') + word(0) + name('x') + word(3);
    file += word(0) + word(0) + word(11) + word(1) + name('v') + word(2) + word(0) + word(1);
    file += word(0) + word(0) + word(3) + word(8);
    file += number(begin.value_or(file.size() + 8), 8);
    for (std::uint64_t n = 1; n <= 9; ++n) file += number(n, 2);
    return file;
}

TEST_F(NetcdfTest, RecordsOfTheOnlyRecordVariableAreNotPadded) {
    const fs::path path = folder / "records.nc";
    std::ofstream(path, std::ios::binary) << one_record_variable({});
    EXPECT_EQ(read_netcdf(path, "v").values, (std::vector<double>{1, 2, 3, 4, 5, 6, 7, 8, 9}));
}

TEST_F(NetcdfTest, RefusesAnOffsetThatWrapsAround) {
    const fs::path path = folder / "wraps.nc";
    std::ofstream(path, std::ios::binary) << one_record_variable(~std::uint64_t(0) - 1);
    EXPECT_THROW(read_netcdf(path, "v"), Error);
}

TEST_F(NetcdfTest, RefusesANumberWithoutDimensions) {
    const fs::path path = folder / "scalar.nc";
    write_netcdf(path, {}, {}, {{"s", NetcdfType::float64, {}, {}, [](const auto& put) { put(1.0); }}});
    EXPECT_THROW(read_netcdf(path, "s"), Error);
}

TEST_F(NetcdfTest, RefusesToWriteWhatDoesNotFit) {
    const auto none = [](const auto&) {};
    EXPECT_THROW(write_netcdf(folder / "a.nc", {{"x", 2}}, {}, {{"v", NetcdfType::int32, {0}, {}, none}}),
                 Error);
    EXPECT_THROW(write_netcdf(folder / "a.nc", {{"x", 100'000}, {"y", 100'000}}, {},
                              {{"v", NetcdfType::float32, {0, 1}, {}, none}}),
                 Error);
    EXPECT_FALSE(fs::exists(folder / "a.nc"));
}

}  // namespace
}  // namespace nephos
