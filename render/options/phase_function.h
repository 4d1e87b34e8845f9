// SPDX-License-Identifier: Apache-2.0
#pragma once

// Phase functions: the angular distribution of scattered light. All share one convention: theta is the angle
// between the directions of travel before and after, so that cos(theta) = 1 is straight on and forward
// scattering is g > 0 (S has the opposite sign of g). Values are per steradian: the integral over the sphere
// is 1. Pure functions, thread-safe; arguments out of their ranges are programming errors.

namespace nephos {

enum class Phase {
    isotropic,          // the same in all directions
    rayleigh,           // molecules: symmetric forward and backward, half of that sideways
    henyey_greenstein,  // one lobe of asymmetry g
    cornette_shanks,    // S: that lobe times (1 + cos^2); Rayleigh for g = 0
    hg_draine,          // water droplets by their diameter: forward peak, fogbow side and glory
};

struct PhaseFunction {
    Phase kind = Phase::henyey_greenstein;
    double g = 0.5;                   // of Henyey-Greenstein and Cornette-Shanks, -0.99..0.99
    double droplet_diameter_um = 20;  // of hg_draine, 5..50
    bool operator==(const PhaseFunction&) const = default;
};

inline constexpr double kMinDroplet_um = 5, kMaxDroplet_um = 50;  // the range of the fit
inline constexpr double kMinDropletVariance = 0.01, kMaxDropletVariance = 0.3;  // of droplet_phase.h

// Henyey and Greenstein 1941; -1 < g < 1:
//     (1 - g^2) / (4 pi (1 + g^2 - 2 g cos)^1.5)
double henyey_greenstein(double cos_theta, double g);

// 3 / (16 pi) (1 + cos^2)
double rayleigh(double cos_theta);

// Draine 2003, equation 5; alpha >= 0. alpha = 0 is Henyey-Greenstein:
//     (1 - g^2) / (4 pi (1 + g^2 - 2 g cos)^1.5) (1 + alpha cos^2) / (1 + alpha (1 + 2 g^2) / 3)
// alpha = 1 is that of S; Cornette and Shanks 1992, equation 8:
//     3 (1 - g^2) / (8 pi (2 + g^2)) (1 + cos^2) / (1 + g^2 - 2 g cos)^1.5
double draine(double cos_theta, double g, double alpha);

// Jendersie and d'Eon 2023, "An Approximate Mie Scattering Function for Fog and Cloud Rendering", equations
// 4 to 7: (1 - draine_fraction) * Henyey-Greenstein(g) + draine_fraction * Draine(draine_g, alpha) is close to
// Mie's solution for water droplets of a diameter of 5..50 micrometres.
struct HgDraine {
    double g = 0, draine_g = 0, alpha = 0, draine_fraction = 0;
};
HgDraine hg_draine_fit(double droplet_diameter_um);

// Evaluates any of them. `directed` in 0..1 makes it less anisotropic, for multiply scattered light: 1 is the
// function itself, 0 is isotropic. It scales g and alpha, and mixes Rayleigh with the isotropic function.
double phase(const PhaseFunction& function, double cos_theta, double directed = 1);

// Returns the mean of cos(theta) in closed form, -1..1: the asymmetry.
double mean_cosine(const PhaseFunction& function);

}  // namespace nephos
