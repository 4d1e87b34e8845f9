// SPDX-License-Identifier: Apache-2.0
#include "study/fit_folder.h"

#include <algorithm>
#include <cmath>

#include "study/folder_contents.h"
#include "study/folder_guard.h"
#include "study/placed_scene.h"
#include "study/plan_memory.h"
#include "study/tables.h"
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/atomic_file.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "core/paths.h"
#include "core/text.h"
#include "scenes/format/given_keys.h"
#include "scenes/format/reader.h"

namespace nephos {
namespace {

constexpr double kFewSamples = 200;

struct Stopped {};

std::string name_of(const FitParameter& parameter) {
    return fmt::format("{}", fmt::join(parameter.keys, "+"));
}

// The points of a wave as a list of runs.
SweepPlan plan_of(const FitOptions& options, const std::vector<std::vector<double>>& points) {
    SweepOptions sweep = options.base;
    sweep.design = Design::list;
    sweep.replicates = 1;
    sweep.axes.clear();
    for (std::size_t d = 0; d < options.problem.parameters.size(); ++d) {
        Axis axis;
        axis.keys = options.problem.parameters[d].keys;
        for (const std::vector<double>& point : points)
            axis.values.push_back(number_text(parameter_value(options.problem.parameters[d], point[d])));
        sweep.axes.push_back(std::move(axis));
    }
    return SweepPlan(std::move(sweep));
}

std::vector<FitRun> runs_of(const FitOptions& options, const SweepPlan& plan, const Records& records,
                            const std::vector<std::vector<double>>& points) {
    std::vector<FitRun> runs;
    for (std::uint64_t n = 0; n < plan.runs(); ++n) {
        FitRun& run = runs.emplace_back();
        run.unit = points[n];
        const RunRecord* record = records.find(plan.run(n).id);
        run.failed = record != nullptr && record->failed;
        for (const FitTarget& target : options.problem.targets) {
            const SeriesMean none{std::nan(""), std::nan(""), 0, 0, 0};
            const SeriesMean& s = record == nullptr || record->failed
                                      ? none
                                      : record->result.statistics[statistic_index(target.statistic)];
            run.statistics.push_back(s.mean);
            run.errors.push_back(s.error);
        }
    }
    return runs;
}

// "+0.71 field.background.act - 0.70 field.background.ext"
std::string direction_text(const FitOptions& options, const Direction& direction) {
    std::string text;
    for (std::size_t d = 0; d < direction.weights.size(); ++d) {
        if (std::abs(direction.weights[d]) < 0.05) continue;
        text += fmt::format("{}{:+.2f} {}", text.empty() ? "" : " ", direction.weights[d],
                            name_of(options.problem.parameters[d]));
    }
    return text;
}

// "0.301 (0.002 of 8)": the mean of the proof, its standard error, and the runs that it is of.
std::string proof_text(const TargetCheck& target) {
    if (target.got_runs == 0) return "none";
    if (target.got_runs == 1) return fmt::format("{:.5g} (one run)", target.got);
    return fmt::format("{:.5g} ({:.2g} of {})", target.got, target.got_error, target.got_runs);
}

void write_results(const FitOptions& options, const FitResult& result, const std::filesystem::path& folder) {
    std::string csv;
    for (const FitParameter& parameter : options.problem.parameters)
        for (const std::string& key : parameter.keys) csv += (csv.empty() ? "" : ",") + key;
    csv += '\n';
    for (const std::vector<double>& sample : result.posterior) {
        std::string line;
        for (std::size_t d = 0; d < sample.size(); ++d)
            for (std::size_t k = 0; k < options.problem.parameters[d].keys.size(); ++k)
                line += (line.empty() ? "" : ",") + number_text(sample[d]);
        csv += line + '\n';
    }
    std::vector<std::string> overrides = options.base.overrides;
    for (std::size_t d = 0; d < result.best.size(); ++d)
        for (const std::string& key : options.problem.parameters[d].keys)
            overrides.push_back(key + "=" + number_text(result.best[d]));
    write_atomically(
        folder / "fitted.toml",
        std::string(kWrittenByFit) +
            given_toml(placed_scene(options.base.source->read(overrides, SceneUse::without_frames), folder)));
    // After the scene, by whose first line it is known for a fit's.
    write_atomically(folder / "posterior.csv", csv);

    using Json = nlohmann::ordered_json;
    const auto number = [](double value) { return std::isfinite(value) ? Json(value) : Json(); };
    Json parameters = Json::array(), targets = Json::array(), directions = Json::array();
    for (std::size_t d = 0; d < result.parameters.size(); ++d) {
        const ParameterEstimate& p = result.parameters[d];
        parameters.push_back({{"keys", options.problem.parameters[d].keys},
                              {"mean", p.mean},
                              {"sd", p.sd},
                              {"low", p.low},
                              {"high", p.high},
                              {"best", result.best[d]}});
    }
    for (std::size_t n = 0; n < result.targets.size(); ++n) {
        const TargetCheck& t = result.targets[n];
        targets.push_back(
            {{"statistic", options.problem.targets[n].statistic},
             {"target", t.target},
             {"sd", t.sd},
             {"predicted", number(t.predicted)},
             {"predicted_sd", number(t.predicted_sd)},
             {"got", number(t.got)},
             {"got_se", number(t.got_error)},
             {"got_runs", t.got_runs},
             {"from",
              options.problem.targets[n].from.empty() ? Json() : Json(options.problem.targets[n].from)},
             {"missing", options.problem.targets[n].missing}});
    }
    for (const Direction& direction : result.directions)
        directions.push_back({{"weights", direction.weights}, {"strength", number(direction.strength)}});
    const Json json = {{"format", "nephos fit"},
                       {"runs_asked", options.problem.runs},
                       {"runs", result.runs},
                       {"lost", result.lost},
                       {"failed", result.failed},
                       {"proof_asked", options.problem.proof},
                       {"proof", result.proof},
                       {"implausibility", number(result.implausibility)},
                       {"effective_samples", number(result.effective_samples)},
                       {"left_out", result.left_out},
                       {"parameters", parameters},
                       {"targets", targets},
                       {"directions", directions},
                       {"notes", options.notes}};
    write_atomically(folder / "fit.json", json.dump(2) + "\n");
}

}  // namespace

std::optional<FitResult> run_fit(const FitOptions& given, const SweepJob& job,
                                 const std::function<void(int wave, const SweepProgress&)>& progress,
                                 const std::function<bool()>& stop) {
    require_fit_folder(job.folder);
    FitOptions options = given;
    if (!options.base.source) options.base.source.emplace(options.base.scene_file);
    // Bad ends of a prior are found before the first run.
    std::vector<std::vector<double>> ends;
    for (const double unit : {0.0, 1.0}) ends.emplace_back(options.problem.parameters.size(), unit);
    const SweepPlan plan_of_ends = plan_of(options, ends);
    require_memory_for(plan_of_ends,
                       int(std::min<std::uint64_t>(std::uint64_t(job.workers), options.problem.runs)));
    const std::string& simulation_hash = plan_of_ends.simulation_hash();
    Descriptor held;
    const std::function<void()> check_place = [&] {
        require_in_place(held, job.folder, "the fit was at work");
    };
    std::vector<std::string> problems;
    const Simulate simulate = [&](int wave, const std::vector<std::vector<double>>& points) {
        const SweepPlan plan = plan_of(options, points);
        if (plan.simulation_hash() != simulation_hash)
            throw Error(ErrorCode::io,
                        options.base.scene_file.string() +
                            ": a file that the scene names was changed after the fit began: the same "
                            "command fits with what is in it now");
        if (held.get() < 0) {
            create_folders(job.folder);
            held = identity_of_folder(job.folder);
        }
        check_place();
        SweepJob part = job;
        part.folder = job.folder / (wave == 4 ? "proof" : fmt::format("wave-{}", wave));
        const SweepReport report = run_sweep(
            plan, part, [&](const SweepProgress& p) { progress(wave, p); }, stop);
        if (!report.complete) throw Stopped{};
        problems.insert(problems.end(), report.problems.begin(), report.problems.end());
        const Records records = Records::read({part.folder});
        write_tables(plan, records, part.folder);
        return runs_of(options, plan, records, points);
    };
    try {
        FitResult result = fit(options.problem, simulate);
        result.problems = std::move(problems);
        const PublishCheck keeps_in_place(check_place);
        write_results(options, result, job.folder);
        return result;
    } catch (const Stopped&) {
        return std::nullopt;
    }
}

std::string failed_runs_text(const FitResult& result) {
    return fmt::format(
        "{} failed: failures.csv of each wave has the command that repeats each, --retry-failed repeats all",
        result.failed == 1 ? "1 run" : std::to_string(result.failed) + " runs");
}

std::string fit_text(const FitOptions& options, const FitResult& result) {
    std::string text =
        fmt::format("{:32} {:>11} {:>11} {:>25}\n", "parameter", "mean", "sd", "90 % of the posterior");
    for (std::size_t d = 0; d < result.parameters.size(); ++d) {
        const ParameterEstimate& p = result.parameters[d];
        text += fmt::format("{:32} {:>11.6g} {:>11.3g} {:>11.6g} .. {:<11.6g}\n",
                            name_of(options.problem.parameters[d]), p.mean, p.sd, p.low, p.high);
    }
    text += fmt::format("\n{:22} {:>20} {:>22} {:>26}\n", "target", "asked for", "emulator (its error)",
                        "fresh runs (se of number)");
    for (std::size_t n = 0; n < result.targets.size(); ++n) {
        const TargetCheck& t = result.targets[n];
        text += fmt::format("{:22} {:>10.5g} +- {:<7.3g} {:>21} {:>26}\n",
                            options.problem.targets[n].statistic, t.target, t.sd,
                            fmt::format("{:.5g} ({:.2g})", t.predicted, t.predicted_sd), proof_text(t));
    }
    std::size_t fixed = 0;
    for (const Direction& direction : result.directions) fixed += direction.strength > 1;
    text += fmt::format(
        "\nthe targets fix {} of {} combinations of parameters (in units of their prior ranges):\n", fixed,
        result.directions.size());
    for (const Direction& direction : result.directions)
        text += fmt::format("  {:5} {:8.3g}  {}\n", direction.strength > 1 ? "fixed" : "free",
                            direction.strength, direction_text(options, direction));
    if (result.implausibility > 3)
        text += fmt::format(
            "warning: the best point is {:.1f} standard deviations off a target: nothing in the prior meets "
            "them all\n",
            result.implausibility);
    if (result.left_out > 0) {
        std::string place;
        for (std::size_t d = 0; d < result.left_out_at.size(); ++d)
            place += fmt::format("{}{} {:.4g}", d == 0 ? "" : ", ", name_of(options.problem.parameters[d]),
                                 result.left_out_at[d]);
        text += fmt::format(
            "warning: {} of the runs met all targets where the posterior has nothing, the closest at {}: "
            "there may be "
            "another solution, too narrow for so few runs to tell; give a prior about it, or a log scale\n",
            result.left_out, place);
    }
    if (result.effective_samples < kFewSamples)
        text += fmt::format(
            "warning: the posterior rests on {:.0f} independent points: its quantiles are rough; give "
            "narrower "
            "priors, or leave out a parameter that the targets do not fix\n",
            result.effective_samples);
    if (result.proof < options.problem.proof)
        text += fmt::format("warning: {} of {} fresh runs: the posterior has no more points\n", result.proof,
                            options.problem.proof);
    if (result.runs < options.problem.runs)
        text +=
            fmt::format("warning: {} of {} runs: no more points were found where the targets are possible\n",
                        result.runs, options.problem.runs);
    if (result.failed > 0) text += "warning: " + failed_runs_text(result) + '\n';
    if (result.lost > 0)
        text +=
            fmt::format("warning: {} of {} runs had no mean (not steady, dead or failed) and told nothing\n",
                        result.lost, result.runs);
    return text;
}

}  // namespace nephos
