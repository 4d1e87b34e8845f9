// SPDX-License-Identifier: Apache-2.0
#include "study/plan_memory.h"

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "study/plan_checks.h"
#include <fmt/format.h>

#include "core/error.h"
#include "core/text.h"
#include "scenes/format/errors.h"
#include "simulation/layer_simulation.h"
#include "simulation/memory.h"

namespace nephos {
namespace {

// The run that takes most.
struct Largest {
    std::size_t bytes = 0;
    std::vector<std::string> values;  // of each axis
};

bool may_take_memory(const Axis& axis) {
    return std::ranges::any_of(axis.keys, [](const std::string& key) {
        return key.starts_with("lattice") || key.starts_with("layer") || key.starts_with("wind_field");
    });
}

std::size_t bytes_of(const Scene& scene) {
    std::size_t bytes = 0;
    for (std::size_t n = 0; n < lattice_count(scene); ++n)
        if (scene.layers.empty() || !scene.layers[n].is_veil)
            bytes += Automaton::memory_bytes(automaton_options(scene, n));
    return bytes;
}

// Takes the run with these values where it takes more. Values that contradict each other take nothing: their run fails.
void compare(const SweepPlan& plan, const std::vector<std::string>& values, Largest& largest) {
    PlannedRun run;
    run.values = values;
    try {
        const std::size_t bytes = bytes_of(plan.scene_of(run));
        if (bytes > largest.bytes) largest = {bytes, values};
    } catch (const SceneErrors&) {
    }
}

// Takes for one axis after the other the value that needs most beside those of the axes before: numbers of cells multiply.
Largest largest_of_axes(const SweepPlan& plan) {
    std::vector<std::vector<std::string>> values;
    std::vector<std::string> first;
    for (const Axis& axis : plan.options().axes) {
        values.push_back(axis.values);
        if (axis.values.empty()) values.back() = {number_text(axis.from), number_text(axis.to)};
        first.push_back(values.back().front());
    }
    Largest largest;
    compare(plan, first, largest);
    if (largest.values.empty()) largest.values = first;
    for (std::size_t axis = 0; axis < values.size(); ++axis) {
        if (!may_take_memory(plan.options().axes[axis])) continue;
        std::vector<std::string> point = largest.values;
        for (const std::string& value : values[axis]) {
            point[axis] = value;
            compare(plan, point, largest);
        }
    }
    return largest;
}

Largest largest_run(const SweepPlan& plan) {
    if (std::ranges::none_of(plan.options().axes, may_take_memory)) return {bytes_of(plan.scene()), {}};
    if (plan.options().design != Design::list) return largest_of_axes(plan);
    Largest largest;
    for (std::uint64_t point = 0; point < plan.points(); ++point)
        compare(plan, plan.values_of_point(point), largest);
    return largest;
}

}  // namespace

void require_memory_for(const SweepPlan& plan, int workers) {
    const Largest largest = largest_run(plan);
    const auto count = std::size_t(workers);
    std::vector<std::string> settings;
    for (std::size_t n = 0; n < largest.values.size(); ++n)
        if (may_take_memory(plan.options().axes[n]))
            settings.push_back(joined_keys(plan.options().axes[n]) + "=" + largest.values[n]);
    constexpr std::size_t kMost = std::numeric_limits<std::size_t>::max();
    require_memory(largest.bytes > kMost / count ? kMost : largest.bytes * count,
                   count == 1
                       ? fmt::format("a run{}{}", settings.empty() ? "" : " of ", fmt::join(settings, ", "))
                       : fmt::format("{} workers with a run each{}{}", count, settings.empty() ? "" : " of ",
                                     fmt::join(settings, ", ")));
}

}  // namespace nephos
