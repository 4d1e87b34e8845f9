// SPDX-License-Identifier: Apache-2.0
#include "seeds/sky.h"

#include <algorithm>
#include <cmath>

#include "seeds/checks.h"

namespace nephos {
namespace {

constexpr double kMaxCoordinate = 1e8;

void check_skies(const std::string& where, const SkyOptions& options) {
    if (options.skies.empty()) usage_error(where + " has no sky, expected at least one");
    for (std::size_t i = 0; i < options.skies.size(); ++i) {
        const Sky& sky = options.skies[i];
        const std::string which = where + ", sky \"" + sky.name + "\"";
        require_in(which + ": state", sky.state, 0, 1);
        require_in(which + ": number of clouds", sky.clouds, 0, 100000);
        if (sky.clouds > 0 && sky.models.empty()) {
            usage_error(which + " has " + std::to_string(sky.clouds) +
                        " clouds and no base model, expected at least one");
        }
        for (const SkyModel& m : sky.models) {
            if (m.model >= options.models.size()) {
                usage_error(which + ": base model " + std::to_string(m.model) +
                            " does not exist, there are " + std::to_string(options.models.size()));
            }
            require_in(which + ": clouds generated of \"" + options.models[m.model].name + "\"", m.generated,
                       1, 65536);
        }
        for (std::size_t j = 0; j < i; ++j) {
            if (options.skies[j].state == sky.state) {
                usage_error(where + ": the skies \"" + options.skies[j].name + "\" and \"" + sky.name +
                            "\" have the same state " + text_of(sky.state) + "; only one sky may have it");
            }
        }
    }
}

// Refuses skies with too many boxes before the first cloud is generated, which would take hours and all
// memory.
void check_number_of_boxes(const std::string& where, const SkyOptions& options) {
    std::vector<std::int64_t> generated(options.models.size(), 0);
    for (const Sky& sky : options.skies) {
        std::int64_t largest = 0;
        for (const SkyModel& m : sky.models) {
            generated[m.model] = std::max<std::int64_t>(generated[m.model], m.generated);
            largest = std::max(largest, largest_cloud(options.models[m.model]));
        }
        for (const Metamorphosis& m : options.metamorphoses)
            largest = std::max(largest, largest_cloud(options.models[m.to]));
        if (sky.clouds * largest > kMaxSkyBoxes) {
            usage_error(where + ", sky \"" + sky.name + "\": " + std::to_string(sky.clouds) +
                        " clouds of up to " + std::to_string(largest) + " seeds each, at most " +
                        std::to_string(kMaxSkyBoxes) + " seeds are possible");
        }
    }
    for (std::size_t round = 0; round < options.metamorphoses.size(); ++round)
        for (const Metamorphosis& m : options.metamorphoses)
            generated[m.to] = std::max(generated[m.to], generated[m.from]);
    std::int64_t boxes = 0;
    for (std::size_t m = 0; m < generated.size(); ++m)
        boxes += generated[m] * largest_cloud(options.models[m]);
    if (boxes > kMaxShapeBoxes) {
        usage_error(where + ": the clouds generated of its base models have up to " + std::to_string(boxes) +
                    " seeds, at most " + std::to_string(kMaxShapeBoxes) + " are possible");
    }
}

void check_schedule(const std::string& where, const std::vector<StatePoint>& schedule) {
    if (schedule.empty())
        usage_error(where + " has an empty schedule of states, expected at least one point");
    for (std::size_t i = 0; i < schedule.size(); ++i) {
        require_in(where + ": state in the schedule", schedule[i].state, 0, 1);
        if (!std::isfinite(schedule[i].time_s))
            usage_error(where + ": a time in the schedule of states is not finite");
        if (i > 0 && !(schedule[i].time_s > schedule[i - 1].time_s)) {
            usage_error(where + ": times in the schedule of states must rise, " +
                        text_of(schedule[i].time_s) + " s follows " + text_of(schedule[i - 1].time_s) + " s");
        }
    }
}

void check_metamorphoses(const std::string& where, const SkyOptions& options) {
    const auto& all = options.metamorphoses;
    for (const Metamorphosis& m : all) {
        if (m.from >= options.models.size() || m.to >= options.models.size())
            usage_error(where + ": a base model of a metamorphosis does not exist, there are " +
                        std::to_string(options.models.size()));
        const std::string which = where + ", metamorphosis of \"" + options.models[m.from].name + "\"";
        require_range(which + ": state", m.state.min, m.state.max, 0, 1);
        if (!(m.state.min < m.state.max)) usage_error(which + ": its states have no width, expected min < max");
        if (std::ranges::count(all, m.from, &Metamorphosis::from) > 1)
            usage_error(which + " is given twice, expected one change of a base model");
        std::size_t model = m.to;
        for (std::size_t step = 0; step <= all.size(); ++step) {
            if (model == m.from) usage_error(which + " leads back to it, expected a chain with an end");
            const auto next = std::ranges::find(all, model, &Metamorphosis::from);
            if (next == all.end()) break;
            model = next->to;
        }
    }
    require_in(where + ": time of shear (s)", options.shear_s, 0, 1e6);
}

}  // namespace

void check(const SkyOptions& options) {
    const std::string where = "layer \"" + options.name + "\"";
    require_in(where + ": layer number", options.layer, 0, 65535);
    const WorldRectangle& w = options.world;
    for (double value : {w.min_x_m, w.min_y_m, w.max_x_m, w.max_y_m}) {
        require_in(where + ": world rectangle (m)", value, -kMaxCoordinate, kMaxCoordinate);
    }
    if (!(w.min_x_m < w.max_x_m && w.min_y_m < w.max_y_m)) {
        usage_error(where + ": the world rectangle from (" + text_of(w.min_x_m) + ", " + text_of(w.min_y_m) +
                    ") to (" + text_of(w.max_x_m) + ", " + text_of(w.max_y_m) + ") m has no area");
    }
    require_range(where + ": base height (m)", options.base_height_m.min, options.base_height_m.max, -1e5,
                  1e5);
    require_positive(where + ": time step (s)", options.time_step_s);
    require_in(where + ": formation (s)", options.formation_s, 0, 1e9);
    require_in(where + ": dissolution (s)", options.dissolution_s, 0, 1e9);
    require_in(where + ": softness of formation", options.formation_softness, 1e-3, 1e3);
    if (options.models.size() > 65536) usage_error(where + ": more than 65536 base models");
    for (const BaseModel& model : options.models) check(model);
    check_skies(where, options);
    check_metamorphoses(where, options);
    check_number_of_boxes(where, options);
    check_schedule(where, options.schedule);
}

}  // namespace nephos
