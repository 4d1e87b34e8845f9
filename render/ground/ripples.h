// SPDX-License-Identifier: Apache-2.0
#pragma once

// Ripples of drops on water (S), simulated on a periodic square of its surface by the damped wave equation
//
//     y_tt = v^2 (y_xx + y_yy),   z = exp(-d (t - t0)) y
//
// for the ripple z of each drop from its time t0 on: all wavelengths are damped alike. Steps have a fixed
// length, below the limit of Courant, Friedrichs and Lewy, at fixed times: the surface depends on its time
// alone, not on earlier frames, and is stable at any frame rate. (An exact step per Fourier mode would be as
// stable, but costs a sum over all modes per drop.) Damping makes its memory short: it is computed from rest
// kRippleMemory_s before, after which a wave has 1.1e-7 of its height, the rounding of a float.
//
// Leapfrog in time; in space the isotropic Laplacian of nine texels, so that rings are round:
//
//     z(n+1) = q (2 z(n) + (v t / h)^2 L z(n)) - q^2 z(n-1),   q = exp(-d t)
//     energy = |z(n+1) / q - z(n)|^2 / (2 t^2) - (v / h)^2 / 2 <L z(n), z(n+1) / q>,   q^2 of it after a step
//
// L has eigenvalues from -16/3 to 0, so v t / h must be below sqrt(3) / 2; here it is 0.32.

#include <cstdint>
#include <vector>

#include "render/shared/ground.h"

namespace nephos {

inline constexpr int kRippleTexels = int(shader::kRippleSide);
inline constexpr double kRippleSize_m = double(shader::kRippleSquare_m);
inline constexpr double kRippleStep_s = 0.02;         // t
inline constexpr double kRippleSpeed_m_per_s = 0.25;  // v: of capillary waves of some centimetres
inline constexpr double kRippleDamping_per_s = 6.0;   // d
inline constexpr double kRippleMemory_s = 16 / kRippleDamping_per_s;

// The surface at two consecutive steps; heights in metres, row after row.
struct Ripples {
    std::vector<float> before, now;
};

Ripples still_water();

// Advances the surface by one step without drops.
void step(Ripples& ripples);

// Adds the drops of a step, of rain of `rain_mm_per_h`, at positions that depend on the step's number alone.
// Drops above 1.5 mm make visible ripples; by Marshall and Palmer (1948) their number is 8000 / L exp(-1.5 L)
// per cubic metre, L = 4.1 R^-0.21 per mm, and they fall at about 6.5 m/s.
void add_drops(Ripples& ripples, std::int64_t step, double rain_mm_per_h);

// Returns the surface at a time after steady rain for `history_s`: `before` is the step at or before the
// time, `now` the next one. Pure.
Ripples ripples_at(double time_s, double rain_mm_per_h, double history_s = kRippleMemory_s);

// The slopes of a surface, row after row, and the mean of their squares, for shading.
struct RippleSlopes {
    std::vector<float> x, y;  // kRippleTexels^2, interpolated to the time itself
    double variance = 0;      // mean of x^2 + y^2
};
RippleSlopes ripple_slopes(double time_s, double rain_mm_per_h);

}  // namespace nephos
