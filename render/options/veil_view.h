// SPDX-License-Identifier: Apache-2.0
#pragma once

// How a veil (density/veil.h) is drawn per pixel: as a slab over the round Earth, with which each ray is cut.

namespace nephos {

enum class VeilLighting {
    physical,  // single scattering, and what is scattered often, by the two-stream solution of a level sheet
    two_samples,  // S's: the density here and towards the sun
};

// S's light of a sample (docs/veils.md), with N(p) the density, l towards the sun, v towards the viewer:
//
//     C    = lerp(C_a, C_d, df) + C_in
//     df   = (shade_gain (N(p) - N(p + l sun_step_m)) + shade_offset)^shade_power
//     C_a  = lerp(sky's light, the sun's, gr)                 gr: height in the veil, 0 at its base, 1 at its top
//     C_d  = the sun's light times glow_gain (1 - h . v)^glow_power,   h = (l + v) / |l + v|
//     C_in = the ground's light times (1 - gr)^bounce_power
struct TwoSampleLight {
    double sun_step_m = 120;                                         // > 0
    double shade_gain = 0.6, shade_offset = 0.4, shade_power = 1.2;  // -100..100, -100..100, 0..100
    double glow_gain = 1.2, glow_power = 0.5;                        // 0..100
    double bounce_power = 2;                                         // 0..100
    bool operator==(const TwoSampleLight&) const = default;
};

struct VeilView {
    VeilLighting light = VeilLighting::physical;
    int samples = 48;        // steps of a ray, at most; 4..256; those where the veil is dense are divided
    int finer_octaves = 3;   // after those of the veil, 0..12; pictures fade what a pixel does not resolve
    bool to_horizon = true;  // false: the veil ends with its lattice
    // Factor of the density by height, S's g(x) = a x + b for x = -1/2 at the base and 1/2 at the top; not below 0.
    double height_slope = 0, height_offset = 1;  // -100..100
    double g = 0.8;                              // asymmetry of the physical phase function, -0.99..0.99
    // Of physical light: fraction of the ice that is hexagonal prisms, which refract by 22 degrees and more, 0..1.
    double halo = 0;
    TwoSampleLight two_samples;
    bool operator==(const VeilView&) const = default;
};

// Throws Error(usage) naming the first value that is out of its range.
void check(const VeilView& view);

}  // namespace nephos
