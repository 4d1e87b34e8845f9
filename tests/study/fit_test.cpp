// SPDX-License-Identifier: Apache-2.0

// Fits of a function whose answer is known: the cover of a scene without vapour, with noise.

#include "study/fit.h"

#include <array>
#include <bit>
#include <cmath>
#include <map>
#include <random>
#include <set>

#include "study/design.h"
#include "study/emulator.h"
#include "study/fit_folder.h"
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "core/error.h"

namespace nephos {
namespace {

constexpr double kNoise = 0.01;  // of logit C, and of log lifetime

double null_cover(double act, double ext) {
    const double f = act * (1 - ext) / (1 - (1 - act) * (1 - ext));
    return 1 - std::pow(1 - f, 20);
}

const FitParameter kExt{{"field.background.ext"}, 0.02, 0.3, Scale::log};
const FitParameter kAct{{"field.background.act"}, 1e-4, 1e-2, Scale::log};

// Cover and lifetime in steps, as a run gives them: the noise is a function of the point and the seed, so a point that is
// run twice tells nothing new. `waves` takes the points of each wave.
using Waves = std::map<int, std::vector<std::vector<double>>>;

Simulate toy(const FitProblem& problem, std::uint64_t seed, Waves* waves = nullptr) {
    return [=, &problem](int wave, const std::vector<std::vector<double>>& points) {
        std::vector<FitRun> runs;
        for (const std::vector<double>& unit : points) {
            std::vector<std::uint32_t> words{std::uint32_t(seed)};
            for (const double x : unit) {
                const auto bits = std::bit_cast<std::uint64_t>(x);
                words.insert(words.end(), {std::uint32_t(bits), std::uint32_t(bits >> 32)});
            }
            std::seed_seq mixed(words.begin(), words.end());
            std::mt19937_64 random(mixed);
            std::normal_distribution<double> noise(0, kNoise);
            const double ext = parameter_value(problem.parameters[0], unit[0]);
            const double act =
                problem.parameters.size() > 1 ? parameter_value(problem.parameters[1], unit[1]) : 1e-3;
            const double c = null_cover(act, ext), logit = std::log(c / (1 - c)) + noise(random);
            FitRun run{unit, {}, {}};
            for (const FitTarget& target : problem.targets) {
                const double cover = 1 / (1 + std::exp(-logit));
                run.statistics.push_back(target.statistic == "cover" ? cover
                                                                     : std::exp(noise(random)) * 10 / ext);
                run.errors.push_back(
                    kNoise * (target.statistic == "cover" ? cover * (1 - cover) : run.statistics.back()));
            }
            runs.push_back(std::move(run));
        }
        if (waves) (*waves)[wave] = points;
        return runs;
    };
}

// A target that excludes nothing keeps the whole prior in every wave: the waves must look at other points all the same.
TEST(Fit, NoPointIsRunTwice) {
    for (const double sd : {0.2, 0.01, 1e-4}) {
        const FitProblem problem{{kExt, kAct}, {{"cover", 0.3, sd}}, 96, 0, 3};
        Waves waves;
        fit(problem, toy(problem, 4, &waves));
        std::set<std::vector<double>> points;
        std::size_t count = 0;
        for (const auto& [wave, all] : waves) {
            count += all.size();
            points.insert(all.begin(), all.end());
        }
        EXPECT_EQ(waves.size(), 3u);
        EXPECT_EQ(count, 96u) << sd;
        EXPECT_EQ(points.size(), count) << sd;
    }
}

// The box about a ridge holds mostly points beside it: none of them may be run once the ridge is known.
TEST(Fit, LaterWavesLookOnlyWhereTheTargetsArePossible) {
    const FitProblem problem{{kExt, kAct}, {{"cover", 0.3, 0.01}}, 96, 0, 1};
    Waves waves;
    fit(problem, toy(problem, 8, &waves));
    for (const int wave : {2, 3}) {
        EXPECT_EQ(waves[wave].size(), 24u);
        for (const std::vector<double>& unit : waves[wave])
            EXPECT_NEAR(null_cover(parameter_value(kAct, unit[1]), parameter_value(kExt, unit[0])), 0.3, 0.04)
                << "3 sd of the target, and the emulator's error";
    }
}

TEST(Fit, OneParameterIsFoundWithinHalfAPercentFrom64Runs) {
    const double truth = 0.05265;
    const FitProblem problem{{kExt}, {{"cover", null_cover(1e-3, truth), 1e-4}}, 64, 8, 1};
    Waves waves;
    const FitResult result = fit(problem, toy(problem, 5, &waves));
    EXPECT_EQ(waves[1].size(), 32u);
    EXPECT_EQ(waves[2].size(), 16u);
    EXPECT_EQ(waves[3].size(), 16u);
    EXPECT_EQ(waves[4].size(), 8u);
    EXPECT_EQ(result.runs, 64u);
    EXPECT_NEAR(result.parameters[0].mean, truth, 0.005 * truth);
    EXPECT_LT(result.parameters[0].sd, 0.005 * truth);
    EXPECT_GT(result.directions[0].strength, 1);
    EXPECT_NEAR(result.targets[0].got, result.targets[0].target, 5 * result.targets[0].got_error);
    ASSERT_EQ(result.posterior.size(), 1000u);
    // Any eight rows are a sample: those of the proof, the first, are not all at one place.
    double low = 1, high = 0;
    for (std::size_t n = 0; n < 8; ++n) {
        low = std::min(low, result.posterior[n][0]);
        high = std::max(high, result.posterior[n][0]);
    }
    EXPECT_GT(high - low, result.parameters[0].sd);
    EXPECT_LT(result.implausibility, 1);
}

TEST(Fit, TwoTargetsFixTwoParameters) {
    const double ext = 0.08, act = 1.5e-3;
    const FitProblem problem{
        {kExt, kAct}, {{"cover", null_cover(act, ext), 1e-3}, {"lifetime_s", 10 / ext, 0.2}}, 96, 0, 1};
    const FitResult result = fit(problem, toy(problem, 6));
    EXPECT_NEAR(result.parameters[0].mean, ext, 0.01 * ext);
    EXPECT_NEAR(result.parameters[1].mean, act, 0.01 * act + 2 * result.parameters[1].sd);
    EXPECT_LT(result.parameters[1].sd, 0.02 * act);
    EXPECT_GT(result.directions[1].strength, 1);
}

// One target leaves a ridge: cover is a function of act / ext but for small terms. It is found, and named.
TEST(Fit, ARidgeIsFoundAndNamed) {
    const FitProblem problem{{kExt, kAct}, {{"cover", 0.3, 0.01}}, 64, 0, 1};
    const FitResult result = fit(problem, toy(problem, 7));
    EXPECT_GT(result.directions[0].strength, 1);
    EXPECT_LT(result.directions[1].strength, 0.01);
    // Along the ridge log act rises with log ext, in units of ranges log(15) and log(100); how steeply is known at each point.
    const std::vector<double>& free = result.directions[1].weights;
    const double ext = result.best[0], act = result.best[1], h = 1e-4;
    const double by_ext = null_cover(act, ext * (1 + h)) - null_cover(act, ext * (1 - h));
    const double by_act = null_cover(act * (1 + h), ext) - null_cover(act * (1 - h), ext);
    EXPECT_NEAR(free[1] / free[0], -by_ext / by_act * std::log(15) / std::log(100), 0.1);
    double low = 1, high = 0;
    for (const std::vector<double>& sample : result.posterior) {
        EXPECT_NEAR(null_cover(sample[1], sample[0]), 0.3, 0.05);
        low = std::min(low, sample[0]);
        high = std::max(high, sample[0]);
    }
    EXPECT_LT(low, 0.03);
    EXPECT_GT(high, 0.2);
}

// A target whose deviation is not small beside it: on the emulator's scale, the logit, that is no normal distribution at all.
TEST(Fit, AWideTargetIsNormalInItsOwnUnit) {
    for (const auto& [value, sd] : {std::pair(0.02, 0.05), std::pair(0.001, 0.03), std::pair(0.3, 0.1)}) {
        const FitProblem problem{{kExt}, {{"cover", value, sd}}, 64, 0, 1};
        const FitResult result = fit(problem, toy(problem, 9));
        // Prior x likelihood, by the sum over 10,000 points.
        std::vector<std::pair<double, double>> weights;
        double total = 0, mean = 0;
        for (int n = 0; n < 10'000; ++n) {
            const double ext = parameter_value(kExt, (n + 0.5) / 10'000);
            const double off = (null_cover(1e-3, ext) - value) / sd, weight = std::exp(-off * off / 2);
            weights.emplace_back(ext, weight);
            total += weight;
            mean += weight * ext;
        }
        const auto quantile = [&](double q) {
            double sum = 0;
            for (const auto& [ext, weight] : weights)
                if ((sum += weight) >= q * total) return ext;
            return 0.0;
        };
        EXPECT_NEAR(result.parameters[0].mean, mean / total, 0.02 * mean / total) << value;
        EXPECT_NEAR(result.parameters[0].low, quantile(0.05), 0.03 * quantile(0.05)) << value;
        EXPECT_NEAR(result.parameters[0].high, quantile(0.95), 0.03 * quantile(0.95)) << value;
    }
}

struct Coverage {
    int inside = 0;
    std::array<int, 5> ranks{};  // of the truth among the samples

    void add(double truth, const FitResult& result) {
        inside += truth > result.parameters[0].low && truth < result.parameters[0].high;
        std::size_t below = 0;
        for (const std::vector<double>& sample : result.posterior) below += sample[0] < truth;
        ++ranks[std::min<std::size_t>(4, below * 5 / result.posterior.size())];
    }
};

// Fits of `truths` truths from `runs` runs; what is observed is off the truth by what the target's sd says.
Coverage coverage(int truths, std::uint64_t runs, double relative_sd, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(0.1, 0.9);
    std::normal_distribution<double> normal(0, 1);
    Coverage found;
    for (int n = 0; n < truths; ++n) {
        const double truth = parameter_value(kExt, uniform(random)), cover = null_cover(1e-3, truth);
        const double sd = relative_sd * cover, seen = cover + sd * normal(random);
        const FitProblem problem{{kExt}, {{"cover", seen, sd}}, runs, 0, 1};
        found.add(truth, fit(problem, toy(problem, 1000 * seed + std::uint64_t(n))));
    }
    return found;
}

// A response that goes from a plateau to another, of the first parameter alone: logit C = 3 tanh(6 (x - 1/2)). The others change
// nothing, so that what is possible reaches from side to side of the cube along each of them.
double plateaus(double x) { return 3 * std::tanh(6 * (x - 0.5)); }

// As coverage(), with free parameters beside the one that is found, and truths in all of its prior.
Coverage coverage_beside_free_ones(std::size_t dimensions, int truths, std::uint64_t runs, double sd,
                                   std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    std::normal_distribution<double> normal(0, 1);
    Coverage found;
    for (int n = 0; n < truths; ++n) {
        const double truth = uniform(random),
                     seen = 1 / (1 + std::exp(-plateaus(truth) - sd * normal(random)));
        const FitProblem problem{
            std::vector<FitParameter>(dimensions, {{"field.background.ext"}, 0, 1, Scale::linear}),
            {{"cover", seen, sd * seen * (1 - seen)}},
            runs,
            0,
            1};
        std::mt19937_64 of_run(1000 * seed + std::uint64_t(n));
        const FitResult result = fit(problem, [&](int, const std::vector<std::vector<double>>& points) {
            std::vector<FitRun> all;
            for (const std::vector<double>& unit : points) {
                const double cover = 1 / (1 + std::exp(-plateaus(unit[0]) - kNoise * normal(of_run)));
                all.push_back({unit, {cover}, {kNoise * cover * (1 - cover)}});
            }
            return all;
        });
        found.add(truth, result);
    }
    return found;
}

double chi_squared(const Coverage& found) {
    double sum = 0, mean = 0;
    for (const int count : found.ranks) mean += count / 5.0;
    for (const int count : found.ranks) sum += (count - mean) * (count - mean) / mean;
    return sum;
}

// 100 truths: the intervals of 90 % must hold about 90 of them, and the truth's rank among the samples be even; where the
// target is what is uncertain, and where the runs are.
TEST(Fit, IntervalsHoldTheTruthAsOftenAsTheySay) {
    for (const double relative_sd : {0.02, 1e-5}) {
        const Coverage found = coverage(100, 24, relative_sd, 2);
        EXPECT_GE(found.inside, 83) << relative_sd;
        EXPECT_LE(found.inside, 96) << relative_sd;
        EXPECT_LT(chi_squared(found), 13.28) << relative_sd << ": p = 0.01 at four degrees of freedom";
    }
}

// A line through two plateaus knows its own mean well, and is far off nearly everywhere: what it misses has to be in the error.
TEST(Fit, IntervalsHoldTheTruthBesideFreeParameters) {
    for (const double sd : {0.3, 0.03}) {
        const Coverage found = coverage_beside_free_ones(4, 50, 64, sd, 1);
        EXPECT_GE(found.inside, 41) << sd;
    }
}

// After three waves the runs stand within a few percent of the truth. A polynomial through them alone bends away beyond them:
// there the posterior must have nothing.
TEST(Fit, ThePosteriorEndsWhereTheRunsDo) {
    for (std::uint64_t seed = 1; seed <= 40; ++seed) {
        const FitProblem problem{{kExt}, {{"cover", 0.3, 0.003}}, 32, 0, seed};
        const FitResult result = fit(problem, toy(problem, seed));
        // 0.003 of the cover are 1.5 % of the extinction, and the runs know it to 0.5 %.
        EXPECT_LT(result.parameters[0].sd, 0.025 * result.parameters[0].mean) << seed;
    }
}

// The figures of docs/adr/0035-fits.md, with fewer truths.
TEST(Fit, CoverageOfManyTruths) {
    if (std::getenv("NEPHOS_TEST_ALL") == nullptr) GTEST_SKIP() << "./test --all measures it";
    for (const std::uint64_t runs : {24u, 64u}) {
        for (const double relative_sd : {0.02, 0.002, 1e-5}) {
            std::string line;
            for (std::uint64_t seed = 1; seed <= 2; ++seed) {
                const Coverage found = coverage(100, runs, relative_sd, seed);
                line += fmt::format(" {} ({:.1f})", found.inside, chi_squared(found));
                EXPECT_GE(found.inside, 80);
                EXPECT_LE(found.inside, 98);
            }
            std::puts(fmt::format("{} runs, sd {} of the target:{}", runs, relative_sd, line).c_str());
        }
    }
    for (const std::size_t dimensions : {1u, 4u}) {
        for (const double sd : {0.3, 0.03, 0.001}) {
            const Coverage found = coverage_beside_free_ones(dimensions, 100, 64, sd, 2);
            EXPECT_GE(found.inside, 80);
            std::puts(fmt::format("{} parameters, sd {} of the logit: {} ({:.1f})", dimensions, sd,
                                  found.inside, chi_squared(found))
                          .c_str());
        }
    }
}

// A sheet through a cube of six parameters, thinner than the gaps between all the points that are tried: the posterior rests on
// a few of them.
TEST(Fit, TheProofRunsNoPointTwice) {
    const FitProblem problem{std::vector<FitParameter>(6, {{"field.background.ext"}, 0, 1, Scale::linear}),
                             {{"cover", 0.5, 1e-7}},
                             64,
                             8,
                             1};
    Waves waves;
    FitResult result = fit(problem, [&](int wave, const std::vector<std::vector<double>>& points) {
        std::vector<FitRun> runs;
        for (const std::vector<double>& unit : points) {
            double sum = -3;
            for (const double x : unit) sum += x;
            runs.push_back({unit, {1 / (1 + std::exp(-sum))}, {1e-9}});
        }
        waves[wave] = points;
        return runs;
    });
    const std::set<std::vector<double>> samples(result.posterior.begin(), result.posterior.end());
    ASSERT_LT(result.effective_samples, 8) << "else nothing is tested";
    const std::set<std::vector<double>> points(waves[4].begin(), waves[4].end());
    EXPECT_EQ(points.size(), waves[4].size());
    EXPECT_EQ(points.size(), std::min<std::size_t>(8, samples.size()));
    EXPECT_EQ(result.proof, points.size());
    EXPECT_EQ(result.targets[0].got_runs, points.size());
    FitOptions options;
    options.problem = problem;
    TargetCheck& one = result.targets[0];
    EXPECT_EQ(std::isnan(one.got_error), one.got_runs < 2);
    one.got_runs = 1;
    EXPECT_NE(fit_text(options, result).find("(one run)"), std::string::npos);
    one.got_runs = 0;
    EXPECT_NE(fit_text(options, result).find(" none\n"), std::string::npos);
}

TEST(Fit, FewerRunsThanAskedForAreSaidSo) {
    const FitProblem few{{kExt}, {{"cover", 0.3, 0.01}}, 9, 0, 1};
    try {
        fit(few, toy(few, 1));
        FAIL() << "9 runs of one parameter";
    } catch (const Error& error) {
        EXPECT_STREQ(error.what(), "9 runs are too few for 1 parameters: expected 10 or more");
    }
    const FitProblem enough{{kExt}, {{"cover", 0.3, 0.01}}, 10, 0, 1};
    FitResult result = fit(enough, toy(enough, 1));
    EXPECT_EQ(result.runs, 10u);
    FitOptions options;
    options.problem = enough;
    EXPECT_EQ(fit_text(options, result).find(" of 10 runs"), std::string::npos);
    result.runs = 7;
    EXPECT_NE(fit_text(options, result).find("warning: 7 of 10 runs: no more points were found"),
              std::string::npos);
    result.proof = 3;
    options.problem.proof = 8;
    EXPECT_NE(fit_text(options, result).find("warning: 3 of 8 fresh runs"), std::string::npos);
}

// A normal posterior over a box of some ten deviations: each point counts by its weight.
TEST(Fit, TellsHowManyPointsThePosteriorRestsOn) {
    const FitProblem problem{{kExt}, {{"cover", 0.3, 0.01}}, 32, 0, 1};
    FitResult result = fit(problem, toy(problem, 9));
    EXPECT_GT(result.effective_samples, 5000);
    EXPECT_LT(result.effective_samples, 32768);
    FitOptions options;
    options.problem = problem;
    EXPECT_EQ(fit_text(options, result).find("independent points"), std::string::npos);
    result.effective_samples = 37.4;
    EXPECT_NE(fit_text(options, result).find("warning: the posterior rests on 37 independent points"),
              std::string::npos);
}

TEST(Fit, TargetsOutOfReachAreSaidSo) {
    const FitProblem problem{{kExt}, {{"cover", 0.9, 0.01}}, 32, 0, 1};
    EXPECT_GT(fit(problem, toy(problem, 3)).implausibility, 3);
    const FitProblem none{{kExt}, {}, 32, 0, 1};
    EXPECT_THROW(fit(none, toy(none, 3)), Error);
    const FitProblem impossible{{kExt}, {{"cover", 1.2, 0.01}}, 32, 0, 1};
    EXPECT_THROW(fit(impossible, toy(impossible, 3)), Error);
    const Simulate lost = [](int, const std::vector<std::vector<double>>& points) {
        std::vector<FitRun> runs;
        for (const std::vector<double>& unit : points) runs.push_back({unit, {std::nan("")}, {0}});
        return runs;
    };
    EXPECT_THROW(fit(problem, lost), Error);
}

// A step along one of six coordinates: 64 values are too few for all products, and enough for the powers of that one. What the
// polynomial misses is more than the errors say, and stays in the variance.
TEST(Emulator, OneOfManyParametersHasAHighDegree) {
    std::vector<double> points = sobol_points(0, 64, 6, 1), values, errors(64, 1e-3);
    for (std::size_t n = 0; n < 64; ++n) values.push_back(std::tanh(6 * (points[6 * n + 2] - 0.5)));
    const Emulator emulator(points, values, errors, 6);
    EXPECT_EQ(emulator.degree(), 5);
    EXPECT_GT(emulator.misfit(), 0.01);
    EXPECT_LT(emulator.misfit(), 0.1);
    double squares = 0;
    const std::vector<double> fresh = sobol_points(64, 200, 6, 1);
    for (std::size_t n = 0; n < 200; ++n) {
        const Emulator::Prediction p = emulator.at(std::span(fresh).subspan(6 * n, 6));
        squares += std::pow(p.mean - std::tanh(6 * (fresh[6 * n + 2] - 0.5)), 2) / p.variance / 200;
    }
    EXPECT_GT(squares, 0.3);
    EXPECT_LT(squares, 3) << "8 without the misfit";
    // Errors that explain the scatter leave no misfit.
    const Emulator noisy(points, values, std::vector<double>(64, 0.5), 6);
    EXPECT_EQ(noisy.misfit(), 0);
}

TEST(Emulator, GivesBackACubic) {
    std::vector<double> points, values;
    for (int n = 0; n < 30; ++n) {
        const double x = n / 29.0;
        points.push_back(x);
        values.push_back(1 + x - 3 * x * x + 2 * x * x * x);
    }
    const Emulator emulator(points, values, {}, 1);
    EXPECT_GE(emulator.degree(), 3);
    const std::array<double, 1> at{0.37};
    EXPECT_NEAR(emulator.at(at).mean, 1 + 0.37 - 3 * 0.37 * 0.37 + 2 * 0.37 * 0.37 * 0.37, 1e-7);
    EXPECT_LT(emulator.noise(), 1e-6);
    EXPECT_THROW(Emulator(std::span(points).first(3), std::span(values).first(3), {}, 1), Error);
}

// The same cubic within a thousandth of the cube: the terms are of the box of the points, so they stay apart.
TEST(Emulator, IsAsExactInASmallBox) {
    for (const double width : {1e-3, 1e-6}) {
        const auto cubic = [&](double x) {
            const double u = (x - 0.7) / width;
            return 1 + u - 3 * u * u + 2 * u * u * u;
        };
        std::vector<double> points, values;
        for (int n = 0; n < 30; ++n) {
            points.push_back(0.7 + width * n / 29.0);
            values.push_back(cubic(points.back()));
        }
        const Emulator emulator(points, values, {}, 1);
        for (const double u : {0.1, 0.37, 0.9}) {
            const std::array<double, 1> at{0.7 + width * u};
            EXPECT_NEAR(emulator.at(at).mean, cubic(at[0]), 1e-6) << width;
        }
        EXPECT_EQ(emulator.left_out().size(), 30u);
    }
}

}  // namespace
}  // namespace nephos
