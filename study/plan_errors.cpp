// SPDX-License-Identifier: Apache-2.0
#include "study/plan_errors.h"

#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "core/text.h"
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

// Returns the place in an axis of what an option sets; none where it is not of the axis.
std::optional<PlanPlace> place_of(const SourcePosition& where, const Axis& axis) {
    std::vector<std::string> values = axis.values;
    if (values.empty()) values = {number_text(axis.from), number_text(axis.to)};
    for (std::size_t key = 0; key < axis.keys.size(); ++key)
        for (std::size_t n = 0; n < values.size(); ++n)
            if (where.file == option_label(axis.keys[key] + "=" + values[n]))
                return where.column <= int(axis.keys[key].size()) ? place_of_key(axis, key)
                                                                  : place_of_value(axis, n);
    return {};
}

// Returns the place of the option that a problem is of; nowhere where it is of the scene's own text.
PlanPlace place_of(const Problem& problem, const SweepOptions& options) {
    if (problem.where.line > 0) return {};
    for (const Axis& axis : options.axes)
        if (const std::optional<PlanPlace> place = place_of(problem.where, axis)) return *place;
    for (std::size_t n = 0; n < options.override_places.size(); ++n)
        if (problem.where.file == option_label(options.overrides[n])) return options.override_places[n];
    return {};
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

void read_placed(const SweepOptions& options, const std::function<void()>& read) {
    try {
        read();
    } catch (const SceneErrors& errors) {
        std::vector<Problem> problems = errors.problems();
        for (Problem& problem : problems) {
            const PlanPlace place = place_of(problem, options);
            if (is_known(options, place))
                problem = problem_at(options, place, problem.message, problem.expected);
        }
        throw SceneErrors(std::move(problems), errors.code());
    }
}

}  // namespace nephos
