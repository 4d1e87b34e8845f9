// SPDX-License-Identifier: Apache-2.0
#pragma once

// Rays of a camera to a height map and the plane of the ground. Private to the module.

#include "render/options/camera.h"
#include "render/terrain/height_map.h"

namespace nephos {

class TerrainCaster {
  public:
    // `bend`: earth_bend(). All must outlive this.
    TerrainCaster(const HeightMap& map, const RenderOptions& options, double bend);
    // Returns the distance at which the ray through a point of the picture, in pixels, meets the map; kNoTerrain where it
    // meets the plane first, or nothing. Rays of a mirrored eye, which is below the plane, begin at it.
    float distance(double px, double py) const;

  private:
    const HeightMap& map_;
    const Camera& camera_;
    CameraFrame frame_;
    double ground_m_, bend_;
    bool mirrored_;
};

}  // namespace nephos
