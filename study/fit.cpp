// SPDX-License-Identifier: Apache-2.0
#include "study/fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "study/cloud_mask.h"
#include "study/emulator.h"
#include "study/run_statistics.h"
#include "study/toml_table.h"
#include <Eigen/Dense>
#include <fmt/format.h>

#include "core/error.h"
#include "simulation/layer_simulation.h"

namespace nephos {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kImplausible = 3;
constexpr std::uint64_t kCandidates = 4096;
constexpr std::size_t kSamples = 1000;
constexpr double kPriorDeviation = 0.28867513459481287;  // of a uniform number

enum class Transform { identity, log, logit };

Transform transform_of(const std::string& statistic) {
    if (statistic == "cover" || statistic.ends_with("_fraction")) return Transform::logit;
    if (statistic.ends_with("_exponent") || statistic == "size_exponent_line" || statistic == "overlap" ||
        statistic.ends_with("_dimension"))
        return Transform::identity;
    return Transform::log;
}

double forward(Transform transform, double x) {
    if (transform == Transform::log) return x > 0 ? std::log(x) : kNaN;
    if (transform == Transform::logit) return x > 0 && x < 1 ? std::log(x / (1 - x)) : kNaN;
    return x;
}

double backward(Transform transform, double z) {
    if (transform == Transform::log) return std::exp(z);
    if (transform == Transform::logit) return 1 / (1 + std::exp(-z));
    return z;
}

double slope(Transform transform, double x) {
    if (transform == Transform::log) return 1 / x;
    if (transform == Transform::logit) return 1 / (x * (1 - x));
    return 1;
}

// A part of the unit cube.
struct Box {
    std::vector<double> low, high;
    explicit Box(std::size_t d) : low(d, 0.0), high(d, 1.0) {}
    bool holds(const std::vector<double>& point) const {
        for (std::size_t n = 0; n < point.size(); ++n)
            if (point[n] < low[n] || point[n] > high[n]) return false;
        return true;
    }
    std::vector<std::vector<double>> points(std::uint64_t count) const {
        const std::vector<double> unit = unit_points(Design::sobol, count, low.size(), 0);
        std::vector<std::vector<double>> all(count, std::vector<double>(low.size()));
        for (std::uint64_t n = 0; n < count; ++n)
            for (std::size_t d = 0; d < low.size(); ++d)
                all[n][d] = low[d] + unit[n * low.size() + d] * (high[d] - low[d]);
        return all;
    }
    // Grows by a factor about its middle, within the cube.
    Box grown(double factor) const {
        Box box = *this;
        for (std::size_t d = 0; d < low.size(); ++d) {
            const double more = (factor - 1) / 2 * (high[d] - low[d]);
            box.low[d] = std::max(0.0, low[d] - more);
            box.high[d] = std::min(1.0, high[d] + more);
        }
        return box;
    }
};

class Fitter {
  public:
    Fitter(const FitProblem& problem, const Simulate& simulate)
        : problem_(problem), simulate_(simulate), dimensions_(problem.parameters.size()), box_(dimensions_) {
        if (problem.parameters.empty() || problem.targets.empty())
            throw Error(ErrorCode::usage, "a fit needs a parameter and a target");
        for (const FitTarget& target : problem.targets) {
            transforms_.push_back(transform_of(target.statistic));
            z_.push_back(forward(transforms_.back(), target.value));
            sd_.push_back(slope(transforms_.back(), target.value) * target.sd);
            if (!std::isfinite(z_.back()) || !(target.sd > 0))
                throw Error(ErrorCode::usage, fmt::format("target {}: {} +- {} is not possible",
                                                          target.statistic, target.value, target.sd));
        }
    }

    FitResult result() {
        const std::uint64_t first = std::max<std::uint64_t>(problem_.runs / 2, dimensions_ + 4);
        run_wave(1, box_.points(first));
        for (int wave = 2; wave <= 3; ++wave) {
            const std::uint64_t left =
                problem_.runs > runs_.size() + lost_ ? problem_.runs - runs_.size() - lost_ : 0;
            const std::uint64_t count = wave == 2 ? left / 2 : left;
            narrow();
            if (count > 0) run_wave(wave, box_.points(count));
        }
        emulate();
        FitResult result = posterior();
        result.runs = runs_.size() + lost_;
        result.lost = lost_;
        prove(result);
        for (std::vector<double>& sample : result.posterior) sample = values_of(sample);
        result.best = values_of(result.best);
        return result;
    }

  private:
    void run_wave(int wave, const std::vector<std::vector<double>>& points) {
        for (FitRun& run : simulate_(wave, points)) {
            bool whole = true;
            for (std::size_t n = 0; n < z_.size(); ++n) {
                run.statistics[n] = forward(transforms_[n], run.statistics[n]);
                whole = whole && std::isfinite(run.statistics[n]);
            }
            if (whole) {
                runs_.push_back(std::move(run));
            } else {
                ++lost_;
            }
        }
        if (lost_ > runs_.size())
            throw Error(
                ErrorCode::usage,
                fmt::format(
                    "{} of {} runs have no mean of every target (not steady, dead or failed): give more "
                    "steps, or a prior without the regimes that jump",
                    lost_, lost_ + runs_.size()));
        emulate();
    }

    // From the runs in the region of the last wave, where they are enough, else from all.
    void emulate() {
        std::vector<const FitRun*> used;
        for (const FitRun& run : runs_)
            if (box_.holds(run.unit)) used.push_back(&run);
        if (used.size() < 3 * (1 + 2 * dimensions_)) {
            used.clear();
            for (const FitRun& run : runs_) used.push_back(&run);
        }
        emulators_.clear();
        for (std::size_t n = 0; n < z_.size(); ++n) {
            std::vector<double> points, values;
            for (const FitRun* run : used) {
                points.insert(points.end(), run->unit.begin(), run->unit.end());
                values.push_back(run->statistics[n]);
            }
            emulators_.emplace_back(points, values, dimensions_);
        }
    }

    double implausibility(const std::vector<double>& point) const {
        double worst = 0;
        for (std::size_t n = 0; n < z_.size(); ++n) {
            const Emulator::Prediction p = emulators_[n].at(point);
            worst = std::max(worst, std::abs(z_[n] - p.mean) / std::sqrt(sd_[n] * sd_[n] + p.variance));
        }
        return worst;
    }

    double log_likelihood(const std::vector<double>& point) const {
        double sum = 0;
        for (std::size_t n = 0; n < z_.size(); ++n) {
            const Emulator::Prediction p = emulators_[n].at(point);
            const double variance = sd_[n] * sd_[n] + p.variance;
            sum -= (z_[n] - p.mean) * (z_[n] - p.mean) / variance / 2 + std::log(variance) / 2;
        }
        return sum;
    }

    // The box around the points that are kept, in a few rounds of ever finer Sobol points. Two more spacings on every side,
    // so that nothing is cut off between points.
    template <typename Keep>
    Box zoomed(Box box, Keep&& keep) const {
        for (int round = 0; round < 8; ++round) {
            const std::vector<std::vector<double>> points = box.points(kCandidates);
            const std::vector<bool> kept = keep(points);
            Box next(dimensions_);
            bool any = false;
            for (std::size_t d = 0; d < dimensions_; ++d) {
                double low = 1, high = 0;
                for (std::size_t n = 0; n < points.size(); ++n) {
                    if (!kept[n]) continue;
                    any = true;
                    low = std::min(low, points[n][d]);
                    high = std::max(high, points[n][d]);
                }
                const double spacing =
                    (box.high[d] - box.low[d]) * 2 / std::pow(double(kCandidates), 1.0 / double(dimensions_));
                next.low[d] = std::max(box.low[d], low - spacing);
                next.high[d] = std::min(box.high[d], high + spacing);
            }
            if (!any) return box;
            double ratio = 1;
            for (std::size_t d = 0; d < dimensions_; ++d)
                ratio *= (next.high[d] - next.low[d]) / (box.high[d] - box.low[d]);
            box = next;
            if (ratio > 0.5) break;
        }
        return box;
    }

    // Where the targets are possible, three times as wide: a slope needs a distance.
    void narrow() {
        const Box possible = zoomed(Box(dimensions_), [&](const std::vector<std::vector<double>>& points) {
            std::vector<double> values;
            for (const std::vector<double>& point : points) values.push_back(implausibility(point));
            // Where nothing is possible, what comes closest is looked at.
            const double limit = std::max(kImplausible, 1.5 * *std::ranges::min_element(values));
            std::vector<bool> kept;
            for (const double value : values) kept.push_back(value <= limit);
            return kept;
        });
        box_ = possible.grown(3);
    }

    FitResult posterior() {
        const Box box = zoomed(Box(dimensions_), [&](const std::vector<std::vector<double>>& points) {
            std::vector<double> values;
            for (const std::vector<double>& point : points) values.push_back(log_likelihood(point));
            const double limit = *std::ranges::max_element(values) - 12;
            std::vector<bool> kept;
            for (const double value : values) kept.push_back(value >= limit);
            return kept;
        });
        const std::vector<std::vector<double>> points = box.points(8 * kCandidates);
        std::vector<double> weights;
        for (const std::vector<double>& point : points) weights.push_back(log_likelihood(point));
        const std::size_t best = std::size_t(std::ranges::max_element(weights) - weights.begin());
        const double largest = weights[best];
        for (double& weight : weights) weight = std::exp(weight - largest);
        FitResult result;
        result.best = points[best];
        result.implausibility = implausibility(points[best]);
        // Systematic resampling: sample n is where the sum of weights passes (n + 1/2) / kSamples.
        const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
        double sum = 0;
        std::size_t at = 0;
        for (std::size_t n = 0; n < kSamples; ++n) {
            const double place = (double(n) + 0.5) / double(kSamples) * total;
            while (at + 1 < points.size() && sum + weights[at] < place) sum += weights[at++];
            result.posterior.push_back(points[at]);
        }
        // In random order: Sobol points that are a power of two apart lie close together, and so would every hundredth.
        std::vector<double> keys = unit_points(Design::random, kSamples, 1, problem_.seed);
        for (std::size_t n = kSamples; n > 1; --n)
            std::swap(result.posterior[n - 1], result.posterior[std::size_t(keys[n - 1] * double(n))]);
        estimate(points, weights, total, result);
        return result;
    }

    std::vector<double> values_of(const std::vector<double>& unit) const {
        std::vector<double> values;
        for (std::size_t d = 0; d < dimensions_; ++d)
            values.push_back(parameter_value(problem_.parameters[d], unit[d]));
        return values;
    }

    void estimate(const std::vector<std::vector<double>>& points, const std::vector<double>& weights,
                  double total, FitResult& result) const {
        std::vector<double> centre(dimensions_);
        for (std::size_t d = 0; d < dimensions_; ++d) {
            std::vector<std::pair<double, double>> sorted;
            double mean = 0, square = 0;
            for (std::size_t n = 0; n < points.size(); ++n) {
                const double value = parameter_value(problem_.parameters[d], points[n][d]);
                sorted.emplace_back(value, weights[n]);
                mean += weights[n] * value / total;
                centre[d] += weights[n] * points[n][d] / total;
            }
            for (const auto& [value, weight] : sorted)
                square += weight * (value - mean) * (value - mean) / total;
            std::ranges::sort(sorted);
            const auto quantile = [&](double q) {
                double sum = 0;
                for (const auto& [value, weight] : sorted)
                    if ((sum += weight) >= q * total) return value;
                return sorted.back().first;
            };
            result.parameters.push_back({mean, std::sqrt(square), quantile(0.05), quantile(0.95)});
        }
        for (std::size_t n = 0; n < z_.size(); ++n) {
            double mean = 0, variance = 0;
            for (std::size_t p = 0; p < points.size(); ++p) {
                const Emulator::Prediction prediction = emulators_[n].at(points[p]);
                mean += weights[p] * backward(transforms_[n], prediction.mean) / total;
                variance += weights[p] * prediction.variance / total;
            }
            const FitTarget& target = problem_.targets[n];
            result.targets.push_back({target.value, target.sd, mean,
                                      std::sqrt(variance) / slope(transforms_[n], mean), kNaN, kNaN});
        }
        directions(result.best, result);
    }

    // Singular vectors of the Jacobian at the best point, its rows in units of what each target allows.
    void directions(const std::vector<double>& centre, FitResult& result) const {
        Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(Eigen::Index(z_.size()), Eigen::Index(dimensions_));
        for (std::size_t n = 0; n < z_.size(); ++n) {
            const double scale = std::sqrt(sd_[n] * sd_[n] + emulators_[n].at(centre).variance);
            for (std::size_t d = 0; d < dimensions_; ++d) {
                std::vector<double> low = centre, high = centre;
                low[d] -= 1e-4;
                high[d] += 1e-4;
                jacobian(Eigen::Index(n), Eigen::Index(d)) =
                    (emulators_[n].at(high).mean - emulators_[n].at(low).mean) / 2e-4 / scale;
            }
        }
        const Eigen::JacobiSVD<Eigen::MatrixXd> svd(jacobian, Eigen::ComputeFullV);
        for (std::size_t d = 0; d < dimensions_; ++d) {
            Direction direction;
            if (d < std::size_t(svd.singularValues().size()))
                direction.strength = svd.singularValues()[Eigen::Index(d)] * kPriorDeviation;
            const Eigen::VectorXd v = svd.matrixV().col(Eigen::Index(d));
            const double sign = v[0] < 0 ? -1 : 1;
            for (std::size_t n = 0; n < dimensions_; ++n)
                direction.weights.push_back(sign * v[Eigen::Index(n)]);
            result.directions.push_back(std::move(direction));
        }
    }

    void prove(FitResult& result) {
        if (problem_.proof == 0) return;
        std::vector<std::vector<double>> points;
        for (std::uint64_t n = 0; n < problem_.proof; ++n)
            points.push_back(result.posterior[(2 * n + 1) * result.posterior.size() / (2 * problem_.proof)]);
        const std::vector<FitRun> runs = simulate_(4, points);
        for (std::size_t n = 0; n < z_.size(); ++n) {
            double sum = 0, squares = 0, count = 0;
            for (const FitRun& run : runs) {
                if (!std::isfinite(run.statistics[n])) continue;
                sum += run.statistics[n];
                squares += run.statistics[n] * run.statistics[n];
                ++count;
            }
            if (count < 1) continue;
            result.targets[n].got = sum / count;
            if (count > 1)
                result.targets[n].got_error =
                    std::sqrt(std::max(0.0, squares - sum * sum / count) / (count - 1) / count);
        }
    }

    const FitProblem& problem_;
    const Simulate& simulate_;
    std::size_t dimensions_;
    Box box_;
    std::vector<Transform> transforms_;
    std::vector<double> z_, sd_;  // targets and their sd, transformed
    std::vector<FitRun> runs_;    // statistics transformed
    std::uint64_t lost_ = 0;
    std::vector<Emulator> emulators_;
};

}  // namespace

double parameter_value(const FitParameter& parameter, double unit) {
    if (parameter.scale == Scale::log) return parameter.from * std::pow(parameter.to / parameter.from, unit);
    return parameter.from + unit * (parameter.to - parameter.from);
}

FitResult fit(const FitProblem& problem, const Simulate& simulate) {
    return Fitter(problem, simulate).result();
}

namespace {

// A target that a cloud mask gives: its value, and the standard error of it where the file does not say another sd.
void read_target_mask(TomlTable& target, const std::filesystem::path& folder, FitTarget& to) {
    constexpr double kLargest = std::numeric_limits<double>::max(),
                     kSmallest = std::numeric_limits<double>::min();
    MaskOptions mask;
    const std::string file = target.text("from").value_or("");
    mask.variable = target.text("variable").value_or("");
    mask.threshold = target.number("threshold", -kLargest, kLargest);
    mask.cell_size_m = target.number("cell_size_m", kSmallest, kLargest);
    mask.level_height_m = target.number("level_height_m", kSmallest, kLargest);
    for (const std::string& axis : target.texts("periodic")) {
        if (axis != "x" && axis != "y")
            target.report("periodic", "'" + axis + "' is no axis of a mask",
                          "expected periodic = [\"x\", \"y\"]");
        (axis == "x" ? mask.boundaries.x : mask.boundaries.y) = Boundary::periodic;
    }
    const std::optional<double> sd = target.number("sd", kSmallest, kLargest);
    if (target.has("value"))
        target.report("value", "a target has both value and from", "expected one of them");
    SeriesMean mean{};
    try {
        mean = mask_statistics(read_masks({folder / file}, mask)).statistics[statistic_index(to.statistic)];
    } catch (const Error& error) {
        target.report("from", error.what(), "expected a cloud mask: .vdb, .nc or .png");
        return;
    }
    to.value = mean.mean;
    to.sd = sd.value_or(mean.error);
    if (!std::isfinite(to.value))
        target.report("from", fmt::format("{} has no value of `{}`", file, to.statistic),
                      "expected another statistic");
    else if (!(to.sd > 0))
        target.report("from", fmt::format("{} does not say how uncertain its `{}` is", file, to.statistic),
                      "expected sd = ... beside it: a single snapshot has no standard error");
}

}  // namespace

FitOptions read_fit_file(const std::filesystem::path& path) {
    constexpr double kLargest = std::numeric_limits<double>::max();
    FitOptions options;
    options.base.replicates = 1;
    read_toml_file(path, [&](TomlTable& table) {
        if (!table.has("scene"))
            table.report("scene", "the fit has no scene", "expected scene = \"FILE.toml\"");
        options.base.scene_file = path.parent_path() / table.text("scene").value_or("");
        options.base.overrides = table.texts("set");
        options.base.layer = table.text("layer").value_or("");
        options.base.clouds_every = int(
            table.integer("clouds_every", 0, 1'000'000).value_or(std::uint64_t(options.base.clouds_every)));
        options.problem.runs = table.integer("runs", 8, 1'000'000).value_or(options.problem.runs);
        options.problem.proof = table.integer("proof", 0, 1'000'000).value_or(options.problem.proof);
        options.problem.seed = table.integer("seed", 0, std::numeric_limits<std::int64_t>::max()).value_or(1);
        options.base.seed = options.problem.seed;
        table.table("steps", [&](TomlTable& steps) {
            StepRules& rules = options.base.steps;
            rules.min = steps.integer("min", 20, kMaxSteps).value_or(rules.min);
            rules.max = steps.integer("max", rules.min, kMaxSteps).value_or(std::max(rules.min, rules.max));
        });
        table.tables("parameter", [&](TomlTable& parameter) {
            FitParameter& to = options.problem.parameters.emplace_back();
            if (const auto key = parameter.text("key")) to.keys = {*key};
            for (std::string& key : parameter.texts("keys")) to.keys.push_back(std::move(key));
            if (to.keys.empty())
                parameter.report("key", "a parameter has no key", "expected key = \"field.background.ext\"");
            bool has_prior = false;
            parameter.table("prior", [&](TomlTable& prior) {
                has_prior = true;
                to.from = prior.number("from", -kLargest, kLargest).value_or(0);
                to.to = prior.number("to", -kLargest, kLargest).value_or(1);
                to.scale =
                    prior.word("scale", {"linear", "log"}).value_or(0) == 1 ? Scale::log : Scale::linear;
                if (!(to.to > to.from) || (to.scale == Scale::log && !(to.from > 0)))
                    prior.report("to", "the prior is empty",
                                 "expected `to` above `from`, and both above 0 on a log scale");
            });
            if (!has_prior)
                parameter.report("prior", "a parameter has no prior",
                                 "expected prior = { from = 0.03, to = 0.4, scale = \"log\" }");
        });
        if (options.problem.parameters.empty())
            table.report("parameter", "the fit has no parameter", "expected a table [[parameter]]");
        table.tables("target", [&](TomlTable& target) {
            FitTarget& to = options.problem.targets.emplace_back();
            std::vector<std::string_view> names;
            for (const StatisticInfo& info : kStatistics) names.push_back(info.name);
            to.statistic = names[target.word("statistic", names).value_or(0)];
            if (target.has("from")) {
                read_target_mask(target, path.parent_path(), to);
                return;
            }
            if (!target.has("statistic") || !target.has("value") || !target.has("sd"))
                target.report(
                    "statistic", "a target needs statistic, and value and sd or from",
                    "expected statistic = \"cover\", value = 0.3, sd = 0.015, or from = \"observed.nc\"");
            to.value = target.number("value", -kLargest, kLargest).value_or(0);
            to.sd = target.number("sd", std::numeric_limits<double>::min(), kLargest).value_or(1);
        });
        if (options.problem.targets.empty())
            table.report("target", "the fit has no target", "expected a table [[target]]");
    });
    return options;
}

}  // namespace nephos
