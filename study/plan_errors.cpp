// SPDX-License-Identifier: Apache-2.0
#include "study/plan_errors.h"

#include <algorithm>
#include <string_view>
#include <utility>
#include <vector>

#include "scenes/format/document.h"
#include "scenes/format/override.h"

namespace nephos {
namespace {

bool is_known(const SweepOptions& options, PlanPlace place) {
    return place.line > 0 && options.file != nullptr;
}

Problem problem_at(const SweepOptions& options, PlanPlace place, std::string message, std::string expected) {
    Document document;
    const int origin = document.add_origin(options.file->label, options.file->text, true);
    return document.problem_at({origin, place.line, place.column}, std::move(message), std::move(expected));
}

// An option with which the scene is read, and where it stands in the plan.
struct PlacedOption {
    std::string label;
    std::size_t key_size;  // columns up to there are of the key
    PlanPlace key, value;
};

std::vector<PlacedOption> placed_options(const SweepOptions& options, const std::vector<ValueInUse>& values) {
    std::vector<PlacedOption> all;
    for (std::size_t n = 0; n < options.overrides.size(); ++n) {
        const PlanPlace place =
            n < options.places.overrides.size() ? options.places.overrides[n] : PlanPlace{};
        all.push_back({option_label(options.overrides[n]), 0, place, place});
    }
    for (const ValueInUse& one : values) {
        const Axis& axis = options.axes[one.axis];
        for (std::size_t key = 0; key < axis.keys.size(); ++key)
            all.push_back({option_label(axis.keys[key] + "=" + one.value), axis.keys[key].size(),
                           place_of_key(axis, key), one.place});
    }
    return all;
}

// Returns the place of the option that a problem is of; nowhere where it is of the scene's own text, or of one of several.
PlanPlace place_of(const Problem& problem, const std::vector<PlacedOption>& options) {
    if (problem.where.line > 0) return {};
    const auto is_its = [&](const PlacedOption& one) { return one.label == problem.where.file; };
    if (std::ranges::count_if(options, is_its) != 1) return {};
    const PlacedOption& one = *std::ranges::find_if(options, is_its);
    return problem.where.column <= int(one.key_size) ? one.key : one.value;
}

}  // namespace

void fail_at(const SweepOptions& options, PlanPlace place, const std::string& message, ErrorCode code) {
    if (!is_known(options, place)) throw Error(code, message);
    constexpr std::string_view kExpected = ": expected ";
    const std::size_t at = message.rfind(kExpected);
    const bool says_more = at != message.npos;
    throw SceneErrors(
        {problem_at(options, place, message.substr(0, at), says_more ? message.substr(at + 2) : "")}, code);
}

PlanPlace place_of_key(const Axis& axis, std::size_t n) {
    return n < axis.places.keys.size() ? axis.places.keys[n] : PlanPlace{};
}

PlanPlace place_of_value(const Axis& axis, std::size_t n) {
    if (n < axis.places.values.size()) return axis.places.values[n];
    if (n == 0) return axis.places.from;
    return n + 1 >= axis.values.size() ? axis.places.to : axis.places.range;
}

void read_placed(const SweepOptions& options, const std::vector<ValueInUse>& values,
                 const std::function<void()>& read) {
    try {
        read();
    } catch (const SceneErrors& errors) {
        std::vector<Problem> problems = errors.problems();
        const std::vector<PlacedOption> placed = placed_options(options, values);
        for (Problem& problem : problems) {
            const PlanPlace place = place_of(problem, placed);
            if (is_known(options, place))
                problem = problem_at(options, place, problem.message, problem.expected);
        }
        throw SceneErrors(std::move(problems), errors.code());
    }
}

}  // namespace nephos
