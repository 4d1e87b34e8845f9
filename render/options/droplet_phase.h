// SPDX-License-Identifier: Apache-2.0
#pragma once

// The light that cloud droplets scatter away from the sun, in colour: the glory, rings of 2 to 6 degrees about the point opposite
// to the sun, and the fogbow, white with a reddish rim, at 35 to 42 degrees from it.
//
// Mie's phase function (mie_scattering.h) as the mean over
//
// - radii of Hansen's gamma distribution, r^((1 - 3 v) / v) exp(-r / (r_e v)), of effective radius r_e and effective variance v
//   (Hansen and Travis 1974, Light scattering in planetary atmospheres, 2.56);
// - 16 wavelengths from 400 to 700 nm, whose light becomes sRGB by the matching functions of CIE 1931 (Wyman, Sloan and Shirley
//   2013, Simple analytic approximations to the CIE XYZ color matching functions), with equal energy for white;
// - the sun's disc.

#include <array>
#include <span>
#include <vector>

#include "render/options/phase_function.h"

namespace nephos {

struct DropletSizes {
    double effective_diameter_um = 20;  // twice the effective radius, 5..50
    double effective_variance = 0.05;   // 0.01..0.3; smaller: more rings, as droplets are more alike
    bool operator==(const DropletSizes&) const = default;
};

class DropletPhase {
  public:
    static constexpr double kReach_deg = 95;  // from the point opposite to the sun

    // Takes tenths of a second of one core, for the largest droplets seconds.
    explicit DropletPhase(const DropletSizes& sizes);

    // Returns the phase function for red, green and blue per steradian, at least 0. cos_theta as in phase_function.h, -1..
    // cos(180 - kReach_deg); beyond that the value there.
    std::array<double, 3> at(double cos_theta) const;

    const DropletSizes& sizes() const { return sizes_; }

  private:
    DropletSizes sizes_;
    std::array<std::vector<double>, 3> table_;  // by angle from the point opposite to the sun
};

// Returns the table of these sizes; the last one is kept. Thread-safe.
DropletPhase droplet_phase(const DropletSizes& sizes);

// Returns what fogbow and glory make of light that is scattered once, by which the phase function is to be multiplied: factors of
// red, green and blue at each of `cosines`. In front of 95 degrees they are 1; from there to 125 degrees they become the ratio of
// Mie's phase function to its smooth fit (hg_draine_fit()) of the same diameter, times a number for each colour, with which
// `function` times the factors keeps its integral over the sphere. `strength`, 0..1, mixes with 1. `cosines`: at least 2, falling.
std::vector<std::array<double, 3>> bow_factors(const PhaseFunction& function, const DropletSizes& sizes,
                                               double strength, std::span<const double> cosines);

}  // namespace nephos
