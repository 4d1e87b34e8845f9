// SPDX-License-Identifier: Apache-2.0
#pragma once

// All inputs that determine the bits of a simulation; plain data, filled by a scene or by another program.

#include <cstddef>
#include <cstdint>
#include <string>

#include "automaton/field.h"
#include "automaton/lattice.h"
#include "core/wind.h"

namespace nephos {

// The initial state of a lattice that starts without a given one.
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

// Returns the number of ellipsoids that a step visits: those of the options, and their images around periodic
// axes.
std::uint64_t ellipsoid_count(const AutomatonOptions& options);
inline constexpr std::uint64_t kMaxEllipsoids = 1'000'000;
inline constexpr std::size_t kMaxScatters = 65536;

// Returns half the edges of the axis-aligned bounding box of an ellipsoid turned by its yaw, in metres. For a
// scatter, the maximum over all ellipsoids that can be drawn from it.
Vec3 reach_m(const Ellipsoid& ellipsoid);
Vec3 reach_m(const EllipsoidScatter& scatter);
// Returns true when a scatter's ellipsoids are plumes of thermals.
inline bool is_plume(const EllipsoidScatter& scatter) { return scatter.thermals.interval_s > 0; }
// Returns how many thermals of a plume live at the same time, at most.
double thermals_at_once(const ThermalPlume& plume);
inline constexpr int kMaxThermalsAtOnce = 1000;
// Largest reach of an ellipsoid along a periodic axis, in lengths of that axis: every image of it that meets
// the box is visited in every step, 33 of them along an axis at this limit.
inline constexpr double kMaxPeriodicReach = 16;
// Returns the largest reach along each axis of a lattice, in metres: infinite along open axes.
Vec3 largest_reach_m(const Extent& extent, double cell_size_m, const Boundaries& boundaries);

// Throws Error(usage) when an ellipsoid is not valid in a simulation with these options; `name` names it in
// the message.
void check(const Ellipsoid& ellipsoid, const AutomatonOptions& options, const std::string& name);

// Throws Error(usage) naming the first field of `options` that is out of its range or contradicts another.
void check(const AutomatonOptions& options);

}  // namespace nephos
