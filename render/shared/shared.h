// SPDX-License-Identifier: Apache-2.0
// Code that C++ and GLSL both compile: structs in buffers, constants, and formulas, which tests check in C++.
// Positions are relative to the eye (view pass) or to the middle of the shadow map (light pass), in metres:
// single precision resolves millimetres near the camera anywhere in the world.
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
using std::abs;
using std::exp;
using std::log2;
using std::sqrt;
#define NEPHOS_CONST inline constexpr
#define NEPHOS_FUNCTION inline
#else
#define NEPHOS_CONST const
#define NEPHOS_FUNCTION
#endif

NEPHOS_CONST uint kAttenuationLevels = 64u, kAttenuationTexels = 64u;  // textures in the array, texels on a side
NEPHOS_CONST float kMaxDepthScale = 32.0f;    // depth scale of the last level, see level_of()
NEPHOS_CONST float kNearDistance = 1.5f;      // in radii: nearer metaballs are integrated, not textured
NEPHOS_CONST float kMinRadiusPixels = 1.25f;  // smaller billboards are widened to it and thinned out
NEPHOS_CONST float kPi = 3.14159265358979f;
NEPHOS_CONST uint kComputeGroup = 64u;  // invocations in a work group, where nothing else decides
NEPHOS_CONST uint kTileWidth = 8u, kTileHeight = 16u;  // pixels
NEPHOS_CONST uint kQueriesPerLane = 4u;
NEPHOS_CONST float kDistanceUnit = 16.0f;     // metres
NEPHOS_CONST float kOpaque = 1.0f / 4096.0f;  // transmittance below which splats behind are skipped
NEPHOS_CONST float kSunOpaque = 1.0f / 4294967296.0f;  // ... where the sun is behind: its disc outshines all else
NEPHOS_CONST uint kIntegrate = 1u;  // flag: evaluate the integral along the ray, do not use the textures
NEPHOS_CONST uint kNotFitted = 4u;  // flag: the tiles evaluate the integral, whatever the billboards do
NEPHOS_CONST uint kBillboardFlag = 8u;  // flag, of no metaball: a billboard, whose index is in the bits from 4 on
NEPHOS_CONST uint kAround = 2u;  // flag: around or close to the eye, covers the whole picture
NEPHOS_CONST uint kSkyColumns = 64u, kSkyRows = 96u;  // of the tables of the sky (atmosphere.h)
// Scattered, haze, sunlight by altitude; and of the air up to a distance: extinction, the source of what is
// scattered and of haze, each towards the sun, beside it and away from it.
NEPHOS_CONST uint kSkyLayers = 10u;
// Of the azimuths of the latter three, from the sun's: 1, 0 and -1 times this is their cosine. So the error of what is
// square in the cosine between them is less than with 1, and beyond them no larger.
NEPHOS_CONST float kAirAzimuth = 0.93f;
NEPHOS_CONST uint kAirLayer = 3u;             // the first of the latter
NEPHOS_CONST uint kAirRows = 48u;             // of those above the horizon, and of those below
// Metres within which light shafts lie: what they take away is no more than the source of this air.
NEPHOS_CONST float kShaftsReach = 8000.0f;
NEPHOS_CONST float kAirScale = 80000.0f;      // metres, see air_distance()
NEPHOS_CONST float kSunlightTop = 16000.0f;   // metres above the ground: sunlight changes no more
NEPHOS_CONST float kSunRadius = 0.00462512f;  // radians
// Radiance of the sun's disc falls off towards its limb as cosine^exponent; red, green, blue (near 680, 550
// and 440 nm): D. Hestroffer and C. Magnan, "Wavelength dependency of the Solar limb darkening", 1998.
NEPHOS_CONST float kLimbDarkeningRed = 0.397f, kLimbDarkeningGreen = 0.503f, kLimbDarkeningBlue = 0.652f;
NEPHOS_CONST uint kFogVoxels = 32u;       // of the noise of fog, on a side; a power of two
NEPHOS_CONST float kFarShell_m = 1.0e6f;  // with fog, a last shell of all the air beyond the others ends here
NEPHOS_CONST uint kMaxShells = 128u;
NEPHOS_CONST uint kGroupRow = 32768u;               // work groups in a row: devices allow 65535 on an axis
NEPHOS_CONST uint kScatterAngles = 513u;            // nodes of the scattering table, see scatter_column()
NEPHOS_CONST uint kScatterDepths = 97u;             // ... and scatter_row()
NEPHOS_CONST float kScatterRowsPerDoubling = 8.0f;  // of 1 + optical depth
NEPHOS_CONST float kMaxSunDepth = 4095.0f;          // of the last row; beyond it nothing changes
NEPHOS_CONST float kMinBillboardPixels = 1.0f;      // smaller billboards of T are widened to this half size
NEPHOS_CONST uint kBillboardTexels = 128u;          // on a side of their finest textures; a power of two

// A metaball in camera space; 32 bytes.
struct ViewBall {
    float x, y, z;      // centre relative to the eye
    float radius;       // metres
    float depth_scale;  // extinction at the centre * radius: optical depth = depth_scale * line_integral()
    // Optical depth towards the sun: exp(-sun_depth) arrives. Below 0 its bits hold two halfs without their signs: of light
    // that is scattered once, and behind it the one at which scattered_often() gives the light that diffuses
    // (two_depths() in render/frame/scattering_table.h).
    float sun_depth;
    float height;       // in the cloud: 0 base, 1 top
    uint flags;  // lower half; upper half: transmitted fraction of the lightning, 0..65535. On the device a
                 // ViewBall with kBillboardFlag stands for a billboard and has nothing but its centre
};

// One of T's billboards in camera space; 32 bytes.
struct ViewBillboard {
    float x, y, z;      // centre relative to the eye
    uint half_size;     // half width, half height in metres as two 16-bit floats
    uint texture_bits;  // layer | turn << 8 | level << 12 | sunlight that arrives, 0..65535, << 16
    uint absorbed;      // of the sun, of the lightning: two times 0..65535 for 0..1
    float opacity;
    uint cloud;
};

// The cloud of a set of billboards; 32 bytes.
struct ViewCloud {
    float x, y, z;         // centre relative to the eye
    float base;            // height relative to the eye
    float inverse_height;  // of the cloud
    uint pad0, pad1, pad2;
};

// A metaball projected to the screen; 16 bytes, and 4 more of SplatTail. As small as possible: lavapipe
// fetches words from a buffer one by one, which costs more than drawing a splat's pixels.
struct ViewSplat {
    float x, y;           // of the centre, pixels
    uint size_and_depth;  // halves: radius at the centre's depth, pixels; square root of the depth scale
    uint red_and_green;   // halves: radiance at opacity 1
};
// halves: blue; distance in units of kDistanceUnit, or 0: evaluate the integral of its ViewBall along each
// ray instead.
#define SplatTail uint

// A metaball projected to the shadow map; 16 bytes.
struct LightSplat {
    float x, y;         // of the centre, texels
    uint radii;         // halves: along x and y, texels
    float depth_scale;  // optical depth through the middle = depth_scale * line_integral(1)
};
// Its position along the light; 8 bytes.
struct LightPlace {
    float z;           // metres from the first centre
    float per_radius;  // 1 / radius in metres
};

// A point whose light is to be computed; 16 bytes.
struct LightQuery {
    float x, y, z;  // as in LightSplat
    float depth;    // optical depth towards the sun, accumulated
};

// Queries that lie in one tile: up to kQueriesPerLane for each invocation.
struct LightItem {
    uint tile, first, count, pad0;
};

// Entries of the list of splats that belong to a tile: list[begin] .. list[end - 1].
struct TileRange {
    uint begin, end;
};

// Push constants of the compute passes.
struct TileStep {
    uint width, height;            // of the picture or the map, pixels
    uint tiles_x;                  // tiles in a row
    uint tile_count;               // or number of splats that there is room for, or of items
    uint first_batch, last_batch;  // booleans: clear the sums before; light: finish them after
    float largest_radius;          // light: metres, of any splat
    uint part;                     // view: index of the ViewPart (order.h) that is drawn
    uint distances;                // view: boolean, depth is requested
};

// Uniforms of one image, or of a tile of it.
struct FrameUniforms {
    vec4 right;           // xyz: the camera's axis * half the image's width at distance 1
    vec4 up;              // xyz: likewise; w: pixels per unit at distance 1
    vec4 forward;         // xyz: unit
    vec4 picture;         // width, height of the picture; column and row of the tile's corner, pixels
    vec4 part;            // clip position in the part = position in the picture * part.xy + part.zw
    vec4 to_sun;          // xyz: unit
    vec4 sunlight;        // rgb: colour of the direct sun
    vec4 ambient_top;     // rgb; w: albedo of the cloud
    vec4 ambient_base;    // rgb
    vec4 air_extinction;  // rgb: per metre
    vec4 horizon;  // gradient: sky at the horizon, and light of the air; w: its fraction of single scattering
    vec4 zenith;   // rgb; w: asymmetry g of the haze
    vec4 ground;  // rgb: radiance of the ground under open sky without the sun; w: height above the eye (< 0)
    vec4 ground_sun;  // rgb: what the unshaded sun adds; w: 1 = there is a ground
    vec4 shadow_u;    // shadow map coordinate 0..1 of a point p: dot(xyz, p) + w
    vec4 shadow_v;
    vec4 flash;         // xyz: lightning relative to the eye; w: irradiance at 1 km, 0 = none
    vec4 flash_colour;  // rgb
    vec4 ground_flash;  // rgb: what it adds to ground 1 km below it
    // The physical sky (air.h); zero with the gradient.
    vec4 rayleigh;  // rgb: extinction by molecules per metre on the ground; w: 1 / height of the layer
    vec4 haze;      // rgb: extinction by particles; w: likewise
    vec4 air;       // eye's altitude above the ground, m; asymmetry and albedo of particles; 1 = physical sky
    vec4 sun_disc;  // rgb: radiance of its middle; w: 1 = there is a disc
    vec4 sun_fade;  // rgb: change of the logarithm of its radiance with the sine of the elevation
    vec4 earth;  // x: sine of the horizon's elevation; y: altitude (2 R + altitude) / (R + altitude), m, of a
                 // plane twice the altitude; z: 1 / (2 (R + altitude))
};

// Shells of air around the eye (air_shells.h).
struct Shells {
    vec4 ends[kMaxShells / 4u + 1u];  // metres from the eye at which each shell ends and the next begins
    vec4 settings;  // x: number of shells; y: strength of shafts; z: texels in a row of the shade map; w: in all
    vec4 shade_u;   // shade map: column of a point p relative to the eye, dot(xyz, p) + w, texels
    vec4 shade_v;   // row
    vec4 shade_along;  // downwards, or along the light: 0 where the first cloud begins, 1 where the last ends
    vec4 shade;  // x, y: largest column and row; z: along `shade_along`, where shade begins; w: m to the end of shafts
    vec4 fog;    // x: extinction at the base, per metre; y: 1 / height over which it falls off; z: height of
                 // the eye above the base; w: how much it varies
    vec4 fog_coarse;  // xyz: where in the noise the eye is, 0..1; w: 1 / size of the noise in metres
    vec4 fog_fine;    // the same of the second look-up, for y, z, x
    vec4 fog_limits;  // x: height above the base beyond which there is no fog worth drawing
};

// Returns the position in a shell, 0..1, at which a pixel samples it: multiples of the golden ratio along a
// Hilbert curve through blocks of 64 x 64 pixels. Neighbours on the curve are neighbours in the picture, so that the
// offsets of a few pixels near each other are spread evenly. In integers: the same on every machine.
NEPHOS_FUNCTION float shell_offset(uint x, uint y) {
    uint column = x & 63u, row = y & 63u, along = 0u;
    for (uint side = 32u; side > 0u; side >>= 1u) {
        uint right = (column & side) != 0u ? 1u : 0u, up = (row & side) != 0u ? 1u : 0u;
        along += side * side * ((3u * right) ^ up);
        if (up == 0u) {
            uint other = right == 1u ? 63u - column : column;
            column = right == 1u ? 63u - row : row;
            row = other;
        }
    }
    uint block = (x >> 6u) * 3242174889u + (y >> 6u) * 2447445414u;
    return float((along * 2654435769u + block) >> 8u) * (1.0f / 16777216.0f);
}

// The scattering angle varies over the disc of a metaball: weighted by opacity, the mean of 1 - cos exceeds
// its value at the centre by this factor times the square of the angular radius. A lobe of the phase function
// narrower than the disc is thus averaged over it instead of making one bright dot.
NEPHOS_CONST float kDiscSpread = 0.11f;

#ifdef __cplusplus
using Real = float;
inline float mul_add(float a, float b, float c) { return a * b + c; }
inline float select(bool condition, float a, float b) { return condition ? a : b; }
inline float min(float a, float b) { return b < a ? b : a; }
inline float max(float a, float b) { return a < b ? b : a; }
inline float fast_exp(float x) { return exp(x); }
#else
#define Real float
#define Truth bool
#define mul_add(a, b, c) ((a) * (b) + (c))
#define select(condition, a, b) ((condition) ? (a) : (b))
#define fast_exp(x) exp(x)
#endif
#include "render/shared/formulas.h"
#include "render/shared/opacity_fit.h"

#ifdef __cplusplus
static_assert(sizeof(ViewBall) == 32 && offsetof(ViewBall, depth_scale) == 16 &&
              offsetof(ViewBall, flags) == 28);
static_assert(sizeof(ViewSplat) == 16 && sizeof(LightSplat) == 16 && sizeof(LightPlace) == 8);
static_assert(sizeof(LightQuery) == 16 && sizeof(LightItem) == 16);
static_assert(sizeof(TileRange) == 8 && sizeof(TileStep) == 36);
static_assert(sizeof(ViewBillboard) == 32 && offsetof(ViewBillboard, half_size) == 12 &&
              offsetof(ViewBillboard, cloud) == 28);
static_assert(sizeof(ViewCloud) == 32 && offsetof(ViewCloud, inverse_height) == 16);
static_assert(sizeof(Shells) == 16 * (kMaxShells / 4 + 10) &&
              offsetof(Shells, shade_u) == 16 * (kMaxShells / 4 + 2));
static_assert(sizeof(FrameUniforms) == 25 * 16 && offsetof(FrameUniforms, part) == 64 &&
              offsetof(FrameUniforms, shadow_v) == 240 && offsetof(FrameUniforms, flash_colour) == 272 &&
              offsetof(FrameUniforms, sun_fade) == 368 && offsetof(FrameUniforms, earth) == 384);

}  // namespace nephos::shader
#endif
#endif
