// SPDX-License-Identifier: Apache-2.0
#pragma once

// Rays that meet a height map. Private to the module.

#include "render/terrain/height_map.h"

namespace nephos {

// A ray from a world point along a unit direction over a round Earth: at a distance t it is at
//
//     (from + t direction) + (0, 0, bend (1 - direction.z^2) t^2)
//
// in the map, whose heights are those above a flat datum (earth_bend() of frame_data.h; 0: a plane).
struct TerrainRay {
    Vec3 from_m{};
    Vec3 direction{0, 0, 1};
    double bend = 0;
    double height_m(double t) const {
        return from_m.z + t * (direction.z + bend * (1 - direction.z * direction.z) * t);
    }
};

// Returns the distance at which a ray first comes to or below the surface between two distances, infinity when it does not;
// `begin_m` where it is below already. Exact for the bilinear surface but for rounding. Steps through the quadtree of the
// highest points: Tevs, Ihrke and Seidel 2008. Pure.
double terrain_distance(const HeightMap& map, const TerrainRay& ray, double begin_m, double end_m);

}  // namespace nephos
