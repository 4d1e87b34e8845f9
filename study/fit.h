// SPDX-License-Identifier: Apache-2.0
#pragma once

// Parameters found for targets, with their uncertainty and with what the targets leave free.
//
//     1. waves    half the runs at Sobol points of the prior, the others in two waves at points where the emulators hold the
//                 targets to be possible: implausibility |target - emulator| / sqrt(sd^2 + emulator's variance) <= 3 for
//                 every target (history matching: Vernon, Goldstein and Bower 2010). No point is run twice
//     2. emulator a polynomial for each target, of logit(x) for fractions and log(x) for sizes and times, from the runs in and
//                 about the region of the last wave
//     3. posterior prior x normal likelihood of the targets, with the emulator's variance, by importance sampling
//     4. proof    fresh runs at different points of the posterior: what the emulator promised, and what the simulation gave
//
// Uncertainty therefore has two parts: that of the targets, and that of the runs. More runs make only the second smaller.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "study/sweep_plan.h"

namespace nephos {

struct FitParameter {
    std::vector<std::string> keys;  // of the scene, moved together
    double from = 0, to = 1;        // uniform prior, on the scale
    Scale scale = Scale::linear;
};

struct FitTarget {
    std::string statistic;  // of kStatistics
    double value = 0, sd = 0;
    std::string from = {};  // the cloud mask that the value is of, the first of several; empty of a number
    // Values of that mask that are missing, and were taken as clear.
    std::uint64_t missing = 0;
};

struct FitProblem {
    std::vector<FitParameter> parameters;
    std::vector<FitTarget> targets;
    std::uint64_t runs = 64;  // without the proof
    std::uint64_t proof = 8;
    std::uint64_t seed = 1;
};

// A run at a point of the unit cube (the prior's ranges): its statistics in the order of the targets; NaN where it has none.
struct FitRun {
    std::vector<double> unit, statistics, errors;
    bool failed = false;  // it gave nothing, as its process ended
};

// Runs points, each once. `wave` is 1, 2, 3; 4 is the proof.
using Simulate = std::function<std::vector<FitRun>(int wave, const std::vector<std::vector<double>>& points)>;

struct ParameterEstimate {
    double mean, sd;
    double low, high;  // 5 and 95 % quantiles of the posterior
};

struct TargetCheck {
    double target, sd;
    double predicted, predicted_sd;  // by the emulator over the posterior; sd of its mean
    // Of the proof: the mean, NaN of no run, its standard error, NaN of fewer than two, and the runs that it is of.
    double got, got_error;
    std::uint64_t got_runs = 0;
};

// A combination of parameters, in units of their prior ranges.
struct Direction {
    std::vector<double> weights;  // of each parameter, length 1
    double strength = 0;  // prior sd over what the targets allow along it; above 1 it is fixed by them
};

struct FitResult {
    std::vector<ParameterEstimate> parameters;
    std::vector<TargetCheck> targets;
    std::vector<Direction> directions;           // strongest first
    std::vector<std::vector<double>> posterior;  // values of the parameters, 1,000 equally likely points
    // Without the proof: fewer than were asked for where no more points are possible. Lost: without a mean (not steady, or
    // failed).
    std::uint64_t runs = 0, lost = 0;
    std::uint64_t failed = 0;  // of all, those of the proof included
    std::uint64_t proof =
        0;  // different points of the posterior that were run afresh, at most as many as asked for
    std::vector<double> best;   // the parameters of the highest posterior density
    double implausibility = 0;  // of the best point; above 3 the targets cannot be met in the prior
    // Number of independent points that the weighted ones of the posterior are worth, (sum w)^2 / sum w^2; below 200 the
    // quantiles are rough.
    double effective_samples = 0;
    // Runs that met all targets within two standard deviations of both, where the emulators leave no posterior; and the
    // parameters of the closest.
    std::uint64_t left_out = 0;
    std::vector<double> left_out_at;
    std::vector<std::string>
        problems;  // of records in the folder of the fit that cannot be read (Records::problems())
};

// Returns how many runs a fit of so many parameters takes at least: half of them must give each emulator its first degree.
std::uint64_t fewest_runs(std::size_t parameters);

// Throws Error(usage) when more than half the runs have no mean, the problem has no parameter or target, or fewer runs than
// fewest_runs(). Pure but for `simulate`.
FitResult fit(const FitProblem& problem, const Simulate& simulate);

// Returns the value of a parameter at a place of its prior, 0..1.
double parameter_value(const FitParameter& parameter, double unit);

// A fit file: docs/research.md lists the keys.
struct FitOptions {
    SweepOptions base;  // scene, steps, overrides; no axes
    FitProblem problem;
    std::vector<std::string> notes;  // what is worth a look of the masks of targets: their sizes, missing values
};
// Reads one, its scene and its masks; `runs` in place of those that it asks for. Checks ends of priors and values of targets, and
// that the cells and the box of a mask are those of the scene where its statistic depends on them. Throws SceneErrors
// naming line and column, and Error(io).
FitOptions read_fit_file(const std::filesystem::path& path, std::optional<std::uint64_t> runs = {});

}  // namespace nephos
