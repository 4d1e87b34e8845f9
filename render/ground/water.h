// SPDX-License-Identifier: Apache-2.0
#pragma once

// A sea as ground (GroundPattern::water), drawn in the pass of wet_ground.h. Its surface is a sum of waves with random
// directions and phases around the wind's, whose slopes tilt what they reflect. Waves that a pixel does not resolve are a
// variance of slopes there, so that nothing shimmers and far water has the mean of all its waves:
//
//     longest waves     those of a sea that has grown as far as the wind makes it: Pierson and Moskowitz 1964
//     slopes            as much variance in each octave of wavelengths below (Phillips 1958), in all
//                       0.003 + 0.00512 U (Cox and Munk 1954), U the wind in m/s 10 m above the water
//     their way         omega^2 = g k + (surface tension / density) k^3, in deep water
//     the sun's glint   E F p / (4 cos^4 of the tilt, area seen): Cox and Munk's, p the density of slopes
//     whitecaps         2.95e-6 U^3.52 of the surface (Monahan and O'Muircheartaigh 1980), of reflectance 0.22 in
//                       the mean of their age (Koepke 1984)
//
// Evaluated in render/ground/water-inl.h. A function of place and time alone. Private to the module.

#include <vector>

#include "render/ground/ground_noise.h"
#include "render/options/options.h"

namespace nephos {

// A wave: slopes (slope_x, slope_y) cos(phase + x p.x + y p.y) at a point p relative to the eye.
struct WaterWave {
    float x = 0, y = 0;  // 1 / m
    float phase = 0;     // 0..2 pi
    float slope_x = 0, slope_y = 0;
    float wavelength_m = 1;
    float variance = 0;  // of its slope on one axis, mean of both: slope^2 / 4
};

struct Water {
    bool enabled = false;
    float slope_variance = 0;      // of all slopes on one axis
    std::vector<WaterWave> waves;  // the longest first
    std::vector<NoiseOctave> gusts, foam;
    float foam_level = 0;   // of the noise, in standard deviations, above which is foam
    float foam_albedo = 0;  // 0: none
};

// Returns the water of the options as an eye sees it at a time, seconds; not enabled with other patterns.
Water water_of(const RenderOptions& options, const Vec3& eye_m, double time_s);

// Returns the variance of the slopes of a sea, both axes together, and the share of it that is white; `wind` in m/s.
double slope_variance_of_sea(double wind);
double whitecaps_of_sea(double wind);

}  // namespace nephos
