// SPDX-License-Identifier: Apache-2.0
#include "study/sweep_plan.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <span>
#include <tuple>

#include "study/axis_files.h"
#include "study/placed_scene.h"
#include "study/run_statistics.h"
#include "study/toml_table.h"
#include <fmt/format.h>

#include "automaton/checkpoint.h"
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

constexpr std::uint64_t kMaxPoints = 10'000'000;

StateHash hash_of_text(std::string_view text) { return hash_of_bytes(std::as_bytes(std::span(text))); }

std::string joined_keys(const Axis& axis) { return fmt::format("{}", fmt::join(axis.keys, "+")); }

bool is_sampled(Design design) { return design != Design::grid && design != Design::list; }

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

// Returns one text for one value: "0.10" is 0.1, a word without quotes gets them, "[1,2]" is "[1, 2]". What is no value
// stays as it is, and whoever reads the scene with it says why.
std::string canonical_value(const std::string& value) {
    if (value.empty() || value == "true" || value == "false") return value;
    if (std::string_view("\"'[{").find(value[0]) != std::string_view::npos)
        return canonical_toml(value).value_or(value);
    const bool has_plus = value[0] == '+' && value.size() > 1 && value[1] != '-';
    const char *begin = value.data() + has_plus, *end = value.data() + value.size();
    std::int64_t whole = 0;
    if (const auto read = std::from_chars(begin, end, whole); read.ec == std::errc() && read.ptr == end) {
        constexpr std::int64_t kExact = std::int64_t(1) << 53;
        if (whole < -kExact || whole > kExact)
            return fmt::format("{}", whole);  // a double may be another number
    }
    double number = 0;
    const auto [last, error] = std::from_chars(begin, end, number);
    if (error == std::errc() && last == end) return number_text(number == 0 ? 0.0 : number);  // one zero only
    // 0x10 and 1_000 are numbers of TOML, too.
    const bool may_be = value.find_first_not_of("0123456789abcdefABCDEFxob_.+-") == value.npos;
    const std::optional<std::string> other = may_be ? canonical_toml(value) : std::nullopt;
    if (other && *other != value) return canonical_value(*other);
    return toml_string(value);
}

bool is_compound(const std::string& value) { return value.starts_with('[') || value.starts_with('{'); }

std::uint64_t point_count(const SweepOptions& options) {
    if (is_sampled(options.design)) return options.points;
    if (options.axes.empty()) return 1;
    std::uint64_t count = 1;
    for (const Axis& axis : options.axes) {
        if (options.design == Design::list) return axis.values.size();
        count *= axis.values.size();
        if (count > kMaxPoints) return count;
    }
    return count;
}

// Two equal values of a grid would be points with the same runs.
void require_different(const Axis& axis, const std::string& name) {
    std::map<std::string_view, std::size_t> places;
    for (std::size_t n = 0; n < axis.values.size(); ++n) {
        const auto [first, is_new] = places.emplace(axis.values[n], n);
        if (!is_new)
            throw Error(ErrorCode::usage,
                        fmt::format("{}: value {} is {}, and so is value {}: expected each value once", name, n + 1,
                                    axis.values[n], first->second + 1));
    }
}

// Refuses keys that overlap: the last one would win, and the id of a run does not tell which that was. Throws Error(usage).
void require_apart(const std::vector<Axis>& axes) {
    const auto fail = [](const std::string& message) { throw Error(ErrorCode::usage, message); };
    std::map<std::string_view, const Axis*> known;
    for (const Axis& axis : axes) {
        for (const std::string& key : axis.keys) {
            const auto [first, is_new] = known.emplace(key, &axis);
            if (is_new) continue;
            if (first->second != &axis) fail("key `" + key + "` is in two axes");
            fail(fmt::format("axis {}: key `{}` is in it twice", joined_keys(axis), key));
        }
    }
    for (const Axis& axis : axes)
        for (const std::string& key : axis.keys)
            for (const std::string& outer : outer_keys(key))
                if (known.contains(outer))
                    fail(fmt::format(
                        "keys `{0}` and `{1}` overlap: a value of `{0}` holds one of `{1}`, and their "
                        "order would decide; expected one of them",
                        outer, key));
}

void check_options(const SweepOptions& options) {
    const auto fail = [](const std::string& message) { throw Error(ErrorCode::usage, message); };
    constexpr std::uint64_t kLargestSeed =
        std::numeric_limits<std::int64_t>::max();  // of the sweep's own file
    if (options.seed > kLargestSeed)
        fail(fmt::format("seed: {} is not from 0 to {}", options.seed, kLargestSeed));
    if (options.replicates < 1 || options.replicates > 100'000)
        fail(fmt::format("replicates: {} is not from 1 to 100,000", options.replicates));
    if (options.steps.min < 20 || options.steps.max < options.steps.min || options.steps.max > kMaxSteps)
        fail(fmt::format("steps: {}..{} is not a range from 20 steps upwards", options.steps.min,
                         options.steps.max));
    if (is_sampled(options.design) && options.axes.empty())
        fail(fmt::format("design '{}': has no axis to take points from: expected --axis KEY=FROM..TO",
                         design_name(options.design)));
    if (!is_sampled(options.design) && options.points > 0)
        fail(fmt::format(
            "points: a design '{}' has the points of its values: expected no number of points, or a "
            "sampled design",
            design_name(options.design)));
    if (options.steps.until && options.clouds_every == 0 && is_of_snapshots(options.steps.until->statistic))
        fail(fmt::format(
            "until: `{}` is of snapshots, and clouds_every = 0 takes none: expected another statistic, or "
            "--clouds-every N",
            options.steps.until->statistic));
    for (const Axis& axis : options.axes) {
        const std::string name = "axis " + joined_keys(axis);
        if (axis.scale == Scale::integer &&
            (axis.from != std::floor(axis.from) || axis.to != std::floor(axis.to)))
            fail(fmt::format("{}: has a range of whole numbers from {} to {}, which are not whole", name,
                             number_text(axis.from), number_text(axis.to)));
        for (const std::string& key : axis.keys) {
            if (key == "seed") fail(name + ": the seed is not an axis: give the number of replicates");
            if (key == "time.steps") fail(name + ": the steps are not an axis: give the range of steps");
            if (key == "time")
                fail(name + ": has the steps in it, which are not an axis: name one of its keys");
            if (key == "name") fail(name + ": the name of the scene changes nothing");
            if (key == "models")
                fail(name +
                     ": files with base models are not an axis: name all of them in the scene, and vary the "
                     "`models` of a sky");
        }
        if (is_sampled(options.design)) {
            if (!axis.values.empty())
                fail(fmt::format("{}: a design '{}' takes a range, not values: expected {}=FROM..TO", name,
                                 design_name(options.design), joined_keys(axis)));
            if (!(axis.to > axis.from)) fail(name + ": the range is empty");
            if (axis.scale == Scale::log && !(axis.from > 0))
                fail(name + ": a range on a log scale starts above 0");
        } else if (axis.values.empty()) {
            fail(fmt::format("{}: has a range without a number of values: expected {}=FROM..TO:COUNT, or --points N "
                             "for a sampled design",
                             name, joined_keys(axis)));
        }
        if (options.design == Design::grid) require_different(axis, name);
        if (options.design == Design::list && axis.values.size() != options.axes.front().values.size())
            fail(fmt::format("{}: has {} values, the first axis {}: a list takes one of each for a point",
                             name, axis.values.size(), options.axes.front().values.size()));
    }
    require_apart(options.axes);
    if (is_sampled(options.design) && (options.points < 1 || options.points > kMaxPoints))
        fail(fmt::format("design '{}': expected points from 1 to {}", design_name(options.design),
                         kMaxPoints));
    if (point_count(options) > kMaxPoints) fail(fmt::format("the grid has more than {} points", kMaxPoints));
}

}  // namespace

std::string canonical_key(std::string_view key) {
    constexpr std::string_view kBlank = " \t";
    const std::size_t first = key.find_first_not_of(kBlank);
    if (first == key.npos) return {};
    key = key.substr(first, key.find_last_not_of(kBlank) - first + 1);
    std::string text;
    for (std::size_t n = 0; n < key.size(); ++n) {
        const bool is_leading = key[n] == '0' && !text.empty() && text.back() == '[';
        if (is_leading && n + 1 < key.size() && key[n + 1] >= '0' && key[n + 1] <= '9') continue;
        text += key[n];
    }
    return text;
}

std::vector<std::string> outer_keys(std::string_view key) {
    std::vector<std::string> outer;
    for (std::size_t n = 1; n < key.size(); ++n)
        if (key[n] == '.' || key[n] == '[') outer.emplace_back(key.substr(0, n));
    return outer;
}

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
        for (std::string& value : axis.values) value = canonical_value(value);
    }
    check_options(options_);
    if (!options_.source) options_.source.emplace(options_.scene_file);
    scene_ = options_.source->read(options_.overrides, SceneUse::without_frames);
    stamps_ = stamps_of(scene_, {FileKind::first_state, FileKind::simulation});
    std::vector<std::string> lattices;
    for (const LayerOptions& layer : scene_.layers)
        if (layer.automaton && !layer.is_veil) lattices.push_back(layer.name);
    if (scene_.layers.empty() ? !options_.layer.empty()
                              : lattices.size() != 1 && std::ranges::count(lattices, options_.layer) == 0) {
        throw Error(
            ErrorCode::usage,
            fmt::format(
                "{}: {}", options_.scene_file.string(),
                scene_.layers.empty()
                    ? "has no layers: leave out --layer"
                    : fmt::format("has the layers with an automaton {}: name one of them with --layer",
                                  fmt::join(lattices, ", "))));
    }
    if (!scene_.layers.empty() && options_.layer.empty()) options_.layer = lattices.front();
    if (options_.tracks && !is_profile(automaton_options(with_files(scene_), measured_lattice()).wind.fields))
        throw Error(ErrorCode::usage,
                    options_.scene_file.string() +
                        ": has a wind that differs within a level, and clouds are followed only in one "
                        "that is the same all over each level: leave out --tracks");
    points_ = point_count(options_);
    if (is_sampled(options_.design))
        unit_points_ = unit_points(options_.design, points_, options_.axes.size(), options_.seed);
    require_different_points(check_axes());
    scene_.frames = {};  // of a study nothing is drawn
    scene_.frames.enabled = false;
    simulation_hash_ = simulation_start(scene_).simulation_hash;
}

std::size_t SweepPlan::measured_lattice() const {
    const auto found = std::ranges::find(scene_.layers, options_.layer, &LayerOptions::name);
    return found == scene_.layers.end() ? 0 : std::size_t(found - scene_.layers.begin());
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
            const Scene scene = options_.source->read(overrides, SceneUse::without_frames);
            if (std::optional<AxisFiles> files = axis_files(axis, values[n], scene)) {
                values[n] = firsts[n] = axis.values.at(n) = axis_value(*files, files->paths);
                const std::size_t first = contents.emplace(files->digest, n).first->second;
                if (first != n && options_.design == Design::grid)
                    throw Error(
                        ErrorCode::usage,
                        fmt::format(
                            "axis {}: value {} is {}, and has the content of value {}, {}: expected each "
                            "value once",
                            joined_keys(axis), n + 1, values[n], first + 1, values[first]));
                files_[a].emplace(values[n], std::move(*files));
                continue;
            }
            if (!may_equal) continue;
            const StateHash hash = hash_of_text(nephos::to_toml(scene));
            const std::size_t first = scenes.emplace(std::pair(hash.high, hash.low), n).first->second;
            if (first == n || (!is_compound(values[n]) && !is_compound(values[first]))) continue;
            firsts[n] = values[first];
            if (options_.design == Design::grid)
                throw Error(
                    ErrorCode::usage,
                    fmt::format("axis {}: value {} is {}, which is the same as value {}, {}: expected each "
                                "value once",
                                joined_keys(axis), n + 1, values[n], first + 1, values[first]));
        }
    }
    // Values that are good alone may contradict each other.
    if (points_ > 0) scene_of(run(0));
    if (points_ > 1) scene_of(run(runs() - 1));
    return equals;
}

// Points of a list, and those of a sample of whole numbers alone, may have all values in common: their runs would have the same
// ids. Throws Error(usage) that names the first two.
void SweepPlan::require_different_points(const std::vector<std::vector<std::string>>& equals) const {
    const bool may_repeat = options_.design == Design::list ||
                            (is_sampled(options_.design) && std::ranges::all_of(options_.axes, [](const Axis& axis) {
                                 return axis.scale == Scale::integer;
                             }));
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
    throw Error(ErrorCode::usage,
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
    if (!o.layer.empty()) text += fmt::format("layer = \"{}\"\n", o.layer);
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
        for (const std::string& key : axis.keys) keys.push_back('"' + key + '"');
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
