// SPDX-License-Identifier: Apache-2.0
#include "study/sweep_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <memory>
#include <unordered_set>

#include "study/run_statistics.h"
#include "study/toml_table.h"
#include <fmt/format.h>

#include "core/error.h"
#include "core/math.h"
#include "core/text.h"
#include "scenes/format/named_files.h"
#include "scenes/format/text.h"
#include "simulation/layer_simulation.h"

namespace nephos {
namespace {

constexpr double kLargest = std::numeric_limits<double>::max();
constexpr std::uint64_t kMostValues = 100'000;
const std::vector<std::string_view> kScaleNames{"linear", "log", "integer"};

PlanPlace plan_place(const Place& place) { return {place.line, place.column}; }

// Where a key stands in a file; nowhere, where it is missing.
PlanPlace place_in(TomlTable& table, std::string_view key) {
    return table.has(key) ? plan_place(table.place(key)) : PlanPlace{};
}

std::vector<PlanPlace> places_in(TomlTable& table, std::string_view key) {
    std::vector<PlanPlace> places;
    for (const Place& place : table.item_places(key)) places.push_back(plan_place(place));
    return places;
}

void read_range(TomlTable& range, Axis& axis) {
    axis.places.from = place_in(range, "from");
    axis.places.to = place_in(range, "to");
    const std::optional<double> from = range.number("from", -kLargest, kLargest),
                                to = range.number("to", -kLargest, kLargest);
    axis.scale = Scale(range.word("scale", kScaleNames).value_or(0));
    const std::optional<std::uint64_t> count = range.integer("count", 2, kMostValues);
    for (const char* name : {"from", "to"})
        if (!range.has(name))
            range.report(name, fmt::format("the range has no `{}`", name),
                         "expected range = { from = 0.05, to = 0.4, count = 8 }");
    if (!from || !to) return;
    axis.from = *from;
    axis.to = *to;
    if (!(axis.to > axis.from))
        return range.report("to", "the range of an axis is empty", "expected `to` above `from`");
    if (axis.scale == Scale::log && !(axis.from > 0))
        return range.report("from", "a range on a log scale starts at or below 0", "expected `from` above 0");
    if (axis.scale == Scale::log && !std::isfinite(axis.to / axis.from))
        return range.report("from", "a range on a log scale spans more than numbers do",
                            "expected `from` and `to` with a ratio below 1.7e308");
    if (!count) return;
    axis.values = spread_values(axis.from, axis.to, *count, axis.scale);
    if (axis.values.size() < *count && axis.scale != Scale::integer)
        range.report("count",
                     fmt::format("the range has {} different values of 12 digits", axis.values.size()),
                     "expected a wider range, or fewer values");
}

void read_axis(TomlTable& table, const std::filesystem::path& folder, SweepOptions& options) {
    Axis& axis = options.axes.emplace_back();
    axis.folder = folder;
    if (const auto key = table.text("key")) axis.keys = {*key};
    for (std::string& key : table.texts("keys")) axis.keys.push_back(std::move(key));
    axis.places.keys = places_in(table, "key");
    for (const PlanPlace& place : places_in(table, "keys")) axis.places.keys.push_back(place);
    if (axis.keys.empty())
        table.report("key", "an axis has no key", "expected key = \"field.background.ext\", or keys = [...]");
    axis.values = table.values("values");
    axis.places.values = places_in(table, "values");
    axis.places.range = place_in(table, "range");
    table.table("range", [&](TomlTable& range) { read_range(range, axis); });
    if (table.has("values") && table.has("range"))
        table.report("range", "an axis has both values and a range", "expected one of them");
    if (axis.values.empty() && !table.has("range"))
        table.report("values", "an axis has no values",
                     "expected values = [...], or range = { from = .., to = .., count = .. }");
}

// One name for one statistic, whichever the user gave. Throws as statistic_index().
std::string statistic_name(std::string_view given) {
    return std::string(kStatistics[statistic_index(given)].name);
}

void read_steps(TomlTable& table, StepRules& rules) {
    rules.min = table.integer("min", 20, kMaxSteps).value_or(rules.min);
    rules.max = table.integer("max", rules.min, kMaxSteps).value_or(std::max(rules.min, rules.max));
    table.table("until", [&](TomlTable& until) {
        StopAt stop;
        std::vector<std::string_view> names;
        for (const StatisticInfo& info : kStatistics) names.push_back(info.name);
        names.push_back(kCoverInFiles);
        stop.statistic = statistic_name(names[until.word("statistic", names).value_or(0)]);
        stop.standard_error =
            until.number("standard_error", std::numeric_limits<double>::min(), kLargest).value_or(1);
        if (!until.has("statistic") || !until.has("standard_error"))
            until.report("statistic", "`until` needs a statistic and a standard error",
                         "expected { statistic = \"cover\", standard_error = 0.002 }");
        rules.until = stop;
    });
}

double parse_number(std::string_view text, const std::string& whole) {
    double number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error == std::errc() && end == text.data() + text.size() && std::isfinite(number)) return number;
    throw Error(ErrorCode::usage, fmt::format("'{}': '{}' is not a number", whole, text));
}

// Returns the text with zeros in place of what is inside quotes or brackets, and of these.
std::string outside(std::string_view text) {
    std::string outer;
    int depth = 0;
    char quote = 0;
    bool escaped = false;
    for (const char c : text) {
        bool is_inside = depth > 0 || quote != 0;
        if (quote != 0) {
            if (c == quote && !escaped) quote = 0;
            escaped = quote == '"' && c == '\\' && !escaped;
        } else if (c == '"' || c == '\'') {
            quote = c;
        } else if (c == '[' || c == '{') {
            ++depth;
        } else if (c == ']' || c == '}') {
            --depth;
        }
        is_inside = is_inside || depth > 0 || quote != 0;
        outer += is_inside ? '\0' : c;
    }
    return outer;
}

// Cuts at separators that are not inside quotes or brackets.
std::vector<std::string> pieces(std::string_view text, char separator) {
    std::vector<std::string> parts;
    const std::string outer = outside(text);
    std::size_t begin = 0;
    for (std::size_t end = 0; end != outer.npos; begin = end + 1) {
        end = outer.find(separator, begin);
        parts.emplace_back(text.substr(begin, end == outer.npos ? end : end - begin));
    }
    return parts;
}

std::string_view trimmed(std::string_view text) {
    constexpr std::string_view kBlank = " \t\r\n";
    const std::size_t first = text.find_first_not_of(kBlank);
    if (first == text.npos) return {};
    return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

SweepOptions read_sweep_text(std::string text, const std::filesystem::path& path) {
    SweepOptions options;
    options.file = std::make_shared<const PlanFile>(PlanFile{path.string(), text});
    read_toml_text(std::move(text), path.string(), [&](TomlTable& table) {
        const std::optional<std::string> scene = table.text("scene");
        if (!scene && !table.has("scene"))
            table.report("scene", "the sweep has no scene", "expected scene = \"FILE.toml\"");
        if (scene && names_no_file(*scene))
            table.report("scene", "`scene` names no file", "expected scene = \"FILE.toml\"");
        options.scene_file = path.parent_path() / scene.value_or("");
        options.overrides = table.texts("set");
        options.places = {places_in(table, "set"),
                          place_in(table, "scene"),
                          place_in(table, "design"),
                          place_in(table, "points"),
                          {},
                          place_in(table, "layer"),
                          place_in(table, "tracks")};
        options.design = Design(table.word("design", {"grid", "list", "random", "latin_hypercube", "sobol"})
                                    .value_or(std::size_t(Design::grid)));
        options.points = table.integer("points", 1, 10'000'000).value_or(0);
        options.replicates =
            std::uint32_t(table.integer("replicates", 1, 100'000).value_or(options.replicates));
        options.seed =
            table.integer("seed", 0, std::numeric_limits<std::int64_t>::max()).value_or(options.seed);
        options.common_seeds = table.word("seeds", {"per_point", "common"}).value_or(0) == 1;
        options.clouds_every =
            int(table.integer("clouds_every", 0, 1'000'000).value_or(std::uint64_t(options.clouds_every)));
        options.tracks = table.flag("tracks").value_or(false);
        options.layer = table.text("layer").value_or("");
        table.table("steps", [&](TomlTable& steps) {
            options.places.until = place_in(steps, "until");
            read_steps(steps, options.steps);
        });
        const std::optional<std::string> place = table.text("folder");
        if (place && names_no_file(*place))
            table.report("folder", "`folder` names no folder", "expected that of files among the values");
        const std::filesystem::path folder = path.parent_path() / place.value_or("");
        table.tables("axis", [&](TomlTable& axis) { read_axis(axis, folder, options); });
    });
    return options;
}

bool is_sweep_text(const std::string& text, const std::filesystem::path& path) {
    bool has_scene = false;
    try {
        // Leaves what else is wrong to whoever reads the file for good.
        read_toml_text(text, path.string(), [&](TomlTable& table) { has_scene = table.has("scene"); });
    } catch (const SceneErrors&) {
    }
    return has_scene;
}

}  // namespace

std::vector<std::string> spread_values(double from, double to, std::uint64_t count, Scale scale) {
    std::vector<std::string> values;
    std::unordered_set<std::string> known;
    for (std::uint64_t n = 0; n < count; ++n) {
        const double unit = double(n) / double(count - 1);
        double value = scale == Scale::log ? geometric(from, to, unit) : from + unit * (to - from);
        if (n == 0) value = from;
        if (n + 1 == count) value = to;
        if (scale == Scale::integer) value = std::floor(value + 0.5);
        // 12 digits: 0.1..0.3:3 has the value 0.2, and not the double beside it.
        std::string text = number_text(value, 12);
        if (known.insert(text).second) values.push_back(std::move(text));
    }
    return values;
}

Axis parse_axis(const std::string& text) {
    const std::size_t equals = text.find('=');
    const auto fail = [&](const std::string& message) {
        throw Error(ErrorCode::usage,
                    fmt::format("'{}' {}: expected KEY=V,V,.. or KEY=FROM..TO:COUNT, KEY=log:FROM..TO:COUNT",
                                text, message));
    };
    if (equals == text.npos || equals == 0) fail("is not an axis");
    Axis axis;
    axis.keys = pieces(std::string_view(text).substr(0, equals), '+');
    std::string_view rest = trimmed(std::string_view(text).substr(equals + 1));
    for (std::size_t n = 0; n < kScaleNames.size(); ++n) {
        const std::string prefix = std::string(kScaleNames[n]) + ":";
        if (!rest.starts_with(prefix)) continue;
        axis.scale = Scale(n);
        rest.remove_prefix(prefix.size());
    }
    const std::size_t dots = outside(rest).find("..");
    const bool is_file = rest.find('/') != rest.npos;  // "../a.vdb"
    const bool is_range =
        dots != rest.npos && !is_file && std::string_view("\"'[{").find(rest[0]) == std::string_view::npos;
    if (!is_range) {
        if (axis.scale != Scale::linear) fail("names a scale but no range");
        for (const std::string& value : pieces(rest, ',')) axis.values.emplace_back(trimmed(value));
        if (std::ranges::count(axis.values, "") > 0) fail("has an empty value");
        return axis;
    }
    if (rest.substr(dots).starts_with("..."))
        fail("has three dots, which may be one of either number: write 0.1 and not .1");
    const std::size_t colon = rest.find(':', dots);
    axis.from = parse_number(rest.substr(0, dots), text);
    axis.to = parse_number(rest.substr(dots + 2, colon == rest.npos ? colon : colon - dots - 2), text);
    if (!(axis.to > axis.from))
        fail(fmt::format("has a range from {} to {}, which is not FROM below TO", number_text(axis.from),
                         number_text(axis.to)));
    if (axis.scale == Scale::log && !(axis.from > 0))
        fail("has a range on a log scale that does not start above 0");
    if (axis.scale == Scale::log && !std::isfinite(axis.to / axis.from))
        fail("has a range on a log scale that spans more than numbers do");
    if (colon != rest.npos) {
        const double count = parse_number(rest.substr(colon + 1), text);
        if (!(count >= 2 && count <= double(kMostValues) && count == std::floor(count)))
            fail("has a count that is not a whole number from 2 to 100,000");
        axis.values = spread_values(axis.from, axis.to, std::uint64_t(count), axis.scale);
        if (axis.values.size() < std::uint64_t(count) && axis.scale != Scale::integer)
            fail(fmt::format("has a range of {} different values of 12 digits, fewer than asked for",
                             axis.values.size()));
    }
    return axis;
}

StopAt parse_stop(const std::string& text) {
    const std::size_t equals = text.find('=');
    if (equals == text.npos || !text.substr(0, equals).ends_with(".se"))
        throw Error(ErrorCode::usage, fmt::format("'{}' is not like cover.se=0.002", text));
    const StopAt stop{statistic_name(text.substr(0, equals - 3)),
                      parse_number(std::string_view(text).substr(equals + 1), text)};
    if (!(stop.standard_error > 0))
        throw Error(ErrorCode::usage, fmt::format("'{}': a standard error is above 0", text));
    return stop;
}

SweepOptions read_sweep_file(const std::filesystem::path& path) {
    return read_sweep_text(read_text_file(path, kMaxSceneBytes, "scene"), path);
}

SweepOptions read_sweep_file_or_scene(const std::filesystem::path& path) {
    std::string text = read_text_file(path, kMaxSceneBytes, "scene");
    if (is_sweep_text(text, path)) return read_sweep_text(std::move(text), path);
    SweepOptions options;
    options.scene_file = path;
    options.source.emplace(std::move(text), path);
    return options;
}

}  // namespace nephos
