// SPDX-License-Identifier: Apache-2.0
#pragma once

// Wind: a horizontal velocity that depends on height and time, piecewise linear in both (D: advection), and
// fields that differ from place to place (core/wind_field.h), which are added to it.
//
// Motion accumulates as fixed-point integers, without rounding drift: after n steps of a constant wind the
// displacement is exactly floor(n * d) cells, with d = velocity * step / cell rounded up to a multiple of
// 2^-32 cell. Rounding up makes decimal fractions arrive: 0.2 cells a step are 1 cell after 5 steps, and
// -0.3 are -3 cells after 10. If the exact displacement of a step is below 16 cells and a multiple of 1/q
// cell, floor(n * d) equals the floor of the exact product for all n < 2^32 / q.

#include <cstdint>
#include <vector>

#include "core/wind_field.h"

namespace nephos {

// Horizontal velocity, positive towards east and north.
struct Velocity {
    double east_m_per_s = 0, north_m_per_s = 0;
    bool operator==(const Velocity&) const = default;
};

// The velocity at one height of a profile.
struct WindLevel {
    double height_m = 0;  // world z; levels rise strictly
    Velocity velocity;
    bool operator==(const WindLevel&) const = default;
};

// The wind profile at one time: linear between levels, constant below the first and above the last.
struct WindKeyframe {
    double time_s = 0;  // keyframes rise strictly
    std::vector<WindLevel> levels;
    bool operator==(const WindKeyframe&) const = default;
};

// Profiles over time: linear between keyframes, constant before the first and after the last. The profile between two
// keyframes has the levels of both, and is that of a keyframe with these levels at its time, to the last bit. Without
// keyframes it is calm.
struct Wind {
    std::vector<WindKeyframe> keyframes;
    std::vector<WindField> fields{};
    bool operator==(const Wind&) const = default;
};

// Returns the wind that comes from a direction, degrees clockwise from north. The same bits on every machine: the velocity decides
// those of the simulation. Pure.
Velocity velocity_from(double from_deg, double speed_m_per_s);

// Returns true when there is neither a profile nor a field.
inline bool is_calm(const Wind& wind) { return wind.keyframes.empty() && wind.fields.empty(); }

// Returns the levels of the profile at a time: those of a keyframe, or of the two around the time; none without
// keyframes. Thread-safe; pure.
std::vector<WindLevel> profile_at(const Wind& wind, double time_s);

// Returns the velocity of the profile alone at a height and time. Thread-safe; pure.
Velocity wind_at(const Wind& wind, double height_m, double time_s);
// Returns the velocity of profile and fields at a place and time, m/s towards east, north and up. Thread-safe; pure.
Vec3 wind_at(const Wind& wind, const Vec3& place_m, double time_s);

// Returns the mean velocity of air on its way from a place through the wind of a time, which stays as it is for
// `duration_s`: by the classical Runge-Kutta method of fourth order, and where the velocity is the same on the whole
// way exactly that. Thread-safe; pure.
Vec3 mean_wind(const Wind& wind, const Vec3& from_m, double time_s, double duration_s);

// A displacement in cells as a fixed-point number with 32 fractional bits: sums are exact, and the integer
// part is the floor.
struct Displacement {
    std::int64_t x = 0, y = 0;  // cells * 2^32

    std::int64_t whole_x() const { return x >> 32; }  // floor
    std::int64_t whole_y() const { return y >> 32; }
    bool operator==(const Displacement&) const = default;
};

// Of a lattice: more than any is wide, and those of the steps that density is a mean of fit into 64 bits together.
constexpr double kMaxCellsOfStep = 0x1p24;

// Returns the displacement of one step of `time_step_s`, rounded up (towards east and north) to a multiple of
// 2^-32 cell; 0 where its magnitude is below 2^-33 cell. Throws Error(usage) when it exceeds 2^30 cells.
Displacement displacement_of_step(const Velocity& velocity, double time_step_s, double cell_size_m);

}  // namespace nephos
