// SPDX-License-Identifier: Apache-2.0
#pragma once

// The atmospheric state over time, and which skies the clouds that enter now come from (T, chapter 3.4).

#include <span>
#include <vector>

#include "seeds/sky.h"

namespace nephos {

// T's straight line: St = Si + (Sf - Si) T / D, as a schedule. One point when the duration is 0.
// Throws Error(usage) unless the states are 0..1 and the duration is finite and not negative.
std::vector<StatePoint> straight_schedule(double initial_state, double final_state, double duration_s);

// The state at a time: linear between the points, constant before the first and after the last.
// `schedule` must have passed check() of its SkyOptions: not empty, times rise strictly.
double state_at(std::span<const StatePoint> schedule, double time_s);

// The two skies that bracket a state, with P_Si = 1 - |St - Si| / Diff, Diff = the distance of their states.
// On a sky's state, and outside all states, one sky has it all.
struct SkyShares {
    std::size_t lower = 0, upper = 0;         // indices; equal when one sky has it all
    double lower_share = 1, upper_share = 0;  // sum 1
};

// `skies` in any order, at least one, no two with one state.
SkyShares shares_at(std::span<const Sky> skies, double state);

// Number of clouds at a state: the bracketing skies' numbers, weighted by their shares, rounded half up.
int clouds_at(std::span<const Sky> skies, double state);

// Index of the sky nearest to a state, the lower one if two are equally near: the one a simulation starts
// with.
std::size_t nearest_sky(std::span<const Sky> skies, double state);

}  // namespace nephos
