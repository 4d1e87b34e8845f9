// SPDX-License-Identifier: Apache-2.0
#include "render/terrain/terrain_caster.h"

#include <algorithm>
#include <cmath>

#include "render/terrain/terrain_ray.h"
#include "render/terrain/terrain_view.h"

namespace nephos {
namespace {

constexpr double kFarthest_m = 600'000;

// Returns the distance at which a ray passes a height, coming from above or from below; kFarthest_m when it does not.
double passes(const TerrainRay& ray, double z_m) {
    const double a = ray.bend * (1 - ray.direction.z * ray.direction.z), b = ray.direction.z,
                 c = ray.from_m.z - z_m;
    const double square = b * b - 4 * a * c;
    if (square < 0) return kFarthest_m;
    // The nearer of the roots ahead, without cancellation.
    const double q = -0.5 * (b + std::copysign(std::sqrt(square), b));
    double first = kFarthest_m;
    if (q != 0 && c / q > 0) first = std::min(first, c / q);
    if (a > 0 && q / a > 0) first = std::min(first, q / a);
    return first;
}

}  // namespace

TerrainCaster::TerrainCaster(const HeightMap& map, const RenderOptions& options, double bend)
    : map_(map),
      camera_(options.camera),
      frame_(camera_frame(options.camera)),
      ground_m_(options.ground.height_m),
      bend_(bend),
      mirrored_(options.camera.position_m.z <= options.ground.height_m) {}

float TerrainCaster::distance(double px, double py) const {
    const TerrainRay ray{camera_.position_m, pixel_ray(frame_, camera_, px, py), bend_};
    const double plane = passes(ray, ground_m_);
    const double met =
        mirrored_ ? terrain_distance(map_, ray, plane, kFarthest_m) : terrain_distance(map_, ray, 0, plane);
    // What lies on the plane but for rounding is the plane. Seen from above, a share h / H of the way is a height h below an
    // eye at the height H: 10 cm below one at 10 km.
    constexpr double kNearer = 1 - 1e-5;
    if (!mirrored_ && met > kNearer * plane) return kNoTerrain;
    return met < kFarthest_m ? float(met) : kNoTerrain;
}

}  // namespace nephos
