// SPDX-License-Identifier: Apache-2.0
// Constants and structs of rain and snow, shared by C++ and the shaders that draw them (render/vulkan/device_rain.h).
#ifndef NEPHOS_RENDER_SHADERS_RAIN_H
#define NEPHOS_RENDER_SHADERS_RAIN_H

#include "render/shared/shared.h"

#ifdef __cplusplus
namespace nephos::shader {
using Exact = double;  // of constants that the processor uses in double precision
using Words4 = std::uint32_t[4];
#else
#define Exact float
#define Words4 uvec4
#endif

// Shafts (rain_shafts.h).
NEPHOS_CONST int kShaftSteps = 24;
NEPHOS_CONST int kShaftStepsPerLight = 3;  // three steps have light and falls of the one in their middle
NEPHOS_CONST float kShaftLeastSeen = 1.0f / 4096;
NEPHOS_CONST float kShaftTopFade = 0.15f;    // fraction of the height over which a curtain fades in
NEPHOS_CONST float kShaftCloudFade = 0.04f;  // likewise below the base of a cloud that is known
NEPHOS_CONST int kShaftNoiseBits = 7;
NEPHOS_CONST int kShaftNoiseSide = 128;
// Offset of a pixel's steps, 0.25..0.75 of a step: interleaved gradient noise (Jimenez 2014),
// frac(53 frac(0.06711056 x + 0.00583715 y)), in integers.
NEPHOS_CONST uint kShaftOffsetX = 288237660u, kShaftOffsetY = 25070368u, kShaftOffsetMix = 13564u;

// Particles (particle_streaks.cpp).
NEPHOS_CONST Exact kNearestDrop_m = 0.3, kNearDropFade_m = 0.7;  // drops before the eye vanish
NEPHOS_CONST Exact kReachFade = 0.2;      // last fraction of a particle's reach, in which it fades
NEPHOS_CONST Exact kVerticalFade = 0.3;   // of half the height of a near container
NEPHOS_CONST Exact kNumberFade = 0.1;     // fraction of the particles that fade when their number decreases
NEPHOS_CONST Exact kMostDropOpaque = 0.85;
NEPHOS_CONST Exact kLeastDropOpaque = 1.0 / 2048;
NEPHOS_CONST Exact kMostFarPixels = 2;    // width of a far streak
NEPHOS_CONST Exact kDropFlicker = 0.25;   // of the light of drops, which oscillate
NEPHOS_CONST Exact kDropFlickers = 911;   // turns of it over a particle's phase
NEPHOS_CONST Exact kRainGrowth = 8, kSnowGrowth = 2;  // of the size over the depth of a container
NEPHOS_CONST float kWideStreak = 2.5f;    // pixels; from here on ends are round (overlay.cpp)
// Flakes sway in circles (sway_of()).
NEPHOS_CONST uint kSwayStarts = 977u, kSwaySpeeds = 19u, kSwayRadii = 7u;
NEPHOS_CONST Exact kSwayStart = 0.37, kSwayHarmonic = 2.3;
NEPHOS_CONST Exact kSwayLeast_m = 0.04, kSwayMore_m = 0.01;
NEPHOS_CONST Exact kSwaySlowest = 1.5, kSwayFaster = 0.13;  // rad/s

// Light (precipitation_light.h).
NEPHOS_CONST Exact kForwardFraction = 0.8;
NEPHOS_CONST uint kHorizonNodes = 16u;  // PictureAir::kHorizons
NEPHOS_CONST uint kBowCells = 2048u;    // Rainbow::kCells

// Limits of the device's passes.
NEPHOS_CONST uint kMostCurtains = 64u;        // in a picture; more are drawn by the processor
NEPHOS_CONST uint kRainGroup = 64u;           // invocations of a work group; a tile of 8 x 8 pixels
NEPHOS_CONST uint kRainTile = 8u;             // pixels
NEPHOS_CONST uint kStreakSegment = 1024u;     // particles of one work group, whose streaks come one after the other
// Particles that are drawn at once: lavapipe leaves the loops of a shader after 65,535 turns.
NEPHOS_CONST uint kStreakSegments = 56u;
NEPHOS_CONST uint kParticlesAtOnce = 57344u;  // kStreakSegments * kStreakSegment
NEPHOS_CONST uint kStreakBandRows = 16u;      // of pixels, with a list of streaks

// A curtain of rain relative to the eye, as SeenCurtain (rain_shafts_pass.h) has it, and the law of its drops.
struct SeenRain {
    vec4 eye;     // xy: the eye in units of the semi-axes; z: metres above the ground; w: height of the cloud, m
    vec4 axes;    // ax, ay, bx, by: from metres to units
    vec4 circle;  // xy: middle of the circle around it, from the eye; z: its radius; w: extinction where rain is whole
    vec4 lean;    // xy: metres a metre of height; z: noise of its own; w: its falls
    vec4 grain;   // xy: the eye in cells of the texture; z: cells a metre; w: cells of the falls a metre of height
    vec4 cloud;   // xy: the eye in texels of the cloud's bases; z: texels a metre; w: world height of the ground
    vec4 sun;     // xy: a metre towards the sun, in units; z: extinction of its light; w: sun_profile()
    vec4 law;     // x: particles per m^3 and drawn one at diameter 0; y: growth of that a mm; z: 1 / height of the cloud
    // First word of the cloud's bases, columns, rows, and bits: 1, 2: it repeats along x, y. No columns: a level cloud.
    Words4 bases;
};

// Uniforms of the rain of a picture, relative to the eye.
struct RainUniforms {
    vec4 forward;     // xyz: of the camera; w: 1 = depth is a sum that is still to be divided by the opacity
    vec4 right, up;   // xyz: to the sides of the picture; w: its width, its height in pixels
    vec4 by_sky, by_sunlit_ground, by_scattered_sun;  // PrecipitationLight
    vec4 sun;         // rgb; w: 1 = there is sunlight
    vec4 to_sun;      // xyz: unit; w: asymmetry of the particles' phase function
    vec4 flash;       // rgb; w: 1 = there is lightning
    vec4 flash_m;     // xyz; w: 1 = the light on the ground is known
    vec4 air;         // rgb: extinction per metre; w: fraction of the light in bows, 0: no bows
    vec4 ground_place;      // ground_light_place()
    vec4 shadow_u, shadow_v;  // xyz: of a point, map coordinate 0..1; w: of the eye
    vec4 shape;       // softness, fray, contrast, evaporation
    vec4 extra;       // x: metres around the eye without shafts; y: 1 = there is a shadow map; z: number of curtains; w: edge
    vec4 horizon[kHorizonNodes];  // rgb: PictureAir::horizon
    SeenRain curtains[kMostCurtains];
};

// One container of particles (ParticlePass).
struct RainPass {
    vec4 centre;    // xyz: from the eye to the middle of the boxes; w: factor of the opacity
    vec4 axis;      // xy: the container's direction; zw: far: direction from the eye to it
    vec4 nearest;   // xy: from the eye to the container's point; z: far: depth, else 0; w: 1 = the rear half is visible
    vec4 boxes;     // depth, height; fraction of the particles that exist; number of particles
    vec4 box_low;   // depth and margin, less what boxes_high has of them; number per m^3 at density 1; size s0
    vec4 box_high;  // twice the depth, margin as floats; exposure; visibility
    vec4 away_x;    // xy: from the centre to the air at time 0, as a sum of two floats; zw: along y
    vec4 away_z;    // xy: upwards, in heights, likewise; zw: heights that a fall of 1 m/s takes
    vec4 wind;      // xy: m/s; z: pixels of a unit at distance 1; w: 1 = snow
    // The camera at the opening and the closing of the shutter: from the eye; axes over half the extent of the picture.
    vec4 opening, opening_right, opening_up, opening_forward;
    vec4 closing, closing_right, closing_up, closing_forward;
    vec4 sunlight;  // xyz: from the eye to the place whose sunlight all particles have; w: that, -1: the map has it
    // Curtains with rain, and those whose rain is in another pass: a bit each.
    Words4 rain;    // xy; zw: less
    vec4 sway[kSwaySpeeds];  // of flakes: angle and its harmonic by the speed of turning, -pi..pi
};

// A particle: phases, reach, speed of fall, and what its size means; 32 bytes.
struct RainParticle {
    float x, y, z;      // 0..1 in its box
    float reach;        // 0..1
    float speed;        // m/s
    float diameter_mm;
    float width_m;
    float shadow_m2;    // cross-section
};

// Push constants.
struct RainStep {
    uint x, y;            // corner of the part of the picture, pixels
    uint width, height;   // of it
    uint tiles_x, tiles;  // of kRainTile x kRainTile pixels: in a row, in all
    uint bands;           // of kStreakBandRows rows
    uint pass;            // index of the RainPass
    uint first, count;    // particles that are drawn
};

#ifdef __cplusplus
static_assert(sizeof(SeenRain) == 144 && sizeof(RainUniforms) == 16 * (16 + kHorizonNodes) + 144 * kMostCurtains);
static_assert(sizeof(RainUniforms) <= 16384);  // of which every device has as much
static_assert(sizeof(RainPass) == 16 * (19 + kSwaySpeeds));
static_assert(sizeof(RainParticle) == 32 && sizeof(RainStep) == 40);
static_assert(kParticlesAtOnce == kStreakSegments * kStreakSegment && kRainTile * kRainTile == kRainGroup);
static_assert(kShaftNoiseSide == 1 << kShaftNoiseBits && kStreakBandRows % kRainTile == 0);

}  // namespace nephos::shader
#endif
#endif
