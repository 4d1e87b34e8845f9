// SPDX-License-Identifier: Apache-2.0
#pragma once

// Sizes and speeds of raindrops and snowflakes. Both have an exponential distribution of the diameter D of
// the water in them: per cubic metre there are
//
//     N(D) dD = n0 exp(-slope D) dD,    0.2 mm <= D <= 8 mm
//
// with the slope by the rate R (Marshall and Palmer 1948 for rain: 4.1 R^-0.21 per mm; Gunn and Marshall 1958
// for snow: 2.55 R^-0.48 per mm), and n0 such that the flux, volume times speed times number, is R.
//
// Particles are drawn from one distribution, that of the heaviest rain, and weighted: so a particle keeps its
// size and speed, and thereby its place, while the rate changes. Diameters in mm, speeds in m/s, rates in
// mm/h of water. Pure; thread-safe.

#include "render/options/precipitation_options.h"

namespace nephos {

inline constexpr double kSmallest_mm = 0.2, kLargest_mm = 8;  // P: radii of 0.1 to 4 mm

struct SizeLaw {
    PrecipitationKind kind = PrecipitationKind::rain;
    double n0 = 0;     // per m^3 and mm
    double slope = 1;  // per mm
};

// The law of a rate >= 0; of rate 0 nothing falls.
SizeLaw size_law(PrecipitationKind kind, double rate_mm_per_h);

// Terminal speed of a drop (Atlas, Srivastava and Sekhon 1973): 9.65 - 10.3 exp(-0.6 D), within P's 0.72 to
// 9.23 m/s; of a flake (Locatelli and Hobbs 1974, aggregates of dendrites): 0.8 (size / mm)^0.16, within 0.5
// to 2 m/s.
double fall_speed_m_per_s(PrecipitationKind kind, double diameter_mm);

// Height by width of a drop: 1 up to 0.5 mm, then 1.03 - 0.062 D (Pruppacher and Beard 1970).
double axis_ratio(double diameter_mm);

// Largest width: of a drop the horizontal axis of the spheroid with its volume; of a flake the size whose
// mass is that of the water (Locatelli and Hobbs 1974: mass / mg = 0.073 (size / mm)^1.4).
double width_mm(PrecipitationKind kind, double diameter_mm);

// Mean shadow of a particle, mm^2: of a drop seen from the side the ellipse, of a flake three tenths of its
// circle (aggregates let that much light pass; Heymsfield and Miloshevich 2003).
double shadow_mm2(PrecipitationKind kind, double diameter_mm);

// Integrals over the law: rate in mm/h, particles per m^3, and geometric extinction per metre (shadows per
// volume; with diffraction, seen from afar, twice that: van de Hulst 1957).
double flux_mm_per_h(const SizeLaw& law);
double particles_per_m3(const SizeLaw& law);
double shadow_per_m(const SizeLaw& law);

// The diameter below which a share u (0..1) of the drawn particles lies.
double drawn_diameter_mm(PrecipitationKind kind, double u);

// Real particles per m^3 that a drawn one stands for when one is drawn per m^3.
double real_per_drawn(const SizeLaw& law, double diameter_mm);

}  // namespace nephos
