// SPDX-License-Identifier: Apache-2.0
#pragma once

// Shells of air around the eye, and what they carry: light shafts and fog. Included by options.h.

#include <cstdint>

#include "core/vec.h"

namespace nephos {

// D's spherical shells around the eye, between which the clouds are drawn. The first begins at the eye, and
// each begins where the one before it ends. Both light shafts and fog are drawn as layers of these shells;
// without either there are none.
struct Shells {
    int count = 40;          // 1..128; more reach farther, or sample more finely
    double spacing_m = 500;  // thickness of the first, > 0
    double growth = 1;       // thickness of a shell in those of the one before it, 1..2; 1 is D's
    bool operator==(const Shells&) const = default;
};

// Distance from the eye at which the last shell ends, metres.
inline double reach_m(const Shells& shells) {
    double end = 0, thickness = shells.spacing_m;
    for (int k = 0; k < shells.count; ++k, thickness *= shells.growth) end += thickness;
    return end;
}

// Air in the shadow of clouds scatters less light: what stays lit stands out as shafts.
struct LightShafts {
    double strength = 0;  // 0..1; 0 = none, 1 = as much as the air really loses
    // Both for the gradient; the physical sky knows them.
    double g = 0.6;  // asymmetry of the haze (Cornette-Shanks), -0.99..0.99; forward is > 0
    // Share of the air's light that is scattered once from the sun at a right angle or so, 0..1; the rest
    // comes from the sky and the ground, and clouds do not take it away. Towards the sun it is larger by g.
    double sun_share = 0.6;
    bool operator==(const LightShafts&) const = default;
};

// Droplets near the ground, which scatter light as the clouds do. Along a ray, extinction (per metre) is
//     extinction_per_m * exp(-(z - base_m) / height_m) * max(0, 1 + 2 patchiness (n - 1)),
// with n the sum of two looks into noise of 0..1 (fog.h), whose mean is 1. Beyond the last shell n is 1.
struct Fog {
    double extinction_per_m = 0;  // at base_m, >= 0; 0 = none. Visibility is about 3.9 / extinction
    double base_m = 0;            // world z
    double height_m = 100;        // over which the fog thins out to 1 / e, > 0
    double patchiness = 0.5;  // 0..1: how much thicker and thinner than its mean it is from place to place
    double patch_m = 600;     // size of a patch, > 0
    Vec3 velocity_m_per_s{1, 0, 0};  // at which patches drift
    std::uint64_t seed = 1;          // of the patches
    bool operator==(const Fog&) const = default;
};

// Throw Error(usage) naming the first value that is out of its range.
void check(const Shells& shells);
void check(const LightShafts& shafts);
void check(const Fog& fog);

}  // namespace nephos
