// SPDX-License-Identifier: Apache-2.0
#pragma once

// Everything that decides the bits of a simulation; plain data, filled by a scene or by another program.

#include <cstddef>
#include <cstdint>
#include <string>

#include "automaton/field.h"
#include "automaton/lattice.h"
#include "core/wind.h"

namespace nephos {

// How the lattice starts when no state is given.
enum class InitialState {
    empty,  // all bits 0
    field,  // hum and act drawn with the field's probabilities at time 0, external ellipsoids included; cld
            // empty (D)
};

struct AutomatonOptions {
    Extent extent{256, 128, 20};
    Placement placement;
    Boundaries boundaries;
    double time_step_s = 10.0;  // simulated time of one step, > 0
    std::uint64_t seed = 1;     // any value
    InitialState initial = InitialState::field;
    FieldOptions field;
    Wind wind;
    bool operator==(const AutomatonOptions&) const = default;
};

// Number of ellipsoids that a step visits: those of the options, and their images around periodic axes.
std::uint64_t ellipsoid_count(const AutomatonOptions& options);
inline constexpr std::uint64_t kMaxEllipsoids = 1'000'000;
inline constexpr std::size_t kMaxScatters = 65536;

// How far an ellipsoid reaches from its centre along east, north and up: half of the box around it, turned by
// its yaw. For a scatter, the most that any ellipsoid drawn from it reaches. In metres.
Vec3 reach_m(const Ellipsoid& ellipsoid);
Vec3 reach_m(const EllipsoidScatter& scatter);
// Most that an ellipsoid may reach along a periodic axis, in lengths of that axis: every image of it that
// meets the box is visited in every step, 33 of them along an axis at this limit.
inline constexpr double kMaxPeriodicReach = 16;

// Throws Error(usage) when an ellipsoid of a simulation with these options is meaningless; `name` is for the
// message.
void check(const Ellipsoid& ellipsoid, const AutomatonOptions& options, const std::string& name);

// Every problem of `options` would make the simulation meaningless: throws Error(usage) naming the first one.
void check(const AutomatonOptions& options);

}  // namespace nephos
