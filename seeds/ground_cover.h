// SPDX-License-Identifier: Apache-2.0
#pragma once

// Water and snow on the ground over time: a map over a rectangle of the world that rain wets and air dries.
//
//     GroundCover cover(options, kind, world);    // as it lies at time 0; what falls
//     cover.expose(falling);                      // the rain areas now; fills map().rain_mm_per_h
//     cover.advance(step_s); cover.expose(...);   // a step, during which it rained as it was exposed
//
// Exposure is seen from above, like a shadow map: a texel gets the strongest rain of all areas at the place
// that its drops left at the cloud's base, up the wind (drift_m()). Nothing stands on the ground, so nothing
// shelters it.
//
// Water is a film of V mm. Hollows fill and then overflow (Linsley, Kohler and Paulhus 1949: depression
// storage V = S (1 - exp(-P / S)) after a rain of P, so the share V / S of what falls runs off), and the film
// dries exponentially:
//
//     dV/dt = I (1 - V / S) - V / tau,   k = I / S + 1 / tau,
//     V(t)  = I / k + (V(0) - I / k) exp(-k t)
//
// Snow is a layer of W mm of water. It grows with what falls and melts at a constant rate M while there is
// any, W(t) = max(0, W(0) + (I_snow - M) t); what melts wets the ground below. Both are exact for any
// duration in which the rates do not change: two half steps are one whole one.

#include <span>
#include <vector>

#include "core/weather.h"
#include "core/wind.h"
#include "seeds/rain_area.h"
#include "seeds/sky.h"

namespace nephos {

struct GroundCoverOptions {
    bool enabled = false;             // false: the ground is dry for ever and nothing is computed
    double initial_water_mm = 0;      // of the film everywhere at time 0, 0..100
    double initial_snow_mm = 0;       // of water in the snow everywhere at time 0, 0..1000
    double capacity_mm = 3;           // S: film at which all that falls runs off, 0.01..100
    double drying_s = 5400;           // tau: a film dries to 1/e in this time, > 0, may be infinite
    double melting_mm_per_h = 0;      // M, of water, 0..100
    double edge = 0.5;                // outer share of a rain area over which rain falls off, 0..1
    double fall_speed_m_per_s = 6.5;  // of drops on their way from the cloud's base, > 0, may be infinite
    int texels = 256;                 // of the map on each side, 2..1024
    double margin = 0.1;              // by which the map is wider than the world on each side, 0..10
    bool operator==(const GroundCoverOptions&) const = default;
};

// Throws Error(usage) on values outside the ranges above.
void check(const GroundCoverOptions& options);

// What lies on a square of ground.
struct GroundFilm {
    double water_mm = 0;
    double snow_mm = 0;
    bool operator==(const GroundFilm&) const = default;
};

// After `duration_s` >= 0 in which it rains or snows steadily, in mm/h. Pure.
GroundFilm advanced(const GroundFilm& film, double rain_mm_per_h, double snow_mm_per_h, double duration_s,
                    const GroundCoverOptions& options);

// What lies where, at one moment. Texel (column, row) is the rectangle of texel_x_m by texel_y_m whose lower
// corner is at (x_m + column texel_x_m, y_m + row texel_y_m); rows from south to north, x fastest.
struct GroundCoverMap {
    double x_m = 0, y_m = 0;  // south-western corner, world
    double texel_x_m = 1, texel_y_m = 1;
    int columns = 0, rows = 0;
    std::vector<float> water_mm, snow_mm;  // columns * rows
    std::vector<float> rain_mm_per_h;      // that reaches the ground now, rain or snow
    GroundFilm outside;                    // of all ground beyond the map
    double outside_rain_mm_per_h = 0;      // the mean of the rain on the outermost texels
    bool operator==(const GroundCoverMap&) const = default;
};

// The map at `fraction` of the way from one moment to a later one: linear. Both have the same texels.
GroundCoverMap mix(const GroundCoverMap& from, const GroundCoverMap& to, double fraction);

// How far the wind carries drops on their way from a cloud's base down to the ground, in metres:
//
//     the integral of wind(z) / fall speed from ground_m to base_m, of 32 slices
//
// Drops are as fast as the air at every height. Zero when the base is not above the ground. Pure.
Vec2 drift_m(const Wind& wind, double time_s, double base_m, double ground_m, double fall_speed_m_per_s);

// Rain areas whose drops drift alike: those of one layer.
struct FallingRain {
    std::span<const RainArea> areas;
    Vec2 drift{};  // metres
};

class GroundCover {
  public:
    // Over `world`, widened by options.margin; `kind` is what falls from all rain areas. Throws Error(usage)
    // on options that check() refuses.
    GroundCover(const GroundCoverOptions& options, PrecipitationKind kind, const WorldRectangle& world);

    // It rains from these areas from now on.
    void expose(std::span<const FallingRain> falling);
    // Lets time pass, >= 0 s, in which it rains as it does now.
    void advance(double duration_s);

    const GroundCoverMap& map() const { return map_; }
    // Goes on from a map that a cover with the same options had. Throws Error(io) on a map of another size.
    void restore(GroundCoverMap map);

  private:
    void rain_on(const RainArea& area, const Vec2& drift);

    GroundCoverOptions options_;
    PrecipitationKind kind_;
    GroundCoverMap map_;
};

}  // namespace nephos
