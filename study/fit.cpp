// SPDX-License-Identifier: Apache-2.0
#include "study/fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <set>

#include "study/design.h"
#include "study/emulator.h"
#include "study/target_match.h"
#include "study/transform.h"
#include "study/unit_box.h"
#include <Eigen/Dense>
#include <fmt/format.h>

#include "core/error.h"
#include "core/math.h"

namespace nephos {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kImplausible = 3;
constexpr std::uint64_t kCandidates = 4096;
constexpr std::size_t kSamples = 1000;
constexpr int kMostBatches = 16;
constexpr double kEarned = 0.95;  // of the error: what a larger region must earn its place with
constexpr double kPriorDeviation = 0.28867513459481287;  // of a uniform number

// The number of equally likely points that tell as much as points of these weights (Kong 1992).
double effective_number(const std::vector<double>& weights) {
    double sum = 0, squares = 0;
    for (const double weight : weights) {
        sum += weight;
        squares += weight * weight;
    }
    return sum * sum / squares;
}

class Fitter {
  public:
    Fitter(const FitProblem& problem, const Simulate& simulate)
        : problem_(problem),
          simulate_(simulate),
          dimensions_(problem.parameters.size()),
          looked_at_(dimensions_),
          box_(dimensions_) {
        if (problem.parameters.empty() || problem.targets.empty())
            throw Error(ErrorCode::usage, "a fit needs a parameter and a target");
        if (problem.runs < fewest_runs(dimensions_))
            throw Error(ErrorCode::usage,
                        fmt::format("{} runs are too few for {} parameters: expected {} or more",
                                    problem.runs, dimensions_, fewest_runs(dimensions_)));
        for (const FitTarget& target : problem.targets) {
            without_.push_back(0);
            transforms_.push_back(transform_of(target.statistic));
            if (!std::isfinite(forward(transforms_.back(), target.value)) || !(target.sd > 0))
                throw Error(ErrorCode::usage, fmt::format("target {}: {} +- {} is not possible",
                                                          target.statistic, target.value, target.sd));
        }
    }

    FitResult result() {
        run_wave(1, take(box_, problem_.runs / 2));
        for (int wave = 2; wave <= 3; ++wave) {
            const std::uint64_t left = problem_.runs > tried_.size() ? problem_.runs - tried_.size() : 0;
            const std::uint64_t count = wave == 2 ? left / 2 : left;
            const std::vector<Point> points = narrow(count);
            if (!points.empty()) run_wave(wave, points);
        }
        FitResult result = posterior();
        result.runs = runs_.size() + lost_;
        result.lost = lost_;
        result.failed = failed_;
        prove(result);
        for (std::vector<double>& sample : result.posterior) sample = values_of(sample);
        result.best = values_of(result.best);
        return result;
    }

  private:
    // The next points of the one Sobol sequence of the fit, in a box: no two calls give the same ones.
    std::vector<Point> take(const UnitBox& box, std::uint64_t count) {
        const std::vector<double> unit = sobol_points(taken_, count, dimensions_, problem_.seed);
        taken_ += count;
        return points_of(box, unit);
    }

    static std::vector<Point> points_of(const UnitBox& box, const std::vector<double>& unit) {
        const std::size_t dimensions = box.low.size();
        std::vector<Point> points(unit.size() / dimensions, Point(dimensions));
        for (std::size_t n = 0; n < points.size(); ++n)
            for (std::size_t d = 0; d < dimensions; ++d)
                points[n][d] = box.low[d] + unit[n * dimensions + d] * (box.high[d] - box.low[d]);
        return points;
    }

    void run_wave(int wave, const std::vector<Point>& points) {
        tried_.insert(points.begin(), points.end());
        for (FitRun& run : simulate_(wave, points)) {
            failed_ += run.failed;
            bool whole = true;
            for (std::size_t n = 0; n < transforms_.size(); ++n) {
                run.errors[n] *= slope(transforms_[n], run.statistics[n]);
                run.statistics[n] = forward(transforms_[n], run.statistics[n]);
                without_[n] += !std::isfinite(run.statistics[n]);
                whole = whole && std::isfinite(run.statistics[n]);
            }
            if (whole) {
                runs_.push_back(std::move(run));
            } else {
                ++lost_;
            }
        }
        if (lost_ > runs_.size() || (lost_ > 0 && runs_.size() < dimensions_ + 3)) throw_lost();
        emulate();
    }

    [[noreturn]] void throw_lost() const {
        std::string targets;
        for (std::size_t n = 0; n < without_.size(); ++n)
            if (without_[n] > 0)
                targets += fmt::format("{}`{}` in {}", targets.empty() ? "" : ", ",
                                       problem_.targets[n].statistic, without_[n]);
        throw Error(
            ErrorCode::usage,
            fmt::format(
                "{} of {} runs have no mean of every target, or none that can be a target's (not "
                "steady, dead, overcast or failed): {}; give more steps, a prior without the "
                "regimes that jump, or another target{}",
                lost_, lost_ + runs_.size(), targets,
                failed_ == 0
                    ? ""
                    : fmt::format("; {} of them failed (failures.csv), and --retry-failed runs these again",
                                  failed_)));
    }

    void emulate() {
        emulators_.clear();
        for (std::size_t n = 0; n < transforms_.size(); ++n) emulators_.push_back(emulator_of(n));
    }

    // From the runs of the region, or of ever larger ones about it: more runs know the slope better, but one polynomial may not
    // do for all of them. The one is taken that foretells best the runs of the region itself, and knows most about all of what
    // is looked at. No emulator is asked beyond its runs, where a polynomial bends away.
    Emulator emulator_of(std::size_t target) const {
        const std::size_t enough = 3 * (1 + 2 * dimensions_);
        const std::vector<Point> places =
            points_of(looked_at_, sobol_points(0, 64, dimensions_, problem_.seed));
        std::optional<Emulator> best;
        double least = std::numeric_limits<double>::infinity();
        const bool any_inside =
            std::ranges::any_of(runs_, [&](const FitRun& r) { return box_.holds(r.unit); });
        for (UnitBox box = box_;; box = box.grown(2)) {
            std::vector<double> points, values, errors;
            std::vector<bool> inside;
            for (const FitRun& run : runs_) {
                if (!box.holds(run.unit)) continue;
                points.insert(points.end(), run.unit.begin(), run.unit.end());
                values.push_back(run.statistics[target]);
                errors.push_back(run.errors[target]);
                inside.push_back(!any_inside || box_.holds(run.unit));
            }
            if ((values.size() >= enough && surround(points, looked_at_)) || box.is_whole()) {
                Emulator emulator(points, values, errors, dimensions_);
                double error = 0, leverage = 0;
                for (std::size_t n = 0; n < values.size(); ++n)
                    if (inside[n]) error += emulator.left_out()[n] * emulator.left_out()[n];
                for (const Point& place : places)
                    leverage += emulator.leverage(place) / double(places.size());
                error *= 1 + leverage;
                if (!best || error < kEarned * least) {
                    least = error;
                    best = std::move(emulator);
                }
            }
            if (box.is_whole()) return std::move(*best);
        }
    }

    TargetMatch match_of(std::size_t target, const std::vector<double>& point) const {
        const FitTarget& wanted = problem_.targets[target];
        return match(transforms_[target], emulators_[target].at(point), {wanted.value, wanted.sd});
    }

    double implausibility(const std::vector<double>& point) const {
        double worst = 0;
        for (std::size_t n = 0; n < transforms_.size(); ++n)
            worst = std::max(worst, match_of(n, point).distance);
        return worst;
    }

    double log_likelihood(const std::vector<double>& point) const {
        double sum = 0;
        for (std::size_t n = 0; n < transforms_.size(); ++n) {
            const FitTarget& wanted = problem_.targets[n];
            sum += nephos::log_likelihood(transforms_[n], emulators_[n].at(point), {wanted.value, wanted.sd});
        }
        return sum;
    }

    // The box around the points that are kept, in a few rounds of ever finer Sobol points. Two more spacings on every side, so
    // that nothing is cut off between points.
    template <typename Keep>
    UnitBox zoomed(Keep&& keep) {
        UnitBox box = looked_at_;
        for (int round = 0; round < 8; ++round) {
            const std::vector<Point> points = take(box, kCandidates);
            const std::vector<bool> kept = keep(points);
            UnitBox next(dimensions_);
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

    // Looks only where the targets are possible from now on, and returns the points of the next wave, all of them possible.
    // The emulators are of a region three times as wide: a slope needs a distance.
    std::vector<Point> narrow(std::uint64_t count) {
        double limit = kImplausible;
        const UnitBox possible = zoomed([&](const std::vector<Point>& points) {
            std::vector<double> values;
            for (const Point& point : points) values.push_back(implausibility(point));
            // Where nothing is possible, what comes closest is looked at.
            limit = std::max(kImplausible, 1.5 * *std::ranges::min_element(values));
            std::vector<bool> kept;
            for (const double value : values) kept.push_back(value <= limit);
            return kept;
        });
        std::vector<Point> points = proposals(possible, limit, count);
        looked_at_ = possible.grown(2);
        box_ = possible.grown(3);
        return points;
    }

    // Up to `count` points of a box that were not run and are not implausible: Sobol points, and where few of them are, as on
    // a ridge through a box of many dimensions, also points ever closer to those that were found.
    std::vector<Point> proposals(const UnitBox& box, double limit, std::uint64_t count) {
        std::vector<Point> found;
        std::set<Point> known;
        const auto add = [&](const std::vector<Point>& points) {
            for (const Point& point : points) {
                if (found.size() == count) return;
                if (implausibility(point) <= limit && !tried_.contains(point) && known.insert(point).second)
                    found.push_back(point);
            }
        };
        for (int batch = 0; batch < kMostBatches && found.size() < count; ++batch)
            add(take(box, kCandidates));
        const std::vector<Point> centres = found;
        for (double share = 0.5; share > 1e-9 && found.size() < count && !centres.empty(); share /= 2) {
            for (const Point& centre : centres) {
                UnitBox near(dimensions_);
                for (std::size_t d = 0; d < dimensions_; ++d) {
                    const double reach = share / 2 * (box.high[d] - box.low[d]);
                    near.low[d] = std::max(0.0, centre[d] - reach);
                    near.high[d] = std::min(1.0, centre[d] + reach);
                }
                add(take(near, 16));
            }
        }
        return found;
    }

    FitResult posterior() {
        const UnitBox box = zoomed([&](const std::vector<Point>& points) {
            std::vector<double> values;
            for (const Point& point : points) values.push_back(log_likelihood(point));
            const double limit = *std::ranges::max_element(values) - 12;
            std::vector<bool> kept;
            for (const double value : values) kept.push_back(value >= limit);
            return kept;
        });
        // Points until those that count are as many as the samples, up to a limit.
        std::vector<Point> points;
        std::vector<double> logarithms, weights;
        std::size_t best = 0;
        double effective = 0;
        for (int batch = 0; batch < kMostBatches && effective < double(kSamples); ++batch) {
            for (Point& point : take(box, 8 * kCandidates)) {
                logarithms.push_back(log_likelihood(point));
                points.push_back(std::move(point));
            }
            best = std::size_t(std::ranges::max_element(logarithms) - logarithms.begin());
            weights.clear();
            for (const double logarithm : logarithms)
                weights.push_back(std::exp(logarithm - logarithms[best]));
            effective = effective_number(weights);
        }
        FitResult result;
        result.best = points[best];
        result.implausibility = implausibility(points[best]);
        result.effective_samples = effective;
        // Systematic resampling: sample n is where the sum of weights passes (n + 1/2) / kSamples. In the order of the first
        // parameter: in that of the sequence, equal distances would pick points that lie alike.
        const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
        std::vector<std::size_t> order(points.size());
        std::iota(order.begin(), order.end(), std::size_t(0));
        std::ranges::sort(order, {}, [&](std::size_t n) -> const Point& { return points[n]; });
        double sum = 0;
        std::size_t at = 0;
        for (std::size_t n = 0; n < kSamples; ++n) {
            const double place = (double(n) + 0.5) / double(kSamples) * total;
            while (at + 1 < points.size() && sum + weights[order[at]] < place) sum += weights[order[at++]];
            result.posterior.push_back(points[order[at]]);
        }
        // In random order: Sobol points that are a power of two apart lie close together, and so would every hundredth.
        std::vector<double> keys = unit_points(Design::random, kSamples, 1, problem_.seed);
        for (std::size_t n = kSamples; n > 1; --n)
            std::swap(result.posterior[n - 1], result.posterior[std::size_t(keys[n - 1] * double(n))]);
        estimate(points, weights, total, result);
        look_beside(result);
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
        for (std::size_t n = 0; n < transforms_.size(); ++n) {
            double mean = 0, variance = 0;
            for (std::size_t p = 0; p < points.size(); ++p) {
                const Emulator::Prediction prediction = emulators_[n].at(points[p]);
                mean += weights[p] * backward(transforms_[n], prediction.mean) / total;
                variance += weights[p] * prediction.variance / total;
            }
            const FitTarget& target = problem_.targets[n];
            result.targets.push_back({target.value, target.sd, mean,
                                      std::sqrt(variance) / slope(transforms_[n], mean), kNaN, kNaN, 0});
        }
        directions(result.best, result);
    }

    // Looks for runs that met all targets where the emulators say that none can: they may miss a second solution, as in a
    // corner of the prior that few runs of the first wave fell into.
    void look_beside(FitResult& result) const {
        constexpr double kMet = 2, kLeftOut = 2 * kImplausible;
        double closest = kMet;
        for (const FitRun& run : runs_) {
            double worst = 0;
            for (std::size_t n = 0; n < transforms_.size(); ++n) {
                const FitTarget& wanted = problem_.targets[n];
                const Emulator::Prediction of_run{run.statistics[n], run.errors[n] * run.errors[n]};
                worst = std::max(worst, match(transforms_[n], of_run, {wanted.value, wanted.sd}).distance);
            }
            if (worst > kMet || implausibility(run.unit) < kLeftOut) continue;
            ++result.left_out;
            if (worst > closest) continue;
            closest = worst;
            result.left_out_at = values_of(run.unit);
        }
    }

    // Singular vectors of the Jacobian at the best point, its rows in units of what each target allows.
    void directions(const std::vector<double>& centre, FitResult& result) const {
        Eigen::MatrixXd jacobian =
            Eigen::MatrixXd::Zero(Eigen::Index(transforms_.size()), Eigen::Index(dimensions_));
        for (std::size_t n = 0; n < transforms_.size(); ++n) {
            const TargetMatch found = match_of(n, centre);
            const double scale = found.sd / found.unit;
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

    // At different points, in the random order of the samples: a point that comes twice has the same seed, and would be the same
    // run twice.
    void prove(FitResult& result) {
        std::vector<Point> points;
        std::set<Point> known = tried_;
        for (const Point& sample : result.posterior) {
            if (points.size() == problem_.proof) break;
            if (known.insert(sample).second) points.push_back(sample);
        }
        result.proof = points.size();
        if (points.empty()) return;
        const std::vector<FitRun> runs = simulate_(4, points);
        for (const FitRun& run : runs) result.failed += run.failed;
        for (std::size_t n = 0; n < transforms_.size(); ++n) {
            double sum = 0, squares = 0, count = 0;
            for (const FitRun& run : runs) {
                if (!std::isfinite(run.statistics[n])) continue;
                sum += run.statistics[n];
                squares += run.statistics[n] * run.statistics[n];
                ++count;
            }
            if (count < 1) continue;
            result.targets[n].got = sum / count;
            result.targets[n].got_runs = std::uint64_t(count);
            if (count > 1)
                result.targets[n].got_error =
                    std::sqrt(std::max(0.0, squares - sum * sum / count) / (count - 1) / count);
        }
    }

    const FitProblem& problem_;
    const Simulate& simulate_;
    std::size_t dimensions_;
    // Twice and three times as wide as where the targets are possible: what is looked at, for a wave knows its own errors only
    // roughly, and the region of the emulators.
    UnitBox looked_at_, box_;
    std::vector<Transform> transforms_;
    std::vector<FitRun> runs_;    // statistics transformed
    std::set<Point> tried_;       // of all runs, those that were lost included
    std::uint64_t taken_ = 0;     // points of the Sobol sequence
    std::uint64_t lost_ = 0, failed_ = 0;
    std::vector<std::uint64_t> without_;  // runs that have none of each target
    std::vector<Emulator> emulators_;
};

}  // namespace

double parameter_value(const FitParameter& parameter, double unit) {
    if (parameter.scale == Scale::log) return geometric(parameter.from, parameter.to, unit);
    return parameter.from + unit * (parameter.to - parameter.from);
}

std::uint64_t fewest_runs(std::size_t parameters) { return 2 * (parameters + 4); }

FitResult fit(const FitProblem& problem, const Simulate& simulate) {
    return Fitter(problem, simulate).result();
}

}  // namespace nephos
