// SPDX-License-Identifier: Apache-2.0

// Steady or not: processes whose answer is known.

#include "statistics/series.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include "statistics/cloud_statistics.h"
#include <gtest/gtest.h>

#include "automaton/automaton.h"

namespace nephos {
namespace {

// x' = mean + r (x - mean) + noise, of standard deviation `sd`.
std::vector<double> autoregressive(std::size_t steps, double mean, double r, double sd, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise(0, sd * std::sqrt(1 - r * r));
    std::vector<double> series;
    double x = sd * std::normal_distribution<double>()(random);
    for (std::size_t n = 0; n < steps; ++n) series.push_back(mean + (x = r * x + noise(random)));
    return series;
}

TEST(Series, IntegratedTimeOfAnAutoregressiveProcess) {
    for (const double r : {0.0, 0.5, 0.9}) {
        const std::vector<double> series = autoregressive(200'000, 0.3, r, 0.01, 11);
        const double tau = integrated_time(autocorrelation(series, 400));
        EXPECT_NEAR(tau, (1 + r) / (1 - r), 0.2 * (1 + r) / (1 - r)) << r;
    }
    const std::vector<double> constant(100, 0.5);
    EXPECT_EQ(integrated_time(autocorrelation(constant, 50)), 1);
}

// Pairs begin at lag 0: (1 + 0.5) + (-0.2 + 0.1), of which the second ends the sum.
TEST(Series, IntegratedTimeSumsPairsFromLagZero) {
    EXPECT_DOUBLE_EQ(integrated_time(std::vector<double>{1, 0.5, -0.2, 0.1, 0.05, -0.4}), 2);
    EXPECT_DOUBLE_EQ(integrated_time(std::vector<double>{1, 0.5, 0.2, -0.1, 0.1, -0.2}), 2 * (1.5 + 0.1) - 1);
    EXPECT_DOUBLE_EQ(integrated_time(std::vector<double>{1, -0.9, 0.8, -0.7, 0.6, -0.5}), 1);
}

// Lags are summed up 16 at a time; beyond the series there is nothing to sum.
TEST(Series, AutocorrelationMatchesSumsOfOneLag) {
    for (const std::size_t size : {2u, 3u, 15u, 16u, 17u, 18u, 31u, 32u, 33u, 34u, 100u}) {
        const std::vector<double> series = autoregressive(size, 0.3, 0.7, 0.02, size);
        const double mean = std::accumulate(series.begin(), series.end(), 0.0) / double(size);
        const auto sum_at = [&](std::size_t lag) {
            double sum = 0;
            for (std::size_t n = 0; n + lag < size; ++n) sum += (series[n] - mean) * (series[n + lag] - mean);
            return sum;
        };
        for (const std::size_t lags : {std::size_t(0), std::size_t(1), std::size_t(15), std::size_t(16),
                                       std::size_t(17), size - 1, size, size + 20}) {
            const std::vector<double> rho = autocorrelation(series, lags);
            ASSERT_EQ(rho.size(), lags + 1);
            for (std::size_t lag = 0; lag <= lags; ++lag)
                EXPECT_EQ(rho[lag], lag < size ? sum_at(lag) / sum_at(0) : 0)
                    << "size " << size << ", lag " << lag << " of " << lags;
        }
    }
}

// The time of a mean ends its lags where their sum ends: it is that of all lags, bit for bit.
TEST(Series, TimeOfAMeanIsThatOfAllLags) {
    std::size_t longest = 0;
    for (const double r : {-0.9, 0.0, 0.5, 0.9, 0.97, 0.999}) {
        for (const std::size_t size : {2u, 3u, 4u, 30u, 31u, 32u, 33u, 34u, 35u, 66u, 67u, 1000u}) {
            const std::vector<double> series = autoregressive(size, 0.3, r, 0.02, size);
            const SeriesMean mean = mean_over(series, {.regime = Regime::steady, .used = size});
            const std::vector<double> rho = autocorrelation(series, size / 2);
            EXPECT_EQ(mean.tau, integrated_time(rho)) << "r " << r << ", size " << size;
            std::size_t pair = 0;
            while (pair + 1 < rho.size() && rho[pair] + rho[pair + 1] > 0) pair += 2;
            longest = std::max(longest, pair);
        }
    }
    EXPECT_GT(longest, 48u) << "sums of several blocks of lags";
    const std::vector<double> constant(40, 0.5);
    EXPECT_EQ(mean_over(constant, {.regime = Regime::steady, .used = 40}).tau, 1);
}

// Every tenth step of a pulse of 84 steps: batches of eight values would walk through the pulse and call the beat an error.
TEST(Series, BatchesOfAPulseAreWholePeriods) {
    std::vector<double> sampled;
    std::mt19937_64 random(5);
    std::normal_distribution<double> noise(0, 0.002);
    const std::size_t period = 84, periods = 24;
    for (std::size_t step = 0; step < (periods + 2) * period; step += 10)
        sampled.push_back(0.2 + 0.15 * std::sin(2 * std::numbers::pi * double(step) / 84) + noise(random));
    const Judgement judgement{Regime::pulsing, 2 * period, periods * period, period, 0.9};
    const SeriesMean mean = mean_over(sampled, judgement, 10);
    EXPECT_NEAR(mean.mean, 0.2, 0.002);
    EXPECT_LT(mean.error, 0.001) << "0.0027 in batches of eight values";
    EXPECT_GT(mean.error, 1e-5);
}

// The error bar must mean what it says: of 400 series, 95 % lie within two errors, give or take.
TEST(Series, ErrorsCoverTheTruth) {
    int judged = 0, inside = 0;
    for (std::uint64_t seed = 1; seed <= 400; ++seed) {
        const std::vector<double> series = autoregressive(1500, 0.3, 0.8, 0.02, seed);
        const Judgement judgement = judge(series, true);
        if (judgement.regime != Regime::steady) continue;
        ++judged;
        const SeriesMean mean = mean_over(series, judgement);
        inside += std::abs(mean.mean - 0.3) < 1.96 * mean.error;
    }
    EXPECT_GT(judged, 360);
    EXPECT_GT(double(inside) / judged, 0.89);
    EXPECT_LT(double(inside) / judged, 0.99);
}

TEST(Series, WarmUpIsCutOff) {
    std::vector<double> series = autoregressive(1000, 0.3, 0.5, 0.01, 4);
    for (std::size_t n = 0; n < series.size(); ++n) series[n] -= 0.3 * std::exp(-double(n) / 20);
    const Judgement judgement = judge(series, true);
    EXPECT_EQ(judgement.regime, Regime::steady);
    EXPECT_GE(judgement.warm_up, 40u);
    EXPECT_LE(judgement.warm_up, 250u);
    const SeriesMean mean = mean_over(series, judgement);
    EXPECT_NEAR(mean.mean, 0.3, 4 * mean.error);
}

TEST(Series, RegimesAreToldApart) {
    EXPECT_EQ(judge(std::vector<double>(300, 0.0), true).regime, Regime::dead);
    EXPECT_EQ(judge(std::vector<double>{0.2, 0.1, 0}, false).regime, Regime::dead);
    EXPECT_EQ(judge(std::vector<double>{0.2, 0.1, 0}, true).regime, Regime::not_steady);
    EXPECT_EQ(judge(autoregressive(1000, 0.005, 0.5, 0.0005, 1), true).regime, Regime::sparse);
    EXPECT_EQ(judge(autoregressive(1000, 0.97, 0.5, 0.003, 1), true).regime, Regime::overcast);
    EXPECT_EQ(judge(std::vector<double>(300, 1.0), true).regime, Regime::overcast);
    std::vector<double> drift = autoregressive(1000, 0.3, 0.5, 0.01, 2);
    for (std::size_t n = 0; n < drift.size(); ++n) drift[n] += 1e-4 * double(n);
    EXPECT_EQ(judge(drift, true).regime, Regime::not_steady);
    EXPECT_TRUE(std::isnan(mean_over(drift, judge(drift, true)).mean));
    // Too short for its memory: 300 steps of a process with tau = 199.
    EXPECT_EQ(judge(autoregressive(300, 0.3, 0.99, 0.02, 3), true).regime, Regime::not_steady);
}

TEST(Series, PulsesAreAveragedOverWholePeriods) {
    const auto pulses = [](std::size_t steps) {
        std::vector<double> series = autoregressive(steps, 0, 0.5, 0.01, 9);
        for (std::size_t n = 0; n < steps; ++n)
            series[n] += 0.2 + 0.15 * std::sin(2 * std::numbers::pi * double(n) / 84);
        return series;
    };
    const Judgement long_enough = judge(pulses(1000), true);
    EXPECT_EQ(long_enough.regime, Regime::pulsing);
    EXPECT_NEAR(double(long_enough.period), 84, 2);
    EXPECT_NEAR(mean_over(pulses(1000), long_enough).mean, 0.2, 0.003);
    EXPECT_EQ(judge(pulses(300), true).regime, Regime::not_steady) << "three periods tell nothing";
}

std::vector<double> cover_of_trap(std::uint64_t seed, int steps) {
    AutomatonOptions options;
    options.extent = {256, 128, 20};
    options.boundaries = {Boundary::periodic, Boundary::periodic, Boundary::open};
    options.field.background = {0.003, 1e-6, 0.12};
    options.initial = InitialState::empty;
    options.seed = seed;
    Automaton automaton(options);
    std::vector<double> cover;
    for (int n = 0; n <= steps; ++n) {
        if (n > 0) automaton.step();
        cover.push_back(double(count_cloud(automaton.cld(), options.boundaries).columns) / (256 * 128));
    }
    return cover;
}

// All humid air of this scene fires together, every 84 to 95 steps, in phase in every seed: five seeds of 300 steps agree
// on 0.164 +- 0.003, which is 23 of their standard errors away from the truth, 0.244.
TEST(Series, TheTrapIsNotAveragedInSilence) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
        const std::vector<double> cover = cover_of_trap(seed, 300);
        const Judgement judgement = judge(cover, true);
        EXPECT_EQ(judgement.regime, Regime::not_steady) << "seed " << seed;
        EXPECT_TRUE(std::isnan(mean_over(cover, judgement).mean));
    }
    const std::vector<double> cover = cover_of_trap(1, 3000);
    const Judgement judgement = judge(cover, true);
    EXPECT_EQ(judgement.regime, Regime::pulsing);
    EXPECT_GE(judgement.period, 80u);
    EXPECT_LE(judgement.period, 100u);
    EXPECT_NEAR(mean_over(cover, judgement).mean, 0.244, 0.01);
}

}  // namespace
}  // namespace nephos
