// SPDX-License-Identifier: Apache-2.0
#pragma once

// Splats in the form that the processor draws (processor_view.h). Private to the module.

#include <cstddef>
#include <cstdint>

#include "render/shared/shared.h"

namespace nephos {

// A metaball on the screen, ready to be drawn; one cache line. With d the direction of a pixel's ray and d0
// that of the centre c, the squared distance of the ray from the centre is |c x d|^2 / |d|^2, and c x d =
// c x (d - d0): a quadratic form of the pixel's offset from the centre, exact for any field of view.
struct ScreenBall {
    float x, y;        // of the centre, pixels; x has the bits of a number where `distance` is not above 0
    float xx, xy, yy;  // squared distance in radii, times |d|^2: xx dx^2 + xy dx dy + yy dy^2
    float fit[6];      // c0..c5 of the opacity (render/shared/shared.h)
    float red, green, blue;   // radiance at opacity 1
    float distance;           // metres; 0: not fitted, see ExactBall; < 0: see ScreenBillboard
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

// One of T's billboards in the place of a ScreenBall: a rectangle on the screen. With s and t from -1 to 1
// across it, to the right and up, its light is that of its corners, interpolated over two triangles: l0 + s
// l1 + t l2 + max(t - s, 0) l3.
struct ScreenBillboard {
    float x, y;                             // of the centre, pixels
    float per_half_width, per_half_height;  // 1 / pixels
    // In steps of 2^n: three each of l0..l3, radiance of the cloud where it is opaque, times `opacity`; then
    // three of the air, times `opacity`.
    std::int16_t light[15];
    std::uint16_t step;          // upper half of the bits of the float 2^n
    float opacity;               // 0..1
    std::uint32_t texture_bits;  // shader::ViewBillboard
    float distance;              // metres; below 0, as that of no ball
    std::int16_t first, end;     // rows of pixels
};
static_assert(sizeof(ScreenBillboard) == sizeof(ScreenBall) &&
              offsetof(ScreenBillboard, distance) == offsetof(ScreenBall, distance) &&
              offsetof(ScreenBillboard, first) == offsetof(ScreenBall, first));

// Rows of a tile, half-open.
struct Rows {
    std::size_t begin, end;
};

}  // namespace nephos
