// SPDX-License-Identifier: Apache-2.0

// The reader of fit files.

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>

#include "study/axis_text.h"
#include "study/cloud_mask.h"
#include "study/fit.h"
#include "study/measured_lattice.h"
#include "study/run_statistics.h"
#include "study/toml_table.h"
#include "study/transform.h"
#include <fmt/format.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "core/text.h"
#include "scenes/format/named_files.h"
#include "scenes/format/reader.h"
#include "simulation/layer_simulation.h"

namespace nephos {
namespace {

constexpr double kLargest = std::numeric_limits<double>::max(),
                 kSmallest = std::numeric_limits<double>::min();

// The lattice that the runs measure.
struct Measured {
    std::string scene;  // as the file names it
    Extent extent;
    double cell_size_m = 0;
    double floor_m = 0;   // lower face of the lowest level
    std::string cells;    // the keys of its cells begin with
    bool varies = false;  // a parameter changes them
};

// Reads the keys that say what is run. Returns nothing where that does not do, and has said so: the scene's own problems in
// its file, those of `set` and `layer` where they stand.
std::optional<Measured> read_scene_keys(TomlTable& table, const std::filesystem::path& folder,
                                        SweepOptions& base, int& unread) {
    const std::optional<std::string> scene = table.text("scene");
    base.overrides = table.texts("set");
    base.layer = table.text("layer").value_or("");
    if (!table.has("scene")) table.report("scene", "the fit has no scene", "expected scene = \"FILE.toml\"");
    if (scene && names_no_file(*scene))
        table.report("scene", "`scene` names no file", "expected scene = \"FILE.toml\"");
    if (!scene || names_no_file(*scene)) return std::nullopt;
    base.scene_file = folder / *scene;
    try {
        base.source.emplace(base.scene_file);
        const SweepPlan plan(base);
        const AutomatonOptions lattice = plan.lattice();
        const std::string layer =
            plan.scene().layers.empty()
                ? ""
                : fmt::format("layer[{}].", measured_lattice(plan.scene(), plan.options().layer));
        return Measured{*scene, lattice.extent, lattice.placement.cell_size_m, lattice.placement.origin_m.z,
                        layer + "lattice.cell"};
    } catch (const SceneErrors& errors) {
        for (const Problem& problem : errors.problems()) {
            if (problem.where.line > 0)
                table.report(problem);
            else
                table.report("set", problem.message, problem.expected);
        }
    } catch (const LoadFailure&) {
        throw;
    } catch (const Error& error) {
        const bool is_unread = error.code() == ErrorCode::io;
        unread += is_unread;
        table.report(is_unread ? "scene" : "layer", error.what(),
                     is_unread ? "expected the file of a scene, its path relative to the folder of this file"
                               : "expected layer = \"NAME\" of a scene with layers alone");
    }
    return std::nullopt;
}

// Reports where a key of the scene cannot have a value. Returns false where there is no such key.
bool check_end(TomlTable& parameter, TomlTable& prior, const std::string& end, const SweepOptions& base,
               const std::string& key, double value) {
    std::vector<std::string> overrides = base.overrides;
    overrides.push_back(key + "=" + number_text(value));
    try {
        base.source->read(overrides, SceneUse::without_frames);
    } catch (const SceneErrors& errors) {
        for (const Problem& problem : errors.problems()) {
            if (problem.where.line == 0 && problem.where.column <= int(key.size())) {
                parameter.report(parameter.has("key") ? "key" : "keys", problem.message, problem.expected);
                return false;
            }
            prior.report(end, problem.message, problem.expected);
        }
    }
    return true;
}

// A key that stands in one parameter, and that the runs depend on beside their seeds and numbers.
bool check_key(TomlTable& parameter, const std::string& key, std::set<std::string>& known) {
    const std::string place = parameter.has("key") ? "key" : "keys";
    if (const std::string problem = no_key_text(key); !problem.empty()) {
        parameter.report(place, problem, std::string(kExpectedKey));
        return false;
    }
    if (key == "seed" || key == "time.steps" || key == "name") {
        parameter.report(place, "`" + key + "` is no parameter of a fit",
                         "expected a key that changes clouds; `seed` and [steps] of the fit are its own");
        return false;
    }
    if (!known.insert(key).second) {
        parameter.report(place, "`" + key + "` is a parameter twice",
                         "expected each key in one [[parameter]]");
        return false;
    }
    const auto is_in = [](const std::string& inner, const std::string& outer) {
        return std::ranges::count(outer_keys(inner), outer) > 0;
    };
    for (const std::string& other : known) {
        if (!is_in(key, other) && !is_in(other, key)) continue;
        parameter.report(place, fmt::format("`{}` and `{}` overlap", other, key),
                         "expected keys of which none is a part of another one");
        return false;
    }
    return true;
}

void read_parameter(TomlTable& parameter, const SweepOptions& base, std::optional<Measured>& measured,
                    std::set<std::string>& known, FitParameter& to) {
    if (const auto key = parameter.text("key")) to.keys = {*key};
    for (std::string& key : parameter.texts("keys")) to.keys.push_back(std::move(key));
    if (to.keys.empty() && !parameter.has("key"))
        parameter.report("key", "a parameter has no key", "expected key = \"field.background.ext\"");
    std::vector<std::string> sound;
    for (std::string& key : to.keys) {
        key = canonical_key(key);
        if (check_key(parameter, key, known)) sound.push_back(key);
        // Layers without keys of their own have those of the scene.
        const bool is_of_cells =
            measured && (key.starts_with(measured->cells) || key.starts_with("lattice.cell"));
        if (is_of_cells) measured->varies = true;
    }
    bool has_prior = false;
    parameter.table("prior", [&](TomlTable& prior) {
        has_prior = true;
        const std::optional<double> from = prior.number("from", -kLargest, kLargest),
                                    end = prior.number("to", -kLargest, kLargest);
        to.from = from.value_or(0);
        to.to = end.value_or(1);
        to.scale = prior.word("scale", {"linear", "log"}).value_or(0) == 1 ? Scale::log : Scale::linear;
        for (const char* name : {"from", "to"})
            if (!prior.has(name))
                prior.report(name, fmt::format("the prior has no `{}`", name),
                             "expected prior = { from = 0.03, to = 0.4, scale = \"log\" }");
        if (!from || !end) return;
        if (!(to.to > to.from) || (to.scale == Scale::log && !(to.from > 0))) {
            prior.report("to", "the prior is empty",
                         "expected `to` above `from`, and both above 0 on a log scale");
            return;
        }
        constexpr double kNarrowest = 1e-9;  // of the larger end
        const double width = to.to - to.from, largest = std::max(std::abs(to.from), std::abs(to.to));
        if (!(width > kNarrowest * largest) || !std::isfinite(width) ||
            (to.scale == Scale::log && !std::isfinite(to.to / to.from))) {
            prior.report("to", "the prior is too narrow or too wide for its numbers to be told apart",
                         "expected ends that differ by more than 1e-9 of the larger one, and whose "
                         "difference, on a log "
                         "scale their ratio, is finite");
            return;
        }
        for (const std::string& key : sound)
            if (measured && check_end(parameter, prior, "from", base, key, to.from))
                check_end(parameter, prior, "to", base, key, to.to);
    });
    if (!has_prior && !parameter.has("prior"))
        parameter.report("prior", "a parameter has no prior",
                         "expected prior = { from = 0.03, to = 0.4, scale = \"log\" }");
}

// Whether a statistic of other cells, or of a box of another number of them, is another statistic.
enum class Depends { on_nothing, on_cells, on_levels, on_cells_and_box };

Depends dependence(std::string_view statistic) {
    if (statistic.starts_with("size_exponent") || statistic == "fractal_dimension")
        return Depends::on_cells_and_box;
    if (statistic == "edge_per_km" || statistic == "clouds_per_km2" || statistic == "cloud_area_m2")
        return Depends::on_cells;
    return statistic == "overlap" ? Depends::on_levels : Depends::on_nothing;
}

std::string size_text(int x, int y, const std::optional<int>& z, double cell_m, double level_m) {
    return fmt::format("{} x {}{} cells of {} m{}", x, y, z ? fmt::format(" x {}", *z) : "",
                       number_text(cell_m, 6),
                       z && level_m != cell_m ? fmt::format(" and {} m high", number_text(level_m, 6)) : "");
}

// Compares the cells and the box of a mask with those of the runs. Returns false where the statistic depends on what differs, and
// has said so; else what differs is a note.
bool compare_sizes(TomlTable& target, const FitTarget& to, const CloudMasks& masks, const Measured& measured,
                   std::vector<std::string>& notes) {
    if (measured.varies) return true;
    const auto other_base =
        std::ranges::find_if(masks.bases_m, [&](double m) { return m != measured.floor_m; });
    if ((to.statistic == "base_mean_m" || to.statistic == "top_mean_m") && other_base != masks.bases_m.end())
        notes.push_back(
            fmt::format("the lowest level of {} begins at {} m, that of {} at {} m: `{}` is compared "
                        "all the same",
                        to.from, number_text(*other_base, 6), measured.scene,
                        number_text(measured.floor_m, 6), to.statistic));
    const Extent box = masks.snapshots.front().extent(), own = measured.extent;
    const auto differ = [](double a, double b) { return std::abs(a - b) > 1e-3 * b; };
    const bool other_cells = differ(masks.cell_size_m, measured.cell_size_m),
               other_levels = !masks.seen_from_above && differ(masks.level_height_m, measured.cell_size_m),
               other_box = box.x != own.x || box.y != own.y,
               other_height = !masks.seen_from_above && box.z != own.z;
    if (!other_cells && !other_levels && !other_box && !other_height) return true;
    const std::string sizes = fmt::format(
        "{} has {}, {} has {}", to.from,
        size_text(box.x, box.y, masks.seen_from_above ? std::nullopt : std::optional(box.z),
                  masks.cell_size_m, masks.level_height_m),
        measured.scene, size_text(own.x, own.y, own.z, measured.cell_size_m, measured.cell_size_m));
    const Depends depends = dependence(to.statistic);
    if ((depends == Depends::on_cells && other_cells) || (depends == Depends::on_levels && other_levels) ||
        (depends == Depends::on_cells_and_box && (other_cells || other_box))) {
        target.report("from", fmt::format("{}: `{}` depends on that", sizes, to.statistic),
                      depends == Depends::on_cells    ? "expected a mask of cells as large as the scene's"
                      : depends == Depends::on_levels ? "expected a mask of levels as high as the scene's"
                                                      : "expected a mask of as many and as large cells");
        return false;
    }
    notes.push_back(fmt::format("{}: `{}` is compared across that", sizes, to.statistic));
    return true;
}

// A value that the statistic can have, and an emulator can stand for.
bool check_value(TomlTable& target, const std::string& key, const FitTarget& to) {
    const Transform transform = transform_of(to.statistic);
    if (std::isfinite(forward(transform, to.value))) return true;
    target.report(key,
                  fmt::format("{} `{}` of {} is no target", to.from.empty() ? "a" : "the", to.statistic,
                              number_text(to.value)) +
                      (to.from.empty() ? "" : " (of " + to.from + ")"),
                  transform == Transform::logit ? "expected a number above 0 and below 1"
                                                : "expected a number above 0");
    return false;
}

MaskOptions read_mask_options(TomlTable& target) {
    MaskOptions mask;
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
    return mask;
}

// A target that a cloud mask gives: its value, and the standard error of it where the file does not say another sd.
void read_target_mask(TomlTable& target, const std::filesystem::path& folder,
                      const std::optional<Measured>& measured, FitTarget& to, std::vector<std::string>& notes,
                      int& unread) {
    const std::vector<std::string> files = target.texts("from");
    std::vector<std::filesystem::path> paths;
    for (const std::string& file : files) paths.push_back(folder / file);
    if (!files.empty())
        to.from = files.front() + (files.size() > 1 ? fmt::format(" and {} more", files.size() - 1) : "");
    const MaskOptions mask = read_mask_options(target);
    const std::optional<double> sd = target.number("sd", kSmallest, kLargest);
    if (target.has("value"))
        target.report("value", "a target has both value and from", "expected one of them");
    const bool clear_if_missing = target.word("missing", {"clear"}).has_value();
    if (files.empty())
        return target.report("from", "names no file", "expected a cloud mask: .vdb, .nc or .png");
    SeriesMean mean{};
    try {
        const CloudMasks masks = read_masks(paths, mask);
        to.missing = masks.missing;
        const std::size_t values = masks.snapshots.size() * masks.snapshots.front().extent().cells();
        if (masks.missing > 0 && !clear_if_missing)
            return target.report(
                "from", fmt::format("{} of {} values of {} are missing", masks.missing, values, to.from),
                "expected a part of the mask without such, or missing = \"clear\" where they are clear air");
        if (masks.seen_from_above && needs_levels(to.statistic))
            return target.report(
                "from", fmt::format("{} is a view from above, and has no `{}`", to.from, to.statistic),
                "expected a mask with levels, or a statistic of the shadow, as cover");
        if (measured && !compare_sizes(target, to, masks, *measured, notes)) return;
        for (const std::string& note : masks.notes)
            if (std::ranges::count(notes, note) == 0) notes.push_back(note);
        mean = mask_statistics(masks).statistics[statistic_index(to.statistic)];
    } catch (const LoadFailure&) {
        throw;
    } catch (const Error& error) {
        unread += error.code() == ErrorCode::io;
        return target.report("from", error.what(), "expected a cloud mask: .vdb, .nc or .png");
    }
    to.value = mean.mean;
    to.sd = sd.value_or(mean.error);
    if (!std::isfinite(to.value))
        target.report("from", fmt::format("{} has no value of `{}`", to.from, to.statistic),
                      "expected another statistic");
    else if (check_value(target, "from", to) && !(to.sd > 0))
        target.report(
            "from", fmt::format("{} does not say how uncertain its `{}` is", to.from, to.statistic),
            "expected sd = ... beside it: a single snapshot, or several alike, have no standard error");
}

void read_target(TomlTable& target, const std::filesystem::path& folder, int clouds_every,
                 const std::optional<Measured>& measured, FitTarget& to, std::vector<std::string>& notes,
                 int& unread) {
    std::vector<std::string_view> names;
    for (const StatisticInfo& info : kStatistics) names.push_back(info.name);
    const std::optional<std::size_t> statistic = target.word("statistic", names);
    to.statistic = names[statistic.value_or(0)];
    if (statistic && clouds_every == 0 && is_of_snapshots(to.statistic))
        target.report("statistic",
                      fmt::format("`{}` is of snapshots, and clouds_every = 0 takes none", to.statistic),
                      "expected clouds_every = 10, or another statistic");
    if (target.has("from")) {
        read_target_mask(target, folder, measured, to, notes, unread);
        return;
    }
    if (!target.has("statistic") || !target.has("value") || !target.has("sd"))
        target.report("statistic", "a target needs statistic, and value and sd or from",
                      "expected statistic = \"cover\", value = 0.3, sd = 0.015, or from = \"observed.nc\"");
    const std::optional<double> value = target.number("value", -kLargest, kLargest);
    to.value = value.value_or(0);
    to.sd = target.number("sd", kSmallest, kLargest).value_or(1);
    if (statistic && value) check_value(target, "value", to);
}

}  // namespace

FitOptions read_fit_file(const std::filesystem::path& path, std::optional<std::uint64_t> runs) {
    FitOptions options;
    options.base.replicates = 1;
    int unread = 0;  // problems that are files which cannot be read
    const auto read = [&](TomlTable& table) {
        std::optional<Measured> measured = read_scene_keys(table, path.parent_path(), options.base, unread);
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
        std::set<std::string> keys;
        table.tables("parameter", [&](TomlTable& parameter) {
            read_parameter(parameter, options.base, measured, keys,
                           options.problem.parameters.emplace_back());
        });
        if (options.problem.parameters.empty())
            table.report("parameter", "the fit has no parameter", "expected a table [[parameter]]");
        if (runs) options.problem.runs = *runs;
        const std::uint64_t fewest = fewest_runs(options.problem.parameters.size());
        if (!runs && options.problem.runs < fewest)
            table.report("runs",
                         fmt::format("{} runs are too few for {} parameters", options.problem.runs,
                                     options.problem.parameters.size()),
                         fmt::format("expected {} or more", fewest));
        table.tables("target", [&](TomlTable& target) {
            read_target(target, path.parent_path(), options.base.clouds_every, measured,
                        options.problem.targets.emplace_back(), options.notes, unread);
        });
        if (options.problem.targets.empty())
            table.report("target", "the fit has no target", "expected a table [[target]]");
    };
    try {
        read_toml_file(path, read, "fit file");
    } catch (const SceneErrors& errors) {
        if (unread == 0 || errors.problems().size() != std::size_t(unread)) throw;
        throw SceneErrors(errors.problems(), ErrorCode::io);
    }
    return options;
}

}  // namespace nephos
