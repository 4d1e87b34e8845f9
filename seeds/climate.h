// SPDX-License-Identifier: Apache-2.0
#pragma once

// The atmospheric state over time, and the probabilities of the skies that entering clouds are drawn from (T,
// chapter 3.4).

#include <span>
#include <vector>

#include "seeds/sky.h"

namespace nephos {

// Returns T's linear schedule St = Si + (Sf - Si) T / D; one point when the duration is 0. Throws
// Error(usage) unless the states are 0..1 and the duration is finite and not negative.
std::vector<StatePoint> straight_schedule(double initial_state, double final_state, double duration_s);

// Returns the state at a time: linear between the points, constant before the first and after the last.
// Precondition: `schedule` has passed check() of its SkyOptions (not empty, times rise strictly). Pure.
double state_at(std::span<const StatePoint> schedule, double time_s);

// The two skies that bracket a state, with their probabilities P_Si = 1 - |St - Si| / Diff, Diff = the
// distance of their states. At a sky's own state, and outside all states, one sky has probability 1.
struct SkyShares {
    std::size_t lower = 0, upper = 0;               // indices; equal when one sky has probability 1
    double lower_fraction = 1, upper_fraction = 0;  // sum 1
};

// Returns the bracketing skies of a state. `skies` in any order, at least one, all states different. Pure.
SkyShares shares_at(std::span<const Sky> skies, double state);

// Returns the number of clouds at a state: the mean of the bracketing skies' numbers, weighted by their
// probabilities, rounded half up. Pure.
int clouds_at(std::span<const Sky> skies, double state);

// Returns the index of the sky nearest to a state, of two equally near ones the lower: the initial sky of a
// simulation. Pure.
std::size_t nearest_sky(std::span<const Sky> skies, double state);

}  // namespace nephos
