// SPDX-License-Identifier: Apache-2.0
#include "study/plan_checks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string_view>
#include <utility>

#include "study/axis_text.h"
#include "study/plan_errors.h"
#include "study/run_statistics.h"
#include <fmt/format.h>

#include "core/error.h"
#include "core/text.h"
#include "simulation/layer_simulation.h"

namespace nephos {
namespace {

constexpr std::uint64_t kMaxPoints = 10'000'000;

// Two equal values of a grid would be points with the same runs.
void require_different(const SweepOptions& options, const Axis& axis) {
    std::map<std::string_view, std::size_t> places;
    for (std::size_t n = 0; n < axis.values.size(); ++n) {
        const auto [first, is_new] = places.emplace(axis.values[n], n);
        if (!is_new)
            fail_at(options, place_of_value(axis, n),
                    fmt::format("axis {}: value {} is {}, and so is value {}: expected each value once",
                                joined_keys(axis), n + 1, axis.values[n], first->second + 1));
    }
}

// Refuses keys that overlap: the last one would win, and the id of a run does not tell which that was.
void require_apart(const SweepOptions& options) {
    std::map<std::string_view, const Axis*> known;
    const auto each_key = [&](const auto& check) {
        for (const Axis& axis : options.axes)
            for (std::size_t n = 0; n < axis.keys.size(); ++n)
                check(axis, axis.keys[n], place_of_key(axis, n));
    };
    each_key([&](const Axis& axis, const std::string& key, PlanPlace place) {
        const auto [first, is_new] = known.emplace(key, &axis);
        if (is_new) return;
        if (first->second != &axis) fail_at(options, place, "key `" + key + "` is in two axes");
        fail_at(options, place, fmt::format("axis {}: key `{}` is in it twice", joined_keys(axis), key));
    });
    each_key([&](const Axis&, const std::string& key, PlanPlace place) {
        for (const std::string& outer : outer_keys(key))
            if (known.contains(outer))
                fail_at(options, place,
                        fmt::format(
                            "keys `{0}` and `{1}` overlap: a value of `{0}` holds one of `{1}`, and their "
                            "order would decide: expected one of them",
                            outer, key));
    });
}

// Refuses what is no key, and keys that are no axis of a sweep.
void require_keys(const SweepOptions& options, const Axis& axis) {
    constexpr std::pair<std::string_view, std::string_view> kNoAxes[] = {
        {"seed", "the seed is not an axis: give the number of replicates"},
        {"time.steps", "the steps are not an axis: give the range of steps"},
        {"time", "has the steps in it, which are not an axis: name one of its keys"},
        {"name", "the name of the scene changes nothing"},
        {"models",
         "files with base models are not an axis: name all of them in the scene, and vary the `models` of a "
         "sky"}};
    for (std::size_t n = 0; n < axis.keys.size(); ++n) {
        const PlanPlace place = place_of_key(axis, n);
        if (const std::string problem = no_key_text(axis.keys[n]); !problem.empty())
            fail_at(options, place, problem + ": " + std::string(kExpectedKey));
        for (const auto& [key, why] : kNoAxes)
            if (axis.keys[n] == key)
                fail_at(options, place, fmt::format("axis {}: {}", joined_keys(axis), why));
    }
}

// Checks what an axis takes its points from.
void require_values(const SweepOptions& options, const Axis& axis) {
    const std::string name = "axis " + joined_keys(axis);
    const AxisPlaces& places = axis.places;
    const auto fail = [&](PlanPlace place, const std::string& message) {
        fail_at(options, place.line > 0 ? place : place_of_key(axis, 0), name + message);
    };
    if (axis.scale == Scale::integer &&
        (axis.from != std::floor(axis.from) || axis.to != std::floor(axis.to)))
        fail(places.range, fmt::format(": has a range of whole numbers from {} to {}, which are not whole",
                                       number_text(axis.from), number_text(axis.to)));
    if (is_sampled(options.design)) {
        if (!axis.values.empty())
            fail(place_of_value(axis, 0),
                 fmt::format(": a design '{}' takes a range, not values: expected {}=FROM..TO",
                             design_name(options.design), joined_keys(axis)));
        if (!(axis.to > axis.from)) fail(places.to, ": the range is empty");
        if (axis.scale == Scale::log && !(axis.from > 0))
            fail(places.from, ": a range on a log scale starts above 0");
    } else if (axis.values.empty()) {
        fail(
            places.range,
            fmt::format(": has a range without a number of values: expected {}=FROM..TO:COUNT, or --points N "
                        "for a sampled design",
                        joined_keys(axis)));
    }
    if (options.design == Design::grid) require_different(options, axis);
    if (options.design == Design::list && axis.values.size() != options.axes.front().values.size())
        fail({}, fmt::format(": has {} values, the first axis {}: a list takes one of each for a point",
                             axis.values.size(), options.axes.front().values.size()));
}

}  // namespace

std::string joined_keys(const Axis& axis) { return fmt::format("{}", fmt::join(axis.keys, "+")); }

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

void check_options(const SweepOptions& options) {
    const PlanPlaces& places = options.places;
    const auto fail = [&](PlanPlace place, const std::string& message) { fail_at(options, place, message); };
    constexpr std::uint64_t kLargestSeed =
        std::numeric_limits<std::int64_t>::max();  // of the sweep's own file
    if (options.seed > kLargestSeed)
        fail({}, fmt::format("seed: {} is not from 0 to {}", options.seed, kLargestSeed));
    if (options.replicates < 1 || options.replicates > 100'000)
        fail({}, fmt::format("replicates: {} is not from 1 to 100,000", options.replicates));
    if (options.steps.min < 20 || options.steps.max < options.steps.min || options.steps.max > kMaxSteps)
        fail({}, fmt::format("steps: {}..{} is not a range from 20 steps upwards", options.steps.min,
                             options.steps.max));
    if (is_sampled(options.design) && options.axes.empty())
        fail(places.design,
             fmt::format("design '{}': has no axis to take points from: expected --axis KEY=FROM..TO",
                         design_name(options.design)));
    if (!is_sampled(options.design) && options.points > 0)
        fail(places.points,
             fmt::format(
                 "points: a design '{}' has the points of its values: expected no number of points, or a "
                 "sampled design",
                 design_name(options.design)));
    if (options.steps.until && options.clouds_every == 0 && is_of_snapshots(options.steps.until->statistic))
        fail(places.until, fmt::format("until: `{}` is of snapshots, and clouds_every = 0 takes none: "
                                       "expected another statistic, or "
                                       "--clouds-every N",
                                       options.steps.until->statistic));
    for (const Axis& axis : options.axes) {
        require_keys(options, axis);
        require_values(options, axis);
    }
    require_apart(options);
    if (is_sampled(options.design) && (options.points < 1 || options.points > kMaxPoints))
        fail(places.points.line > 0 ? places.points : places.design,
             fmt::format("design '{}': expected points from 1 to {}", design_name(options.design),
                         kMaxPoints));
    if (point_count(options) > kMaxPoints)
        fail({}, fmt::format("the grid has more than {} points", kMaxPoints));
}

}  // namespace nephos
