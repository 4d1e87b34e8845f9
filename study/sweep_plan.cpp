// SPDX-License-Identifier: Apache-2.0
#include "study/sweep_plan.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <span>
#include <tuple>

#include "study/axis_files.h"
#include "study/axis_text.h"
#include "study/measured_lattice.h"
#include "study/placed_scene.h"
#include "study/plan_checks.h"
#include "study/plan_errors.h"
#include <fmt/format.h>

#include "automaton/checkpoint.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "core/math.h"
#include "core/random.h"
#include "core/text.h"
#include "core/wind_field.h"
#include "scenes/format/given_keys.h"
#include "scenes/format/reader.h"
#include "scenes/format/text.h"
#include "scenes/format/writer.h"
#include "simulation/layer_simulation.h"
#include "simulation/scene_files.h"

namespace nephos {
namespace {

StateHash hash_of_text(std::string_view text) { return hash_of_bytes(std::as_bytes(std::span(text))); }

std::string value_at(const Axis& axis, double unit) {
    switch (axis.scale) {
        case Scale::log:
            return number_text(geometric(axis.from, axis.to, unit));
        case Scale::integer:
            return fmt::format("{}",
                               std::min(std::floor(axis.from + unit * (axis.to - axis.from + 1)), axis.to));
        case Scale::linear:
            break;
    }
    return number_text(axis.from + unit * (axis.to - axis.from));
}

// Throws Error(usage) where clouds cannot be followed: the wind, with its files, differs within a level.
void require_same_wind(const Scene& scene, std::size_t lattice) {
    if (!is_profile(automaton_options(with_files(scene), lattice).wind.fields))
        throw Error(ErrorCode::usage,
                    "the scene has a wind that differs within a level, and clouds are followed only in one "
                    "that is the "
                    "same all over each level: leave out --tracks");
}

// Returns whether a sample of so many points may have a value of an axis twice: of whole numbers, and of a range with few
// numbers in it. Points by chance begin to meet when they are as many as the root of these.
bool may_meet(const Axis& axis, std::uint64_t points) {
    constexpr double kMargin = 1000;
    const double largest = std::max(std::abs(axis.from), std::abs(axis.to));
    const double apart = std::nextafter(largest, std::numeric_limits<double>::infinity()) - largest;
    return axis.scale == Scale::integer ||
           !((axis.to - axis.from) / apart >= kMargin * double(points) * double(points));
}

// Calls `check`; an error without a place gets one, where that is known, and words before it. A failure of reading keeps its
// own.
void with_place(const SweepOptions& options, PlanPlace place, const std::string& before,
                const std::function<void()>& check) {
    try {
        check();
    } catch (const SceneErrors&) {
        throw;
    } catch (const ReadFailure&) {
        throw;
    } catch (const Error& error) {
        fail_at(options, place, before + error.what(), error.code());
    }
}

}  // namespace

double largest_activation(const Scene& scene) {
    if (!scene.layers.empty()) return 1;
    const FieldOptions& field = scene.automaton.field;
    double act = field.background.act;
    for (const Ellipsoid& ellipsoid : field.ellipsoids)
        act = std::max({act, ellipsoid.centre.act, ellipsoid.rim.act});
    for (const EllipsoidScatter& scatter : field.scatters)
        act = std::max({act, scatter.centre.act, scatter.rim.act});
    return act;
}

SweepPlan::SweepPlan(SweepOptions options) : options_(std::move(options)) {
    for (Axis& axis : options_.axes) {
        for (std::string& key : axis.keys) key = canonical_key(key);
        const bool of_text = take_text(axis.keys);
        for (std::string& value : axis.values) value = canonical_value(value, of_text);
    }
    check_options(options_);
    if (!options_.source)
        with_place(options_, options_.places.scene, "",
                   [&] { options_.source.emplace(options_.scene_file); });
    read_placed(options_, {}, [&] {
        scene_ = options_.source->read(options_.overrides, SceneUse::without_frames);
        stamps_ = stamps_of(scene_, {FileKind::first_state, FileKind::simulation});
    });
    // What stands in the plan is of its scene.
    const auto of_scene = [&](PlanPlace place) {
        return place.line > 0 ? "" : options_.scene_file.string() + ": ";
    };
    std::size_t measured = 0;
    with_place(options_, options_.places.layer, of_scene(options_.places.layer),
               [&] { measured = measured_lattice(scene_, options_.layer); });
    if (options_.tracks)
        with_place(options_, options_.places.tracks, of_scene(options_.places.tracks),
                   [&] { require_same_wind(scene_, measured); });
    if (!scene_.layers.empty()) options_.layer = scene_.layers[measured].name;
    lattice_ = automaton_options(scene_, measured);
    points_ = point_count(options_);
    if (is_sampled(options_.design))
        unit_points_ = unit_points(options_.design, points_, options_.axes.size(), options_.seed);
    require_different_points(check_axes());
    scene_.frames = {};  // of a study nothing is drawn
    scene_.frames.enabled = false;
    read_placed(options_, {}, [&] { simulation_hash_ = simulation_start(scene_).simulation_hash; });
}

void SweepPlan::check_measured(const Axis& axis, std::size_t n, const std::string& value,
                               const Scene& scene) const {
    with_place(options_, place_of_value(axis, n),
               fmt::format("axis {}: value {} is {}: ", joined_keys(axis), n + 1, value), [&] {
                   const std::size_t measured = measured_lattice(scene, options_.layer);
                   if (options_.tracks) require_same_wind(scene, measured);
               });
}

bool SweepPlan::varies_lattice() const {
    return std::ranges::any_of(options_.axes, [](const Axis& axis) {
        return std::ranges::any_of(axis.keys, [](const std::string& key) {
            return key.starts_with("time") || key.starts_with("lattice") || key.starts_with("layer");
        });
    });
}

AutomatonOptions SweepPlan::lattice_of(const PlannedRun& run) const {
    if (!varies_lattice()) return lattice_;
    const Scene scene = scene_of(run);
    return automaton_options(scene, measured_lattice(scene, options_.layer));
}

std::string SweepPlan::scene_text_in(const std::filesystem::path& folder) const {
    return std::string(kWrittenBySweep) + given_toml(placed_scene(scene_, folder));
}

std::vector<std::vector<std::string>> SweepPlan::check_axes() {
    std::vector<std::vector<std::string>> equals;
    files_.resize(options_.axes.size());
    for (std::size_t a = 0; a < options_.axes.size(); ++a) {
        Axis& axis = options_.axes[a];
        std::vector<std::string> values = axis.values;
        if (values.empty()) values = {value_at(axis, 0), value_at(axis, 1)};
        // Numbers and words have one text each; arrays and tables may say the same in several.
        const bool may_equal =
            std::ranges::any_of(values, [](const std::string& value) { return is_compound(value); });
        std::map<std::pair<std::uint64_t, std::uint64_t>, std::size_t> scenes;
        std::map<std::string, std::size_t> contents;
        std::vector<std::string>& firsts = equals.emplace_back(values);
        for (std::size_t n = 0; n < values.size(); ++n) {
            std::vector<std::string> overrides = options_.overrides;
            for (const std::string& key : axis.keys) overrides.push_back(key + "=" + values[n]);
            const auto fail_as_before = [&](const char* what, std::size_t first) {
                fail_at(options_, place_of_value(axis, n),
                        fmt::format("axis {}: value {} is {}, {} value {}, {}: expected each value once",
                                    joined_keys(axis), n + 1, values[n], what, first + 1, values[first]));
            };
            Scene scene;
            std::optional<AxisFiles> files;
            read_placed(options_, {{a, place_of_value(axis, n), values[n]}}, [&] {
                scene = options_.source->read(overrides, SceneUse::without_frames);
                check_measured(axis, n, values[n], scene);
                with_place(options_, place_of_value(axis, n), "",
                           [&] { files = axis_files(axis, values[n], scene); });
            });
            if (files) {
                values[n] = firsts[n] = axis.values.at(n) = axis_value(*files, files->paths);
                const std::size_t first = contents.emplace(files->digest, n).first->second;
                if (first != n && options_.design == Design::grid)
                    fail_as_before("and has the content of", first);
                files_[a].emplace(values[n], std::move(*files));
                continue;
            }
            if (!may_equal) continue;
            const StateHash hash = hash_of_text(nephos::to_toml(scene));
            const std::size_t first = scenes.emplace(std::pair(hash.high, hash.low), n).first->second;
            if (first == n || (!is_compound(values[n]) && !is_compound(values[first]))) continue;
            firsts[n] = values[first];
            if (options_.design == Design::grid) fail_as_before("which is the same as", first);
        }
    }
    // Values that are good alone may contradict each other.
    for (const std::uint64_t point : {std::uint64_t(0), points_ - 1}) {
        if (point >= points_) continue;
        const PlannedRun one = run(point * options_.replicates);
        std::vector<ValueInUse> in_use;
        for (std::size_t a = 0; a < options_.axes.size(); ++a) {
            const Axis& axis = options_.axes[a];
            in_use.push_back({a,
                              is_sampled(options_.design)
                                  ? axis.places.range
                                  : place_of_value(axis, point == 0 ? 0 : axis.values.size() - 1),
                              one.values[a]});
        }
        read_placed(options_, in_use, [&] { measured_lattice(scene_of(one), options_.layer); });
    }
    return equals;
}

// Points of a list, and those of a sample of few values, may have all values in common: their runs would have the same ids.
// Throws Error(usage) that names the first two.
void SweepPlan::require_different_points(const std::vector<std::vector<std::string>>& equals) const {
    const bool may_repeat =
        options_.design == Design::list ||
        (is_sampled(options_.design) &&
         std::ranges::all_of(options_.axes, [&](const Axis& axis) { return may_meet(axis, points_); }));
    if (!may_repeat || options_.axes.empty()) return;
    std::vector<std::tuple<std::uint64_t, std::uint64_t, std::uint64_t>> hashes;
    hashes.reserve(points_);
    for (std::uint64_t point = 0; point < points_; ++point) {
        std::vector<std::string> values = values_of_point(point);
        for (std::size_t n = 0; options_.design == Design::list && n < values.size(); ++n)
            values[n] = equals[n][point];
        const StateHash hash = hash_of_text(identity(values));
        hashes.emplace_back(hash.high, hash.low, point);
    }
    std::ranges::sort(hashes);
    const auto twice = std::ranges::adjacent_find(hashes, [](const auto& a, const auto& b) {
        return std::get<0>(a) == std::get<0>(b) && std::get<1>(a) == std::get<1>(b);
    });
    if (twice == hashes.end()) return;
    const std::uint64_t point = std::get<2>(*twice);
    std::string values = identity(values_of_point(point));
    std::ranges::replace(values, '\n', ' ');
    fail_at(options_, place_of_value(options_.axes.front(), std::get<2>(*std::next(twice))),
            fmt::format("points {} and {} of the {} are the same: {}: expected each point once{}", point + 1,
                        std::get<2>(*std::next(twice)) + 1, design_name(options_.design),
                        values.substr(0, values.size() - 1),
                        is_sampled(options_.design) ? ", as of the values of a grid, or fewer points" : ""));
}

std::vector<std::string> SweepPlan::values_of_point(std::uint64_t point) const {
    std::vector<std::string> values(options_.axes.size());
    for (std::size_t n = options_.axes.size(); n-- > 0;) {
        const Axis& axis = options_.axes[n];
        if (options_.design == Design::grid) {
            values[n] = axis.values[point % axis.values.size()];
            point /= axis.values.size();
        } else if (options_.design == Design::list) {
            values[n] = axis.values[point];
        } else {
            values[n] = value_at(axis, unit_points_[point * options_.axes.size() + n]);
        }
    }
    return values;
}

// The keys and values of a point in the order of the keys, whatever the order of the axes.
std::string SweepPlan::identity(const std::vector<std::string>& values) const {
    std::vector<std::string> lines;
    for (std::size_t n = 0; n < values.size(); ++n) {
        const auto files = files_[n].find(values[n]);
        const std::string value = files == files_[n].end() ? values[n] : "content " + files->second.digest;
        for (const std::string& key : options_.axes[n].keys) lines.push_back(key + "=" + value + "\n");
    }
    std::ranges::sort(lines);
    return fmt::format("{}", fmt::join(lines, ""));
}

PlannedRun SweepPlan::run(std::uint64_t number) const {
    PlannedRun run;
    run.number = number;
    run.point = number / options_.replicates;
    run.replicate = std::uint32_t(number % options_.replicates);
    run.values = values_of_point(run.point);
    const std::string point = identity(run.values);
    const StateHash hash = options_.common_seeds ? StateHash{} : hash_of_text(point);
    PhiloxWords counter = item_counter(Domain::sweep, 0, run.replicate, std::uint32_t(hash.low), 0);
    const std::uint64_t key = options_.seed ^ hash.high;
    const PhiloxWords words = philox(key, counter);
    // 63 bits: every seed is an integer of TOML.
    run.seed = (std::uint64_t(words[0]) << 32 | words[1]) >> 1;
    const StepRules& steps = options_.steps;
    run.id =
        hash_of_text(fmt::format("{}\n{}{}\n{}..{} {} {}\n{} {} {}{}\n", simulation_hash_, point, run.seed,
                                 steps.min, steps.max, steps.until ? steps.until->statistic : "",
                                 steps.until ? number_text(steps.until->standard_error) : "",
                                 options_.clouds_every, options_.layer, NEPHOS_STATISTICS_VERSION,
                                 options_.tracks ? " tracks" : ""))
            .hex();
    return run;
}

Scene SweepPlan::scene_of(const PlannedRun& run) const {
    std::vector<std::string> overrides = options_.overrides;
    for (std::size_t n = 0; n < run.values.size(); ++n)
        for (const std::string& key : options_.axes[n].keys) overrides.push_back(key + "=" + run.values[n]);
    Scene scene = options_.source->read(overrides, SceneUse::without_frames);
    scene.automaton.seed = run.seed;
    return scene;
}

std::optional<std::filesystem::path> SweepPlan::changed_file(const PlannedRun& run) const {
    if (auto changed = first_changed(stamps_)) return changed;
    for (std::size_t n = 0; n < run.values.size(); ++n)
        if (const auto found = files_[n].find(run.values[n]); found != files_[n].end())
            if (auto changed = first_changed(found->second.stamps)) return changed;
    return {};
}

std::string SweepPlan::options_of(const PlannedRun& run) const {
    std::string command;
    for (std::size_t n = 0; n < run.values.size(); ++n)
        for (const std::string& key : options_.axes[n].keys)
            command += fmt::format("--set {} ", shell_word(key + "=" + run.values[n]));
    return command + fmt::format("--seed {}", run.seed);
}

std::string SweepPlan::command_of(const PlannedRun& run, std::uint64_t steps) const {
    return fmt::format("nephos run scene.toml --statistics-only {} --set time.steps={} --out run-{}",
                       options_of(run), steps, run.id.substr(0, 8));
}

std::string SweepPlan::to_toml_in(const std::filesystem::path& folder) const {
    const SweepOptions& o = options_;
    std::string text(kWrittenBySweep);
    text += fmt::format("scene = \"scene.toml\"\ndesign = \"{}\"\n", design_name(o.design));
    if (is_sampled(o.design)) text += fmt::format("points = {}\n", o.points);
    text += fmt::format("replicates = {}\nseed = {}\nseeds = \"{}\"\n", o.replicates, o.seed,
                        o.common_seeds ? "common" : "per_point");
    if (!o.layer.empty()) text += fmt::format("layer = {}\n", toml_string(o.layer));
    if (o.tracks) text += "tracks = true\n";
    text += fmt::format("clouds_every = {}\n\n[steps]\nmin = {}\nmax = {}\n", o.clouds_every, o.steps.min,
                        o.steps.max);
    if (o.steps.until)
        text += fmt::format("until = {{ statistic = \"{}\", standard_error = {} }}\n",
                            o.steps.until->statistic, number_text(o.steps.until->standard_error));
    constexpr std::string_view kScales[] = {"linear", "log", "integer"};
    for (std::size_t a = 0; a < o.axes.size(); ++a) {
        const Axis& axis = o.axes[a];
        text += "\n[[axis]]\n";
        std::vector<std::string> keys;
        for (const std::string& key : axis.keys) keys.push_back(toml_string(key));
        text += fmt::format("keys = [{}]\n", fmt::join(keys, ", "));
        if (axis.values.empty()) {
            text += fmt::format("range = {{ from = {}, to = {}, scale = \"{}\" }}\n", number_text(axis.from),
                                number_text(axis.to), kScales[std::size_t(axis.scale)]);
        } else {
            std::vector<std::string> values = axis.values;
            for (std::string& value : values) {
                const auto found = files_[a].find(value);
                if (found == files_[a].end()) continue;
                std::vector<std::filesystem::path> names;
                for (const std::filesystem::path& path : found->second.paths)
                    names.push_back(placed_path(path, folder));
                value = axis_value(found->second, names);
            }
            text += fmt::format("values = [{}]\n", fmt::join(values, ", "));
        }
    }
    return text;
}

}  // namespace nephos
