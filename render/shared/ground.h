// SPDX-License-Identifier: Apache-2.0
// Structs of the pass over the ground, shared by C++ and the shaders that draw it (render/vulkan/device_ground.h). They
// are read from storage buffers: lavapipe compiles a shader anew for each value of a uniform that a branch depends on.
#ifndef NEPHOS_RENDER_SHADERS_GROUND_H
#define NEPHOS_RENDER_SHADERS_GROUND_H

#include "render/shared/shared.h"

#ifdef __cplusplus
namespace nephos::shader {
#endif

NEPHOS_CONST uint kMirrorLevels = 8u;     // of the mirrored view, at most
NEPHOS_CONST uint kRippleSide = 128u;     // texels of the square of ripples, a power of two
NEPHOS_CONST float kRippleSquare_m = 2.0f;  // its side
NEPHOS_CONST float kRippleApart_m = 1.3f;   // of the corners of the triangles between hexagons (ripple_grid.h)
NEPHOS_CONST uint kCropKinds = 8u;        // of country
NEPHOS_CONST float kFilmDeviations = 0.6f;  // standard deviation of the logarithm of the hollows' depths
NEPHOS_CONST float kWaterFromAbove = 0.0204f;  // reflectance at normal incidence

// NoiseOctave of render/ground/ground_noise.h.
struct GroundOctave {
    float x_x, x_y, y_x, y_y;
    float from_x, from_y;
    uint cell_x, cell_y;
    float wavelength_m, weight;
};

// Octaves of one noise among those of all.
struct GroundNoise {
    uint first, count;
};

// WaterWave of render/ground/water.h.
struct GroundWave {
    float x, y, phase, slope_x, slope_y, wavelength_m, variance;
};

struct GroundMirrorLevel {
    uint first, width, height;  // texels
};

// GroundPass of render/ground/ground_pass.h but for its frame, which is uniform.
struct GroundData {
    vec4 dry;            // rgb: albedo of plain ground; w: that light below water is reflected back with
    vec4 soaked;         // rgb: albedo of plain ground, soaked
    vec4 snow;           // rgb: albedo
    vec4 film;           // 1 / soaking_mm, puddle_film_mm, snow_cover_mm, sheen
    vec4 cover_place;    // from_x, from_y, per_x, per_y of CoverTexels
    vec4 outside;        // of the map: water_mm, snow_mm, rain_mm_per_h
    vec4 mirror_forward; // xyz; w: pixels of the mirrored view of a unit at distance 1
    vec4 mirror_right;   // xyz; w: 1 / (2 half_width)
    vec4 mirror_up;      // xyz; w: -1 / (2 half_height)
    vec4 crops[kCropKinds];  // rgb: factors of country
    vec4 mean_crop, wood, hedge;  // rgb
    uint columns, rows;  // of the map; 0: none
    float reflection;
    uint mirror_levels;
    GroundMirrorLevel levels[kMirrorLevels];
    uint ripple_corner_x, ripple_corner_y;  // RippleGrid from here on
    float ripple_from_x, ripple_from_y;
    float ripple_texel_x, ripple_texel_y;
    float ripple_strength;                  // 0: no ripples
    float ripple_per_mm;                    // 1 / most_mm_per_h
    float ripple_variance;
    GroundOctave fields;
    float hedge_cells, bend_m;
    float slope_variance, foam_level, foam_albedo;
    uint waves;
    GroundNoise hollows, tufts, bends, woods, tones, tussocks, gusts, foam;
    uint unused0, unused1, unused2;
};

// A level of the mirrored view is made of the one before it.
struct MirrorStep {
    GroundMirrorLevel fine, coarse;
};

#ifdef __cplusplus
static_assert(sizeof(GroundOctave) == 40 && sizeof(GroundWave) == 28 && sizeof(GroundMirrorLevel) == 12);
static_assert(offsetof(GroundData, columns) == 320 && offsetof(GroundData, levels) == 336 &&
              offsetof(GroundData, fields) == 468 && offsetof(GroundData, hollows) == 532 && sizeof(GroundData) == 608);

}  // namespace nephos::shader
#endif
#endif
