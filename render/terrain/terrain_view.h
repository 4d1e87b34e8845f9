// SPDX-License-Identifier: Apache-2.0
#pragma once

// Where the rays of a picture meet a height map. All back-ends end their rays there. Private to the module.

#include <vector>

#include "render/options/options.h"
#include "render/terrain/height_map.h"

namespace nephos {

inline constexpr float kNoTerrain = 1.0e30f;  // as the ground where a ray does not meet it

// A distance for each pixel, metres from the eye through its middle; kNoTerrain where the ray meets the plane of the ground
// first, or nothing. Back-ends take a ray with a distance to end there, wherever their own rounding puts the plane.
struct TerrainView {
    int width = 0, height = 0;
    std::vector<float> distance_m;
};

// `bend`: earth_bend(). Rays of a mirrored eye, which is below the plane of the ground, begin at that plane.
TerrainView terrain_view(const HeightMap& map, const RenderOptions& options, double bend);

}  // namespace nephos
