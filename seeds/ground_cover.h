// SPDX-License-Identifier: Apache-2.0
#pragma once

// Water and snow on the ground over time: a map over a rectangle of the world that rain wets and air dries.
//
//     GroundCover cover(options, kind, world);    // the initial state
//     cover.expose(falling);                      // the rain areas now; computes map().rain_mm_per_h
//     cover.advance(step_s); cover.expose(...);   // a step with that rain, then the rain areas after it
//
// The exposure map works like a shadow map from above: a texel gets the strongest rain of all areas at the
// point upwind where its drops left the cloud's base (drift_m()). There are no obstacles.
//
// Water is a film of V mm. Hollows fill and then overflow (Linsley, Kohler and Paulhus 1949: depression
// storage V = S (1 - exp(-P / S)) after a rain of P, so the fraction V / S of what falls runs off), and the film
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
    bool enabled = false;             // false: the ground stays dry and nothing is computed
    double initial_water_mm = 0;      // of the film everywhere at time 0, 0..100
    double initial_snow_mm = 0;       // of water in the snow everywhere at time 0, 0..1000
    double capacity_mm = 3;           // S: film at which all precipitation runs off, 0.01..100
    double drying_s = 5400;           // tau: a film dries to 1/e in this time, > 0, may be infinite
    double melting_mm_per_h = 0;      // M, of water, 0..100
    double edge = 0.5;                // outer fraction of a rain area over which its rain decreases, 0..1
    double fall_speed_m_per_s = 6.5;  // of drops below the cloud's base, > 0, may be infinite
    int texels = 256;                 // of the map on each side, 2..1024
    double margin = 0.1;              // by which the map is wider than the world on each side, 0..10
    bool operator==(const GroundCoverOptions&) const = default;
};

// Throws Error(usage) on values outside the ranges above.
void check(const GroundCoverOptions& options);

// Returns the film after `duration_s` >= 0 of constant rain or snow (mm/h of water). Pure.
GroundFilm advanced(const GroundFilm& film, double rain_mm_per_h, double snow_mm_per_h, double duration_s,
                    const GroundCoverOptions& options);

// A map of water and snow at one time; each vector has columns * rows values >= 0.
struct GroundCoverMap : GroundTexels {
    std::vector<float> water_mm, snow_mm;
    std::vector<float> rain_mm_per_h;  // precipitation that reaches the ground now, rain or snow
    bool operator==(const GroundCoverMap&) const = default;
};

// Interpolates linearly in time between two maps with the same texels; fraction 0 = `from`, 1 = `to`. Pure.
GroundCoverMap mix(const GroundCoverMap& from, const GroundCoverMap& to, double fraction);

// Returns the horizontal displacement by the wind, in metres, of drops that fall from a cloud's base to the
// ground:
//
//     the integral of wind(z) / fall speed from ground_m to base_m, of 32 slices
//
// Drops move with the air at every height. Zero when the base is not above the ground. Pure.
Vec2 drift_m(const Wind& wind, double time_s, double base_m, double ground_m, double fall_speed_m_per_s);
// Returns the same from below where the cloud is when they arrive, if the wind at its base carries it: opposite to the wind
// that grows with height.
Vec2 lag_m(const Wind& wind, double time_s, double base_m, double ground_m, double fall_speed_m_per_s);

// Rain areas whose drops have the same displacement: those of one layer that move alike.
struct FallingRain {
    std::span<const RainArea> areas;
    Vec2 drift{};  // metres
};

// The map over time. Not thread-safe.
class GroundCover {
  public:
    // Creates the map over `world`, widened by options.margin, in its initial state. `kind` is the
    // precipitation of all rain areas. Throws Error(usage) on options that check() refuses.
    GroundCover(const GroundCoverOptions& options, PrecipitationKind kind, const WorldRectangle& world);

    // Sets the rain areas from now on, and with them map().rain_mm_per_h.
    void expose(std::span<const FallingRain> falling);
    // Advances the film by a duration >= 0 s of the present rain.
    void advance(double duration_s);

    const GroundCoverMap& map() const { return map_; }
    // Continues from a map of a cover with the same options. Throws Error(io) on a map of another size.
    void restore(GroundCoverMap map);

  private:
    void rain_on(const RainArea& area, const Vec2& drift);

    GroundCoverOptions options_;
    PrecipitationKind kind_;
    GroundCoverMap map_;
};

}  // namespace nephos
