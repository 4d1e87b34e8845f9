// SPDX-License-Identifier: Apache-2.0
#pragma once

// Where a ray is within a slab of air over the round Earth. Private to the module.

#include <array>

namespace nephos {

// Part of a ray, metres from the eye; empty unless begin < end.
struct RayPart {
    double begin = 0, end = 0;
    bool any() const { return begin < end; }
};

// Returns the parts of a ray in a slab, the nearer first; it has two when it dips out of the slab's base and comes back.
// Heights are above the eye's; the height of the ray at t is rise t + bend (1 - rise^2) t^2, with bend in 1/m as
// earth_bend(). `rise`: sine of the ray's elevation; `limit_m`: where the ray ends.
std::array<RayPart, 2> parts_in_slab(double rise, double bend, double base_m, double top_m, double limit_m);

}  // namespace nephos
