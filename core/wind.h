// SPDX-License-Identifier: Apache-2.0
#pragma once

// Wind: a horizontal velocity that depends on height and time, piecewise linear in both (D: advection; D
// names vector fields as the improvement). Motion is accumulated as integers, so nothing drifts: after n
// steps of a constant wind the displacement is floor(n * d) cells exactly, whatever the speed, with d the
// displacement of one step, velocity * step / cell, rounded up to a multiple of 2^-32 cell. Up, because few
// decimal fractions are such multiples: n * d then never falls short of the whole number that the exact
// product reaches. So 0.2 cells a step are 1 cell after 5 steps, and -0.3 are -3 cells after 10. Where the
// exact displacement of a step is a multiple of 1/q cell, floor(n * d) is the floor of the exact product for
// all n < 2^32 / q.

#include <cstdint>
#include <vector>

namespace nephos {

// Velocity towards east and north.
struct Velocity {
    double east_m_per_s = 0, north_m_per_s = 0;
    bool operator==(const Velocity&) const = default;
};

struct WindLevel {
    double height_m = 0;  // world z; levels rise strictly
    Velocity velocity;
    bool operator==(const WindLevel&) const = default;
};

// The profile at one time. Between levels linear, below the first and above the last constant.
struct WindKeyframe {
    double time_s = 0;  // keyframes rise strictly
    std::vector<WindLevel> levels;
    bool operator==(const WindKeyframe&) const = default;
};

// Between keyframes each profile is evaluated and mixed linearly; before the first and after the last
// constant. No keyframe at all: calm air.
struct Wind {
    std::vector<WindKeyframe> keyframes;
    bool operator==(const Wind&) const = default;
};

// Velocity at a height and time. Thread-safe; pure.
Velocity wind_at(const Wind& wind, double height_m, double time_s);

// A displacement in cells as a fixed-point number with 32 fractional bits: exact sums, floor for the whole
// part.
struct Displacement {
    std::int64_t x = 0, y = 0;  // cells * 2^32

    std::int64_t whole_x() const { return x >> 32; }  // floor
    std::int64_t whole_y() const { return y >> 32; }
    bool operator==(const Displacement&) const = default;
};

// The displacement of one step of `time_step_s`, rounded up (towards east and north) to a multiple of 2^-32
// cell; 0 where it is less than half of that either way, which is calm air. Throws Error(usage) when it
// exceeds 2^30 cells: more than any lattice is wide.
Displacement displacement_of_step(const Velocity& velocity, double time_step_s, double cell_size_m);

}  // namespace nephos
