// SPDX-License-Identifier: Apache-2.0
#include "seeds/climate.h"

#include <algorithm>
#include <cmath>

#include "seeds/checks.h"

namespace nephos {

std::vector<StatePoint> straight_schedule(double initial_state, double final_state, double duration_s) {
    require_in("initial state", initial_state, 0, 1);
    require_in("final state", final_state, 0, 1);
    if (!(duration_s >= 0) || !std::isfinite(duration_s)) {
        usage_error("duration (s) is " + text_of(duration_s) + ", expected 0 or more");
    }
    if (duration_s == 0) return {{0, final_state}};
    return {{0, initial_state}, {duration_s, final_state}};
}

double state_at(std::span<const StatePoint> schedule, double time_s) {
    if (schedule.empty()) usage_error("the schedule of states is empty, expected at least one point");
    const auto after =
        std::ranges::find_if(schedule, [&](const StatePoint& p) { return p.time_s >= time_s; });
    if (after == schedule.end()) return schedule.back().state;
    if (after == schedule.begin() || after->time_s == time_s) return after->state;
    const StatePoint& before = *(after - 1);
    return before.state +
           (after->state - before.state) * ((time_s - before.time_s) / (after->time_s - before.time_s));
}

SkyShares shares_at(std::span<const Sky> skies, double state) {
    if (skies.empty()) usage_error("there is no sky, expected at least one");
    const std::size_t none = skies.size();
    std::size_t lower = none, upper = none;
    for (std::size_t i = 0; i < skies.size(); ++i) {
        const double s = skies[i].state;
        if (s <= state && (lower == none || s > skies[lower].state)) lower = i;
        if (s >= state && (upper == none || s < skies[upper].state)) upper = i;
    }
    if (lower == none) lower = upper;
    if (upper == none) upper = lower;
    if (lower == upper) return {lower, lower, 1, 0};
    const double difference = skies[upper].state - skies[lower].state;
    const double upper_fraction = 1 - std::abs(state - skies[upper].state) / difference;
    return {lower, upper, 1 - upper_fraction, upper_fraction};
}

int clouds_at(std::span<const Sky> skies, double state) {
    const SkyShares fractions = shares_at(skies, state);
    return int(std::floor(fractions.lower_fraction * skies[fractions.lower].clouds +
                          fractions.upper_fraction * skies[fractions.upper].clouds + 0.5));
}

std::size_t nearest_sky(std::span<const Sky> skies, double state) {
    const SkyShares fractions = shares_at(skies, state);
    return fractions.upper_fraction > fractions.lower_fraction ? fractions.upper : fractions.lower;
}

}  // namespace nephos
