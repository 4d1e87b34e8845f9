// SPDX-License-Identifier: Apache-2.0
#pragma once

// Draws the ground of a height map into a finished picture, whose back-end has left its pixels dark behind the clouds: one
// implementation for all back-ends.
//
//     beauty += transmittance (beta (albedo * light + reflected) + light of the air)
//
//     light     sun (n.l, the terrain's own shadow by a ray, the clouds' by the shadow map), the sky that the place sees, and
//               what the ground around it sends back
//     albedo    that of level ground, rock on steep slopes, snow above its line: more in hollows, none on walls
//
// Normals are the mean over a pixel's footprint, and near the eye those of noise below the map's grid, so that it neither
// shimmers nor shows its cells. Private to the module.

#include "render/atmosphere/sky_light.h"
#include "render/cloud/splats.h"
#include "render/ground/mirror_view.h"
#include "render/image/ground_light.h"
#include "render/image/picture.h"
#include "render/terrain/height_map.h"
#include "render/terrain/terrain_view.h"

namespace nephos {

struct MarchedScene;

struct TerrainGround {
    const RenderOptions& options;
    const HeightMap& map;
    const TerrainView& view;
    const GroundCoverView& cover;
    const Flash* flash = nullptr;  // null: no lightning
    double time_s = 0;             // simulated, for ripples
    const MirrorView* mirror = nullptr;  // null: puddles reflect nothing
    const float* shadow = nullptr;       // texels of the picture's shadow map
    int shadow_size = 0;
    const SkyLight* sky = nullptr;            // null: gradient
    const MarchedScene* endless = nullptr;    // clouds that repeat; null: none
    const GroundLight* light = nullptr;       // below clouds; null: that of open ground
    double cloud_base_m = 0, cloud_top_m = 1;  // world: their shadow fades out between, from below; base < top
};

// Adds the terrain to `picture`, and sets Picture::terrain_m and terrain_light. Rows in parallel; the same bits for any
// number of threads.
void draw_terrain(const TerrainGround& ground, Picture& picture);

}  // namespace nephos
