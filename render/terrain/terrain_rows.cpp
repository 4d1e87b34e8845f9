// SPDX-License-Identifier: Apache-2.0
#include "render/terrain/terrain_rows.h"

#include <algorithm>
#include <cmath>

#include "core/vec.h"
#include "render/frame/frame_data.h"
#include "render/terrain/terrain_ray.h"

namespace nephos {
namespace {

constexpr double kShadowReach_m = 200'000;
// Rays to the sun begin above the surface by this part of a cell, so that its facets do not shade themselves.
constexpr double kLift = 0.12;
constexpr double kLeastCosine = 0.05;  // of the view on the slope, for the footprint

}  // namespace

TerrainRow::TerrainRow(std::size_t size)
    : distance_m(size, kNoTerrain),
      ray_x(size, 0.0f),
      ray_y(size, 1.0f),
      ray_z(size, 0.0f),
      z_m(size, 0.0f),
      slope_x(size, 0.0f),
      slope_y(size, 0.0f),
      pixel_m(size, 1.0f),
      sun(size, 0.0f),
      sky(size, 1.0f),
      shelter(size, 0.0f),
      gathers(size, 1.0f),
      pond_m(size, 0.0f) {}

bool find_row(const TerrainGround& ground, const CameraFrame& frame, double bend, int y, const Picture& picture,
              TerrainRow& row) {
    const HeightMap& map = ground.map;
    const Camera& camera = ground.options.camera;
    const Vec3 to_sun = direction_to_sun(ground.options.sun);
    const double per_pixel = 1 / pixels_per_unit(camera, frame), cell = std::min(map.step_x_m, map.step_y_m);
    const double width = map.east_m() - map.west_m, length = map.north_m() - map.south_m;
    bool any = false;
    for (int x = 0; x < picture.width; ++x) {
        const auto n = std::size_t(x);
        const std::size_t pixel = std::size_t(y) * std::size_t(picture.width) + n;
        const float distance = ground.view.distance_m[pixel];
        row.distance_m[n] = distance;
        const Vec3 way = pixel_ray(frame, camera, x + 0.5, y + 0.5);
        row.ray_x[n] = float(way.x);
        row.ray_y[n] = float(way.y);
        row.ray_z[n] = float(way.z);
        if (!(distance < kNoTerrain)) continue;
        any = true;
        const double t = double(distance);
        const TerrainRay ray{camera.position_m, way, bend};
        const Vec3 point{ray.from_m.x + t * way.x, ray.from_m.y + t * way.y, ray.height_m(t)};
        const double across = (point.x - map.west_m) / width, up = (point.y - map.south_m) / length;
        row.z_m[n] = float(point.z);
        const MeanSlope plain = mean_slope(map, point.x, point.y, per_pixel * t);
        const double facing = (way.x * plain.x + way.y * plain.y - way.z) /
                              std::sqrt(1 + plain.x * plain.x + plain.y * plain.y);
        const double footprint = per_pixel * t / std::sqrt(std::clamp(facing, kLeastCosine, 1.0));
        const MeanSlope slope = mean_slope(map, point.x, point.y, footprint);
        row.slope_x[n] = float(slope.x);
        row.slope_y[n] = float(slope.y);
        row.pixel_m[n] = float(footprint);
        const TerrainExposure& exposure = map.exposure;
        const auto of = [&](const std::vector<float>& nodes) {
            return float(interpolated(nodes, exposure.columns, exposure.rows, across, up));
        };
        row.sky[n] = of(exposure.sky);
        row.shelter[n] = of(exposure.shelter);
        row.gathers[n] = of(exposure.gathers);
        row.pond_m[n] = of(exposure.pond_m);
        const bool lit = to_sun.z > 0 && to_sun.z > slope.x * to_sun.x + slope.y * to_sun.y;
        row.sun[n] = 0;
        if (lit && picture.transmittance[pixel] > 0) {
            const TerrainRay light{{point.x, point.y, point.z + kLift * cell}, to_sun, bend};
            row.sun[n] = std::isfinite(terrain_distance(map, light, 0, kShadowReach_m)) ? 0.0f : 1.0f;
        }
    }
    return any;
}

}  // namespace nephos
