// SPDX-License-Identifier: Apache-2.0
#pragma once

// Shells of air around the eye, and the effects that are sampled in them: light shafts and fog. Included by
// options.h.

#include <cstdint>

#include "core/vec.h"

namespace nephos {

// D's shells: concentric spherical layers of air around the eye, composited in depth order with the clouds.
// The first begins at the eye, each further one at the end of the one before. Light shafts and fog are
// sampled once per shell; without either there are no shells.
struct Shells {
    int count = 40;          // 1..128
    double spacing_m = 500;  // thickness of the first, > 0
    double growth = 1;       // ratio of the thicknesses of successive shells, 1..2; D: 1
    bool operator==(const Shells&) const = default;
};

// Returns the distance from the eye at which the last shell ends, metres.
inline double reach_m(const Shells& shells) {
    double end = 0, thickness = shells.spacing_m;
    for (int k = 0; k < shells.count; ++k, thickness *= shells.growth) end += thickness;
    return end;
}

// Light shafts (crepuscular rays): air in the shadow of clouds scatters less light than sunlit air.
struct LightShafts {
    double strength = 0;  // 0..1; 0 = none, 1 = physical
    // The following are for AirModel::gradient; the physical sky computes them.
    double g = 0.6;  // asymmetry of the haze (Cornette-Shanks), -0.99..0.99; forward is > 0
    // Fraction of the air's radiance at about a right angle to the sun that is single scattering of sunlight,
    // 0..1; towards the sun it is larger by g. Shadows do not reduce the rest, the light of sky and ground.
    double sun_share = 0.6;
    bool operator==(const LightShafts&) const = default;
};

// Fog: droplets near the ground that scatter light as clouds do. Along a ray, extinction (per metre) is
//     extinction_per_m * exp(-(z - base_m) / height_m) * max(0, 1 + 2 patchiness (n - 1)),
// with n the sum of two samples of a noise in 0..1 (render/frame/fog.h), whose mean is 1. Beyond the last
// shell n is 1.
struct Fog {
    double extinction_per_m = 0;     // at base_m, >= 0; 0 = none. Visibility is about 3.9 / extinction
    double base_m = 0;               // world z
    double height_m = 100;           // scale height: extinction falls to 1 / e over it, > 0
    double patchiness = 0.5;         // 0..1: contrast of the patches
    double patch_m = 600;            // size of a patch, > 0
    Vec3 velocity_m_per_s{1, 0, 0};  // drift of the patches
    std::uint64_t seed = 1;          // of the patches
    bool operator==(const Fog&) const = default;
};

// Throw Error(usage) naming the first value that is out of its range.
void check(const Shells& shells);
void check(const LightShafts& shafts);
void check(const Fog& fog);

}  // namespace nephos
