// SPDX-License-Identifier: Apache-2.0
// What C++ and GLSL both read: the structs in buffers, the constants, and the formulas that tests check in
// C++. Positions are relative to the eye (view pass) or to the middle of the shadow map (light pass), in
// metres: single precision keeps millimetres near the camera wherever it stands in the world.
#ifndef NEPHOS_RENDER_SHADERS_SHARED_H
#define NEPHOS_RENDER_SHADERS_SHARED_H

#ifdef __cplusplus
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace nephos::shader {

struct vec4 {
    float x = 0, y = 0, z = 0, w = 0;
};
using uint = std::uint32_t;
using std::sqrt;
#define NEPHOS_CONST inline constexpr
#define NEPHOS_FUNCTION inline
#else
#define NEPHOS_CONST const
#define NEPHOS_FUNCTION
#endif

NEPHOS_CONST uint kAttenuationLevels = 64u;   // textures in the array
NEPHOS_CONST uint kAttenuationTexels = 64u;   // on each side of one texture
NEPHOS_CONST float kMaxDepthScale = 32.0f;    // depth scale of the last level, see level_of()
NEPHOS_CONST float kNearDistance = 1.5f;      // in radii: nearer metaballs are integrated, not textured
NEPHOS_CONST float kMinRadiusPixels = 1.25f;  // smaller billboards are widened to it and thinned out
NEPHOS_CONST float kPi = 3.14159265358979f;
NEPHOS_CONST uint kComputeGroup = 64u;  // invocations in a work group
NEPHOS_CONST uint kIntegrate = 1u;      // flag: evaluate the integral along the ray, do not use the textures
NEPHOS_CONST uint kAround = 2u;         // flag: around or close to the eye, covers the whole picture
NEPHOS_CONST float kMinPuffPixels = 1.0f;   // smaller billboards of T are widened to this half size

// A metaball as the eye sees it; 32 bytes.
struct ViewBall {
    float x, y, z;      // centre relative to the eye
    float radius;       // metres
    float depth_scale;  // extinction at the centre * radius: optical depth = depth_scale * column()
    float light;        // transmittance towards the sun
    float height;       // in the cloud: 0 base, 1 top
    uint flags;    // lower half; upper half: share of the lightning that arrives, 0..65535
};

// One of T's billboards as the eye sees it; 32 bytes.
struct Puff {
    float x, y, z;      // centre relative to the eye
    uint half_size;     // half width, half height in metres as two 16-bit floats
    uint texture_bits;  // layer | turn << 8 | level << 12
    uint absorbed;      // of the sun, of the lightning: two times 0..65535 for 0..1
    float opacity;
    uint cloud;
};

// What the billboards of a cloud share; 32 bytes.
struct PuffCloud {
    float x, y, z;         // centre relative to the eye
    float base;            // height relative to the eye
    float inverse_height;  // of the cloud
    uint pad0, pad1, pad2;
};

// A metaball as the sun sees it; 32 bytes.
struct LightBall {
    float u, v;    // metres in the plane of the shadow map, from its middle
    float radius;  // metres
    float depth_scale;
    float fraction;  // where in its slab the centre lies: 0 at the side of the sun, 1 at the far side
    uint source;     // its place in the cloud; not used by shaders
    uint pad0, pad1;
};

// Push constants of the light pass.
struct LightStep {
    float clip_per_metre_u, clip_per_metre_v;  // from metres to -1..1 across the map
    float min_radius_u, min_radius_v;          // metres; billboards are widened to these half sizes
    uint first;                                // compute: first metaball,
    uint middle;                               // first one of the next slab,
    uint end;                                  // end of the next slab
    uint pad0;
};

// Everything about one picture (or tile of it) that shaders need.
struct Frame {
    vec4 right;           // xyz: the camera's axis * half the picture's width at distance 1
    vec4 up;              // xyz: likewise; w: pixels per unit at distance 1
    vec4 forward;         // xyz: unit
    vec4 picture;         // width, height of the picture; column and row of the tile's corner, pixels
    vec4 tile;            // clip position in the tile = position in the picture * tile.xy + tile.zw
    vec4 to_sun;          // xyz: unit; w: asymmetry g
    vec4 sunlight;        // rgb: colour of the direct sun; w: strength of multiple scattering
    vec4 ambient_top;     // rgb; w: albedo of the cloud
    vec4 ambient_base;    // rgb; w: decay of diffuse light per optical depth
    vec4 air_extinction;  // rgb: per metre; w: 1 = light of metaballs is T's (1 - absorbed), 0 = a transmittance
    vec4 horizon;         // rgb: sky at the horizon, and light of the air itself
    vec4 zenith;          // rgb
    vec4 ground;  // rgb: radiance of the ground under open sky without the sun; w: height above the eye (< 0)
    vec4 ground_sun;  // rgb: what the unshaded sun adds; w: 1 = there is a ground
    vec4 shadow_u;    // shadow map coordinate 0..1 of a point p: dot(xyz, p) + w
    vec4 shadow_v;
    vec4 flash;         // xyz: lightning relative to the eye; w: irradiance at 1 km, 0 = none
    vec4 flash_colour;  // rgb
    vec4 ground_flash;  // rgb: what it adds to ground 1 km below it
};

// Irradiance of lightning relative to that at 1 km.
NEPHOS_FUNCTION float flash_falloff(float squared_distance_m) {
    return 1.0e6f / (squared_distance_m > 1.0e4f ? squared_distance_m : 1.0e4f);
}

// The field of a metaball with u = 1 - a^2 is f = u^2 (5 + 4 u) / 9. Along a line at distance b from the
// centre, with w = 1 - b^2 (square of half the chord) and s from -sqrt(w) to sqrt(w), u = w - s^2 and
//
//     integral of (w - s^2)^2 = 16/15 w^(5/2),   of (w - s^2)^3 = 32/35 w^(7/2),   so
//     column(w) = w^(5/2) (16/27 + 128/315 w),   in units of the radius
NEPHOS_FUNCTION float column(float w) {
    return w * w * sqrt(w) * (0.592592592592593f + 0.406349206349206f * w);
}

// The integral from the middle of the chord up to s (|s| <= sqrt(w)), odd in s.
NEPHOS_FUNCTION float column_part(float w, float s) {
    float s2 = s * s;
    float square = w * w + s2 * (-2.0f / 3.0f * w + 0.2f * s2);
    float cube = w * w * w + s2 * (-w * w + s2 * (0.6f * w - s2 / 7.0f));
    return s * (5.0f / 9.0f * square + 4.0f / 9.0f * cube);
}

// Henyey-Greenstein phase function, per steradian; integrates to 1 over the sphere. cos_theta is the cosine
// of the angle between the directions of travel before and after: 1 = straight on. Forward scattering is g >
// 0.
NEPHOS_FUNCTION float phase_function(float cos_theta, float g) {
    float base = 1.0f + g * g - 2.0f * g * cos_theta;
    return (1.0f - g * g) / (4.0f * kPi * base * sqrt(base));
}

#ifdef __cplusplus
static_assert(sizeof(ViewBall) == 32 && offsetof(ViewBall, depth_scale) == 16 &&
              offsetof(ViewBall, flags) == 28);
static_assert(sizeof(LightBall) == 32 && offsetof(LightBall, fraction) == 16);
static_assert(sizeof(LightStep) == 32 && offsetof(LightStep, first) == 16 && offsetof(LightStep, end) == 24);
static_assert(sizeof(Puff) == 32 && offsetof(Puff, half_size) == 12 && offsetof(Puff, cloud) == 28);
static_assert(sizeof(PuffCloud) == 32 && offsetof(PuffCloud, inverse_height) == 16);
static_assert(sizeof(Frame) == 19 * 16 && offsetof(Frame, tile) == 64 && offsetof(Frame, shadow_v) == 240 &&
              offsetof(Frame, flash_colour) == 272);

}  // namespace nephos::shader
#endif
#endif
