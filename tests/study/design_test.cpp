// SPDX-License-Identifier: Apache-2.0

// Designs, axes of the command line, and the quantiles of Student's t against tables.

#include "study/design.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>
#include <string>

#include "study/axis_text.h"
#include "study/student.h"
#include "study/sweep_file.h"
#include "study/tables.h"
#include "study/toml_table.h"
#include <gtest/gtest.h>
#include <unistd.h>

#include "core/error.h"
#include "scenes/format/errors.h"

namespace nephos {
namespace {

TEST(Design, LatinHypercubeHasOnePointInEachStratum) {
    for (const std::uint64_t count : {1u, 7u, 64u}) {
        const std::vector<double> points = unit_points(Design::latin_hypercube, count, 3, 11);
        for (std::size_t d = 0; d < 3; ++d) {
            std::set<int> strata;
            for (std::uint64_t n = 0; n < count; ++n) strata.insert(int(points[n * 3 + d] * double(count)));
            EXPECT_EQ(strata.size(), count);
        }
    }
    EXPECT_NE(unit_points(Design::latin_hypercube, 8, 2, 1), unit_points(Design::latin_hypercube, 8, 2, 2));
}

TEST(Design, MorePointsKeepTheFirstOnes) {
    for (const Design design : {Design::random, Design::sobol}) {
        const std::vector<double> few = unit_points(design, 10, 4, 3), many = unit_points(design, 100, 4, 3);
        EXPECT_TRUE(std::equal(few.begin(), few.end(), many.begin()));
        EXPECT_TRUE(std::ranges::all_of(many, [](double x) { return x >= 0 && x < 1; }));
    }
}

// How even they are, whatever the seed: of the first 256 points one lies in each 1/256 of each axis and in each of 16 x 16
// squares, and the mean of x y is 1/4 far closer than random ones come.
TEST(Design, SobolPointsAreEven) {
    for (const std::uint64_t seed : {0u, 1u, 77u}) {
        // Boost leaves out the corner that begins the sequence; with it the next 255 are whole.
        const std::vector<double> points = unit_points(Design::sobol, 255, 2, seed);
        std::set<int> columns, rows, squares;
        double sum = 0;
        for (std::size_t n = 0; n < 255; ++n) {
            const double x = points[2 * n], y = points[2 * n + 1];
            columns.insert(int(x * 256));
            rows.insert(int(y * 256));
            squares.insert(int(x * 16) * 16 + int(y * 16));
            sum += x * y;
        }
        EXPECT_EQ(columns.size(), 255u);
        EXPECT_EQ(rows.size(), 255u);
        EXPECT_EQ(squares.size(), 255u);
        EXPECT_NEAR(sum / 256, 0.25, 0.006);
    }
    EXPECT_THROW(unit_points(Design::sobol, 1, 4000, 0), Error);
}

TEST(Design, SobolPointsGoOnAndDependOnTheSeed) {
    const std::vector<double> all = unit_points(Design::sobol, 100, 3, 5), rest = sobol_points(40, 60, 3, 5);
    EXPECT_TRUE(std::equal(rest.begin(), rest.end(), all.begin() + 40 * 3));
    EXPECT_NE(unit_points(Design::sobol, 8, 2, 1), unit_points(Design::sobol, 8, 2, 2));
}

TEST(Student, QuantilesAreThoseOfTheTables) {
    EXPECT_NEAR(student_quantile(1, 0.95), 12.706, 1e-3);
    EXPECT_NEAR(student_quantile(4, 0.95), 2.776, 1e-3);
    EXPECT_NEAR(student_quantile(10, 0.90), 1.812, 1e-3);
    EXPECT_NEAR(student_quantile(1000, 0.95), 1.962, 1e-3);
}

TEST(Student, ChiSquaredIsThatOfTheTables) {
    EXPECT_NEAR(chi_squared_probability(2, 5.991), 0.95, 1e-4);
    EXPECT_NEAR(chi_squared_probability(4, 0.207), 0.005, 1e-4);
}

// Three replicates whose errors within are right: chance alone must not raise the alarm more often than one in a hundred.
TEST(Tables, ErrorsOfFewReplicatesDifferOnlyBeyondChance) {
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal(0, 1);
    for (const int replicates : {3, 5, 10}) {
        int alarms = 0;
        for (int trial = 0; trial < 4000; ++trial) {
            double sum = 0, squares = 0;
            for (int n = 0; n < replicates; ++n) {
                const double x = normal(random);
                sum += x;
                squares += x * x;
            }
            const double variance = (squares - sum * sum / replicates) / (replicates - 1);
            alarms += errors_differ(std::sqrt(variance / replicates), 1 / std::sqrt(double(replicates)),
                                    replicates);
        }
        EXPECT_LE(alarms, 60) << replicates;
    }
    EXPECT_TRUE(errors_differ(0.05, 0.003, 3));
    EXPECT_TRUE(errors_differ(0.0001, 0.003, 5));
    EXPECT_FALSE(errors_differ(0.002, 0.001, 100)) << "twice is not three times";
    EXPECT_FALSE(errors_differ(0.05, 0.003, 2));
    EXPECT_TRUE(errors_differ(0.05, 0, 3));
    EXPECT_FALSE(errors_differ(0, 0, 3));
}

// Whole numbers that a range meets several times, in its order and each once; as many texts as values elsewhere.
TEST(Axis, ValuesAreSpreadWithoutRepetition) {
    std::vector<std::string> whole;
    for (int n = -3; n <= 40; ++n) whole.push_back(std::to_string(n));
    EXPECT_EQ(spread_values(-3, 40, 100'000, Scale::integer), whole);
    const std::vector<std::string> many = spread_values(0, 1, 100'000, Scale::linear);
    EXPECT_EQ(many.size(), 100'000u);
    EXPECT_EQ(std::set<std::string>(many.begin(), many.end()).size(), many.size());
    EXPECT_EQ(many.front(), "0");
    EXPECT_EQ(many.back(), "1");
}

TEST(SweepFile, ListsOnlySoManyProblems) {
    const std::filesystem::path path =
        std::filesystem::path(testing::TempDir()) / ("many-problems-" + std::to_string(::getpid()) + ".toml");
    {
        std::ofstream file(path);
        file << "scene = \"a.toml\"\n";
        for (int n = 0; n < 1500; ++n) file << "[[axis]]\nkey" << n << " = " << n << "\n";
        file << std::string(100'000, 'x') << " = 1\n";
    }
    try {
        read_sweep_file(path);
        ADD_FAILURE();
    } catch (const SceneErrors& errors) {
        EXPECT_EQ(errors.problems().size(), 1001u);
        EXPECT_NE(errors.problems().back().message.find("too many errors"), std::string::npos);
        EXPECT_LT(std::string(errors.what()).size(), 1u << 20);
    }
    std::filesystem::remove(path);
}

// Equal values have one text, and it is read back as the same; what has none is no value, and never an empty text.
TEST(Axis, ValuesHaveOneText) {
    for (const auto& [given, text] : std::vector<std::pair<std::string, std::string>>{
             {"[8,8, 4]", "[8, 8, 4]"},
             {"[ 1.0, -0.0, 1e-7, true,]", "[1, 0, 1e-07, true]"},
             {"'a\"b'", "\"a\\\"b\""},
             {"{ b = [{}], a.\"c d\" = 1_000 }", "{a = {\"c d\" = 1000}, b = [{}]}"},
             {"[{levels=[{height_m=0}]}]", "[{levels = [{height_m = 0}]}]"}}) {
        EXPECT_EQ(canonical_toml(given), text);
        EXPECT_EQ(canonical_toml(text), text);
    }
    for (const char* bad :
         {"", "[1", "[1] 2", "[1]\nw = 2", "2026-07-01", "[2026-07-01]", "{a = [{b = 12:00:00}]}"})
        EXPECT_FALSE(canonical_toml(bad)) << bad;
}

TEST(Axis, KeysOverlapWhereOneIsAPartOfTheOther) {
    EXPECT_EQ(canonical_key(" a[00].b[10][007] "), "a[0].b[10][7]");
    EXPECT_EQ(outer_keys("a.b[0].c"), (std::vector<std::string>{"a", "a.b", "a.b[0]"}));
    EXPECT_TRUE(outer_keys("a").empty());
}

TEST(Axis, IsReadFromTheCommandLine) {
    EXPECT_EQ(parse_axis("a.b=0.1,0.2").values, (std::vector<std::string>{"0.1", "0.2"}));
    EXPECT_EQ(parse_axis("a.b=0.1..0.3:3").values, (std::vector<std::string>{"0.1", "0.2", "0.3"}));
    EXPECT_EQ(parse_axis("a=log:1e-6..1e-2:5").values,
              (std::vector<std::string>{"1e-06", "1e-05", "0.0001", "0.001", "0.01"}));
    EXPECT_EQ(parse_axis("a=integer:1..4:4").values, (std::vector<std::string>{"1", "2", "3", "4"}));
    EXPECT_EQ(parse_axis("a=[1, 2],[3, 4]").values, (std::vector<std::string>{"[1, 2]", "[3, 4]"}));
    EXPECT_EQ(parse_axis("a={b=1, c=[2,3]} ,{b=\"..}\"}").values,
              (std::vector<std::string>{"{b=1, c=[2,3]}", "{b=\"..}\"}"}));
    EXPECT_EQ(parse_axis("w=\"a\\\",b\", c ").values, (std::vector<std::string>{"\"a\\\",b\"", "c"}));
    EXPECT_EQ(parse_axis("w=\"a,b\",c").values, (std::vector<std::string>{"\"a,b\"", "c"}));
    const Axis range = parse_axis("a+b[0].c=log:0.001..1");
    EXPECT_EQ(range.keys, (std::vector<std::string>{"a", "b[0].c"}));
    EXPECT_TRUE(range.values.empty() && range.scale == Scale::log && range.from == 0.001 && range.to == 1);
    for (const char* bad : {"a", "=1", "a=1, ,2", "a=1..", "a=..", "a=1..x", "a=2..1", "a=1,,2", "a=1..2:1",
                            "a=1..2:2.5", "a=log:3", "a=0...1:3", "a=.5...7"})
        EXPECT_THROW(parse_axis(bad), Error) << bad;
}

}  // namespace
}  // namespace nephos
