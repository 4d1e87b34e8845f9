// SPDX-License-Identifier: Apache-2.0

// The reader of fit files.

#include <cmath>
#include <limits>

#include "study/cloud_mask.h"
#include "study/fit.h"
#include "study/run_statistics.h"
#include "study/toml_table.h"
#include <fmt/format.h>

#include "core/error.h"
#include "simulation/layer_simulation.h"

namespace nephos {
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
    const bool clear_if_missing = target.word("missing", {"clear"}).has_value();
    SeriesMean mean{};
    try {
        const CloudMasks masks = read_masks({folder / file}, mask);
        to.missing = masks.missing;
        const std::size_t values = masks.snapshots.size() * masks.snapshots.front().extent().cells();
        if (masks.missing > 0 && !clear_if_missing) {
            target.report(
                "from", fmt::format("{} of {} values of {} are missing", masks.missing, values, file),
                "expected a part of the mask without such, or missing = \"clear\" where they are clear air");
            return;
        }
        mean = mask_statistics(masks).statistics[statistic_index(to.statistic)];
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

FitOptions read_fit_file(const std::filesystem::path& path, std::optional<std::uint64_t> runs) {
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
        if (runs) options.problem.runs = *runs;
        const std::uint64_t fewest = fewest_runs(options.problem.parameters.size());
        if (options.problem.runs < fewest)
            table.report("runs",
                         fmt::format("{} runs are too few for {} parameters", options.problem.runs,
                                     options.problem.parameters.size()),
                         fmt::format("expected {} or more", fewest));
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
