// SPDX-License-Identifier: Apache-2.0
#pragma once

// Wind that differs from place to place (D's wish: vector fields), which is added to the profile of core/wind.h:
// analytic circulations without divergence, and velocities sampled on grids. With d = the distance to the left of the
// line through (x_m, y_m) in the direction `direction_deg`, r = the distance from the vertical through (x_m, y_m),
// R = radius_m, W = speed_m_per_s, s = (z - bottom_m) / (top_m - bottom_m), and nothing outside of 0 <= s <= 1:
//
//     vortex      turns counter-clockwise: W r/R up to r = R like a solid body, W R/r beyond (Rankine)
//     shear_line  along the line W t (3 - t^2) / 2, t = d/R, not beyond -1 and 1
//     roll        up W cos(pi d/R) Z, to the left -W (R/pi) sin(pi d/R) dZ/dz, Z = 4 s (1 - s): convective rolls
//     thermal     up W (1 - q) (1 - 3 q) Z, q = r^2/R^2 up to 1, outwards -W/2 r (1 - q)^2 dZ/dz: a rising core and the
//                 ring of sinking air around it, with inflow below and outflow above
//     grid        linear between the points and times of `samples`; constant beyond them
//
// All from IEEE additions, multiplications, divisions and core/math.h: the same bits on every machine.

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/sample_grid.h"
#include "core/vec.h"

namespace nephos {

enum class WindFieldKind { thermal, roll, shear_line, vortex, grid };

// Velocities towards east, north and up at one time, m/s.
struct VelocitySamples {
    double time_s = 0;
    std::shared_ptr<const SampleGrid> grid;  // not null; of three parts
    bool operator==(const VelocitySamples&) const = default;
};

struct WindField {
    WindFieldKind kind = WindFieldKind::thermal;
    double x_m = 0, y_m = 0;
    double radius_m = 500;      // > 0
    double speed_m_per_s = 2;   // of either sign
    double direction_deg = 0;   // counter-clockwise from east
    double bottom_m = 0, top_m = 1000;  // world z, bottom < top

    // Of a grid: the files that `samples` are read from, the name of their grid (empty: the only one), the time of the
    // first and the interval from one to the next.
    std::vector<std::string> files;
    std::string grid;
    double start_s = 0, interval_s = 60;
    std::vector<VelocitySamples> samples;  // times rise strictly

    bool operator==(const WindField&) const = default;
};

// Returns the sum of the velocities at a place and time, m/s. A grid without samples has none. Thread-safe; pure.
Vec3 velocity_of(std::span<const WindField> fields, const Vec3& place_m, double time_s);

// Returns whether the fields are no more than a profile: each a grid whose velocities are horizontal and the same all
// over each of its levels. False for a grid whose files have not been read.
bool is_profile(std::span<const WindField> fields);

// Throws Error(usage) naming the field and the value that is out of its range.
void check(std::span<const WindField> fields);

}  // namespace nephos
