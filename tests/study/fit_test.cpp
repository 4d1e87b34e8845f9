// SPDX-License-Identifier: Apache-2.0

// Fits of a function whose answer is known: the cover of a scene without vapour, with noise.

#include "study/fit.h"

#include <array>
#include <cmath>
#include <random>

#include "study/emulator.h"
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

// Cover and lifetime in steps, as a run gives them.
Simulate toy(const FitProblem& problem, std::uint64_t seed, int* calls = nullptr) {
    auto random = std::make_shared<std::mt19937_64>(seed);
    return [=, &problem](int, const std::vector<std::vector<double>>& points) {
        std::normal_distribution<double> noise(0, kNoise);
        std::vector<FitRun> runs;
        for (const std::vector<double>& unit : points) {
            const double ext = parameter_value(problem.parameters[0], unit[0]);
            const double act =
                problem.parameters.size() > 1 ? parameter_value(problem.parameters[1], unit[1]) : 1e-3;
            const double c = null_cover(act, ext), logit = std::log(c / (1 - c)) + noise(*random);
            FitRun run{unit, {}, {}};
            for (const FitTarget& target : problem.targets) {
                run.statistics.push_back(target.statistic == "cover" ? 1 / (1 + std::exp(-logit))
                                                                     : std::exp(noise(*random)) * 10 / ext);
                run.errors.push_back(0);
            }
            runs.push_back(std::move(run));
            if (calls) ++*calls;
        }
        return runs;
    };
}

TEST(Fit, OneParameterIsFoundWithinHalfAPercentFrom64Runs) {
    const double truth = 0.05265;
    const FitProblem problem{{kExt}, {{"cover", null_cover(1e-3, truth), 1e-4}}, 64, 8, 1};
    int calls = 0;
    const FitResult result = fit(problem, toy(problem, 5, &calls));
    EXPECT_EQ(calls, 64 + 8);
    EXPECT_EQ(result.runs, 64u);
    EXPECT_NEAR(result.parameters[0].mean, truth, 0.005 * truth);
    EXPECT_LT(result.parameters[0].sd, 0.005 * truth);
    EXPECT_GT(result.directions[0].strength, 1);
    EXPECT_NEAR(result.targets[0].got, result.targets[0].target, 5 * result.targets[0].got_error);
    ASSERT_EQ(result.posterior.size(), 1000u);
    // Any eight rows are a sample: those of the proof are not all at one place.
    double low = 1, high = 0;
    for (std::size_t n = 0; n < 8; ++n) {
        low = std::min(low, result.posterior[(2 * n + 1) * 1000 / 16][0]);
        high = std::max(high, result.posterior[(2 * n + 1) * 1000 / 16][0]);
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
    // Along the ridge log act rises with log ext: equal amounts, in units of ranges log(15) and log(100).
    const std::vector<double>& free = result.directions[1].weights;
    EXPECT_NEAR(free[1] / free[0], std::log(15) / std::log(100), 0.1);
    double low = 1, high = 0;
    for (const std::vector<double>& sample : result.posterior) {
        EXPECT_NEAR(null_cover(sample[1], sample[0]), 0.3, 0.05);
        low = std::min(low, sample[0]);
        high = std::max(high, sample[0]);
    }
    EXPECT_LT(low, 0.03);
    EXPECT_GT(high, 0.2);
}

// 100 truths: the intervals of 90 % must hold about 90 of them, and the truth's rank among the samples be even.
TEST(Fit, IntervalsHoldTheTruthAsOftenAsTheySay) {
    std::mt19937_64 random(2);
    std::uniform_real_distribution<double> uniform(0.1, 0.9);
    std::normal_distribution<double> normal(0, 1);
    int inside = 0;
    std::array<int, 5> ranks{};
    for (int n = 0; n < 100; ++n) {
        const double truth = parameter_value(kExt, uniform(random)), cover = null_cover(1e-3, truth);
        // What is observed is off the truth by what the target's sd says.
        const double sd = 0.02 * cover, seen = cover + sd * normal(random);
        const FitProblem problem{{kExt}, {{"cover", seen, sd}}, 24, 0, 1};
        const FitResult result = fit(problem, toy(problem, 100 + std::uint64_t(n)));
        inside += truth > result.parameters[0].low && truth < result.parameters[0].high;
        std::size_t below = 0;
        for (const std::vector<double>& sample : result.posterior) below += sample[0] < truth;
        ++ranks[std::min<std::size_t>(4, below * 5 / result.posterior.size())];
    }
    EXPECT_GE(inside, 83);
    EXPECT_LE(inside, 96);
    double chi2 = 0;
    for (const int count : ranks) chi2 += (count - 20.0) * (count - 20.0) / 20;
    EXPECT_LT(chi2, 13.28) << "p = 0.01 at four degrees of freedom";
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

TEST(Emulator, GivesBackACubic) {
    std::vector<double> points, values;
    for (int n = 0; n < 30; ++n) {
        const double x = n / 29.0;
        points.push_back(x);
        values.push_back(1 + x - 3 * x * x + 2 * x * x * x);
    }
    const Emulator emulator(points, values, 1);
    EXPECT_GE(emulator.degree(), 3);
    const std::array<double, 1> at{0.37};
    EXPECT_NEAR(emulator.at(at).mean, 1 + 0.37 - 3 * 0.37 * 0.37 + 2 * 0.37 * 0.37 * 0.37, 1e-7);
    EXPECT_LT(emulator.noise(), 1e-6);
    EXPECT_THROW(Emulator(std::span(points).first(3), std::span(values).first(3), 1), Error);
}

}  // namespace
}  // namespace nephos
