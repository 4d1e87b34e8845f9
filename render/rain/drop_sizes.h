// SPDX-License-Identifier: Apache-2.0
#pragma once

// Size distributions and speeds of raindrops and snowflakes. The diameter D of a drop or of the melted flake
// has an exponential distribution; per cubic metre there are
//
//     N(D) dD = n0 exp(-slope D) dD,    0.2 mm <= D <= 8 mm
//
// with the slope by the rate R (Marshall and Palmer 1948 for rain: 4.1 R^-0.21 per mm; Gunn and Marshall 1958
// for snow: 2.55 R^-0.48 per mm), and n0 such that the flux, volume times speed times number, is R.
//
// Particles are drawn from one distribution, that of the heaviest rain, and weighted by the rate, so that a
// particle does not change its size, speed and position with the rate. Diameters in mm, speeds in m/s, rates
// in mm/h of water. Pure; thread-safe.

#include "render/options/precipitation_options.h"

namespace nephos {

inline constexpr double kSmallest_mm = 0.2, kLargest_mm = 8;  // P: radii of 0.1 to 4 mm

struct SizeLaw {
    PrecipitationKind kind = PrecipitationKind::rain;
    double n0 = 0;     // per m^3 and mm
    double slope = 1;  // per mm
};

// Returns the distribution of a rate >= 0; at rate 0 there are no particles.
SizeLaw size_law(PrecipitationKind kind, double rate_mm_per_h);

// Returns the terminal speed of a drop (Atlas, Srivastava and Sekhon 1973): 9.65 - 10.3 exp(-0.6 D), clamped
// to P's 0.72 to 9.23 m/s; of a flake (Locatelli and Hobbs 1974, aggregates of dendrites): 0.8 (size /
// mm)^0.16, clamped to 0.5 to 2 m/s.
double fall_speed_m_per_s(PrecipitationKind kind, double diameter_mm);

// Returns height / width of a drop: 1 up to 0.5 mm, then 1.03 - 0.062 D (Pruppacher and Beard 1970).
double axis_ratio(double diameter_mm);

// Returns the largest width: of a drop the horizontal axis of the spheroid with its volume; of a flake the
// size whose mass is that of the water (Locatelli and Hobbs 1974: mass / mg = 0.073 (size / mm)^1.4).
double width_mm(PrecipitationKind kind, double diameter_mm);

// Returns the geometric cross-section of a particle, mm^2: of a drop the ellipse seen from the side, of a
// flake three tenths of its circle (the area ratio of aggregates; Heymsfield and Miloshevich 2003).
double shadow_mm2(PrecipitationKind kind, double diameter_mm);

// Returns the geometric extinction per metre: the integral of the cross-sections over the distribution (with
// diffraction, seen from afar, twice that: van de Hulst 1957).
double shadow_per_m(const SizeLaw& law);

// Returns the quantile u (0..1) of the diameters of drawn particles.
double drawn_diameter_mm(PrecipitationKind kind, double u);

// Returns the number of real particles per m^3 that a drawn one represents when one is drawn per m^3.
double real_per_drawn(const SizeLaw& law, double diameter_mm);

}  // namespace nephos
