// SPDX-License-Identifier: Apache-2.0
#pragma once

// The approximation of multiply scattered sunlight. Plain data.

namespace nephos {

enum class MultipleScattering {
    // One isotropic term that decays with the optical depth tau towards the sun like diffusion through a
    // slab: 1 / (1 + 1.5 (1 - mean cosine) tau). It reaches deepest.
    diffusion,
    // Octaves of the direct light, each weaker, less attenuated and more isotropic than the one before.
    octaves,
};

// Wrenninge, Kulla and Lundqvist 2013, "Oz: The Great and Volumetric": the light scattered towards the eye is
//     sum over o = 0 .. count-1 of scattering^o exp(-extinction^o tau) p(theta, directed by asymmetry^o)
// Octave 0 is single scattering and exact; the others approximate longer and longer paths.
struct ScatteringOctaves {
    int count = 8;             // 1..8; 1 = single scattering
    double scattering = 0.65;  // 0..1: larger is brighter
    double extinction = 0.5;   // 0..1: smaller reaches deeper
    double asymmetry = 0.6;    // 0..1: smaller is more isotropic
    bool operator==(const ScatteringOctaves&) const = default;
};

}  // namespace nephos
