// SPDX-License-Identifier: Apache-2.0
// Constants and structs of rays through clouds with detail (density/detail.h), shared by C++ and the shaders that march
// (render/shading/march.glsl).
#ifndef NEPHOS_RENDER_SHADERS_MARCH_H
#define NEPHOS_RENDER_SHADERS_MARCH_H

#include "render/shared/shared.h"

#ifdef __cplusplus
namespace nephos::shader {
#endif

NEPHOS_CONST uint kMostVolumes = 16u;                 // in a picture
NEPHOS_CONST float kEventOpacity = 0.12f;             // of a point that is shaded
NEPHOS_CONST float kLeavingOpacity = 0.004f;          // of one where the ray leaves cloud
// A ray ends at this many times the transmittance behind which nothing is seen.
NEPHOS_CONST float kMarchOpaqueFactor = 64.0f;
NEPHOS_CONST float kLeastStep_m = 1.0f;               // in cloud of cells of 40 m and more,
NEPHOS_CONST float kStepPixels = 0.6f;                // ... or this many footprints of a pixel
NEPHOS_CONST float kMostStepNodes = 2.0f;             // ... in a cloud that repeats at most this many half cells
NEPHOS_CONST float kStepGrowth = 4.0f;                // of steps behind opaque cloud
NEPHOS_CONST float kLongestStep_m = 30.0f;            // near cloud
NEPHOS_CONST float kBeyondFace_m = 0.01f;             // where a ray goes on behind the face of a cell or a box
NEPHOS_CONST float kBeyondBentFace_m = 1.0f;         // ... of a cloud that repeats: farther than the way there is bent
NEPHOS_CONST float kLeastHeight_m = 1.0e-3f;          // of such a cloud's top above the eye, if they are at one height
NEPHOS_CONST float kLeastAdvance = 1.0000005f;         // of a distance in any step: far away floats are coarse
// Images of a cloud that repeats are drawn aside along a wave, so that gaps do not line up: wave lengths across and along,
// in units of 1 / MarchVolume::patch_ramp, and half of how far, in wave lengths.
NEPHOS_CONST float kWaveAcross = 45.0f, kWaveAlong = 35.0f, kWaveHeight = 0.03125f;
NEPHOS_CONST float kPatchLevel = 0.37f;               // of the noise of patches: its third coordinate
NEPHOS_CONST float kPatchSpread = 1.5f;               // cloud in images is up to 1 + this times as dense
NEPHOS_CONST float kShadeFades_m = 2.0e4f;            // from here on, over twice as far, shade fades to its mean: so flat is
                                                      // the view that a pixel covers whole clouds' shadows
NEPHOS_CONST float kMostShadeDepth = 8.0f;            // that a word of shade stores: four bytes of 255 sqrt(depth / this)
NEPHOS_CONST float kFarAway_m = 1.0e9f;
NEPHOS_CONST float kHorizon_m = 2.5e5f;               // where a cloud that repeats ends; it is below the horizon there
NEPHOS_CONST float kLongestLeap_m = 2.0e3f;           // of a ray below such a cloud: it is straight over that
NEPHOS_CONST float kStraightWay_m = 320.0f;          // ... and in it, where waves bend it: by 0.8 m in cells of 40 m
NEPHOS_CONST float kLeastFootprint_m = 0.05f;
NEPHOS_CONST float kSkippedSteps = 1.5f;              // of cloud before a sample behind empty space, in finest steps
NEPHOS_CONST float kSurfaceSteps = 0.3f;              // ... beyond the surface between two samples
NEPHOS_CONST float kLeastMargin = 1.0e-4f;            // difference of two samples' margins
// A shaded point samples the cloud towards the sun at these distances, which stand for these lengths; beyond the last
// the volume's depths go on.
NEPHOS_CONST float kTap0_m = 3.0f, kTap1_m = 10.0f, kTap2_m = 22.0f;
NEPHOS_CONST float kTap0Length_m = 6.5f, kTap1Length_m = 9.5f, kTap2Length_m = 14.5f;
NEPHOS_CONST float kTapsEnd_m = 30.5f;
// Light that diffuses (render/cloud/diffusion.h): of fluence f and flux F, 1/4 (kDiffuseBase f + diffuse_flux(g) omega F)
// is scattered towards omega, by Eddington's approximation, which has 3 g. Deep in a cloud and where light leaves it that
// is right; near lit surfaces it misses light that was scattered a few times, which the scattering table has
// (render/frame/scattering_table.h): forwards, and, in units of 1/4 (1 - g) ((1 - cos) / 2)^2, soon turned back.
NEPHOS_CONST float kDiffuseBase = 1.0f, kDiffuseFlux = 3.0f, kForwardLight = 1.0f, kTurnedBack = 3.5f;
// Add to these where scattering is broad, broad_scattering(g) = 1: fitted to slabs and to Cycles (docs/lighting.md).
NEPHOS_CONST float kBroadFlux = 0.3f, kBroadForwardLight = 0.6f, kBroadTurnedBack = -1.5f;
// By how much diffuse light falls off with a depth that the lattice does not know: as 1 / (1 + kDiffuseDecay (1 - g)
// depth), diffusion through a slab; and the most that a bump has more than the lattice.
NEPHOS_CONST float kDiffuseDecay = 1.5f, kMostRelief = 2.0f;
NEPHOS_CONST float kMostFluence = 6.0f;               // that a node can store
NEPHOS_CONST float kMostMarchedDepth = 64.0f;         // towards the sun: of more nothing arrives
NEPHOS_CONST uint kGroundTexels = 96u;                // on an edge of the map of light on the ground (ground_light.h)
// Words of a brick: of its nodes, of the corners of its cells, and of its cells.
NEPHOS_CONST uint kNodeEdge = 9u, kNodeWords = 729u;
NEPHOS_CONST uint kMarchLightNodes = 5u, kMarchLightWords = 125u;
NEPHOS_CONST uint kCellWords = 128u;
NEPHOS_CONST int kOccupied = 247;                     // CoverageField::cells()
NEPHOS_CONST uint kLargeNoiseWords = 2097152u;        // those of the small noise follow
// Metaballs take over from rays between these footprints of a pixel, in cells of 40 m: where they are smaller than a
// pixel. Larger cells have larger bumps, and their metaballs take over at footprints that are larger in proportion.
NEPHOS_CONST float kFootprintCell_m = 40.0f;
NEPHOS_CONST float kMarchedFootprint_m = 60.0f, kSplattedFootprint_m = 100.0f;

// Returns how far scattering with a mean cosine is from being narrowly forwards, 0 to 1: what diffusion is fitted by.
NEPHOS_FUNCTION float broad_scattering(float mean_cosine) {
    float rest = 1.0f - mean_cosine;
    return min(4.0f * rest * rest, 1.0f);
}

NEPHOS_FUNCTION float diffuse_flux(float mean_cosine) {
    return (kDiffuseFlux + kBroadFlux * broad_scattering(mean_cosine)) * mean_cosine;
}
NEPHOS_FUNCTION float forward_light(float mean_cosine) {
    return kForwardLight + kBroadForwardLight * broad_scattering(mean_cosine);
}
NEPHOS_FUNCTION float turned_back(float mean_cosine) {
    return kTurnedBack + kBroadTurnedBack * broad_scattering(mean_cosine);
}

// Returns the weight of metaballs whose pixels have a footprint: 0 to 1, without a step.
NEPHOS_FUNCTION float splatted_weight(float footprint_m) {
    float part = (footprint_m - kMarchedFootprint_m) / (kSplattedFootprint_m - kMarchedFootprint_m);
    part = min(max(part, 0.0f), 1.0f);
    return part * part * (3.0f - 2.0f * part);
}

// A CoverageField with its light, in the words of all volumes (render/vulkan/march_volumes.h).
struct MarchVolume {
    vec4 corner;         // xyz: of its field, relative to the eye, metres; w: between two nodes
    vec4 to_noise[3];    // rows, as in ErosionConstants
    uint bricks_x, bricks_y, bricks_z;
    float per_node;      // 1 / metres between two nodes
    uint first_table, first_cells, first_nodes;  // of its words
    uint first_light;
    uint light_words;    // of its sun depths; those of the surroundings follow, and two of the diffuse light
    float reach;         // metres to cloud per missing coverage, at most
    float extinction_per_m;
    float half_density;  // as in ErosionConstants from here on
    float cap, base_width, top_width, dissolving_width;
    float medium_width, fine_width, wisps, base_m;
    float gain_fine, gain_coarse, medium_scale, fine_scale;
    float medium_per_m, fine_per_m;
    float least_coverage;
    float footprint_scale;
    float whole;
    float home;                   // where its first period begins, metres from the corner
    float period_x, period_y;     // edges of a field that repeats to the horizon; 0: it does not, nor do the next
    float per_period_x, per_period_y;
    float bend;                   // 1 / m: a place at distance d on the ground's plane lies bend d^2 above the round Earth
    float repeats;                // 1 or 0
    // Of a field that repeats: how much cloud there is in its images (endless.glsl), and its shade on all beyond the
    // shade map. Points are relative to the eye, over a plane ground.
    vec4 to_patches;              // periods of the noise per metre: across, x: east, y: north; along, z and w likewise
    vec4 shade_u, shade_v;        // column and row of a point p: dot(xyz, p) + w
    float shade_mid_x, shade_mid_y;  // metres from the corner of column 0 and row 0, in the middle of the cloud's height
    float patch_ramp;             // 1 / metres from the first period to where patches are full
    float shade_top;              // where shade begins, metres above the eye
    float per_shade_height;       // 1 / metres from there down to where it is complete
    uint first_shade;             // word
    uint shade_columns, shade_rows;
    float mean_sunlight;          // that passes, over a period
    uint bands, first_bands;      // of heights that drift apart: how many, and their first word (ErosionConstants::bands)
    float bands_begin;
    float bands_per_m;
    float cloud_odds;             // ErosionConstants::cloud_odds()
    uint unused0, unused1;
};

struct March {
    uint count;                    // of volumes
    float per_unit;                // footprint of a pixel at distance 1
    float fade_begins, fade_ends;  // metres from the eye
    float least_step;              // in cloud, metres
    float diffuse;                 // strength of the light that diffuses; 0: the scattering table has it
    float mean_cosine;             // of the phase function
    float most_step;               // in cloud, metres: far away the footprint of a pixel is larger than clouds
    vec4 ground_light;             // texel of a point p: xy p + zw, counted from texels' middles
    uint first_ground_light;       // word
    uint unused0, unused1, unused2;
    MarchVolume volumes[kMostVolumes];
};

#ifdef __cplusplus
static_assert(sizeof(MarchVolume) == 320 && offsetof(MarchVolume, to_patches) == 208 && offsetof(MarchVolume, first_table) == 80 &&
              offsetof(MarchVolume, cap) == 112 && offsetof(March, ground_light) == 32 && offsetof(March, volumes) == 64);

}  // namespace nephos::shader
#endif
#endif
