// SPDX-License-Identifier: Apache-2.0
#pragma once

// What the rays of a row meet on a height map, pixel by pixel, for the vectors of terrain_pass.cpp. Private to the module.

#include <cstddef>
#include <vector>

#include "render/options/camera.h"
#include "render/terrain/terrain_pass.h"

namespace nephos {

// One number a pixel, padded to whole vectors; pixels without terrain have a distance of kNoTerrain and the rest of level
// ground at 1 m.
struct TerrainRow {
    std::vector<float> distance_m;
    std::vector<float> ray_x, ray_y, ray_z;  // unit
    std::vector<float> z_m;                  // world height
    std::vector<float> slope_x, slope_y;     // mean over the footprint
    std::vector<float> pixel_m;              // side of the footprint on the slope, geometric mean of both
    std::vector<float> sun;                  // 1: no terrain before it
    std::vector<float> sky, shelter, gathers, pond_m;  // TerrainExposure
    explicit TerrainRow(std::size_t size);
};

// Returns false when there is no terrain in the row.
bool find_row(const TerrainGround& ground, const CameraFrame& frame, double bend, int y, const Picture& picture,
              TerrainRow& row);

}  // namespace nephos
