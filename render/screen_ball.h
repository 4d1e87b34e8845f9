// SPDX-License-Identifier: Apache-2.0
#pragma once

// Metaballs in the form that the processor draws (processor_view.h). Private to the module.

#include <cstdint>

namespace nephos {

// A metaball on the screen, ready to be drawn; one cache line. With d the direction of a pixel's ray and d0
// that of the centre c, the squared distance of the ray from the centre is |c x d|^2 / |d|^2, and c x d =
// c x (d - d0): a quadratic form of the pixel's offset from the centre, exact for any field of view.
struct ScreenBall {
    float x, y;        // of the centre, pixels; where `distance` is 0, x has the bits of ExactBall's number
    float xx, xy, yy;  // squared distance in radii, times |d|^2: xx dx^2 + xy dx dy + yy dy^2
    float fit[6];      // c0..c5 of the opacity (shaders/shared.h)
    float red, green, blue;   // radiance at opacity 1
    float distance;           // metres; 0: not fitted
    std::int16_t first, end;  // rows of pixels
};
static_assert(sizeof(ScreenBall) == 64);

// A metaball whose integral is evaluated along each ray.
struct ExactBall {
    float x, y, z;  // centre in radii
    float per_radius, depth_scale, distance;
    float diffuse[3];  // radiance that does not depend on the ray
    float direct[3];   // radiance per light that is scattered once
};

}  // namespace nephos
