// SPDX-License-Identifier: Apache-2.0
#pragma once

// Shells of air around the eye, and what they carry: light shafts. Included by options.h.

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

// Throw Error(usage) naming the first value that is out of its range.
void check(const Shells& shells);
void check(const LightShafts& shafts);

}  // namespace nephos
