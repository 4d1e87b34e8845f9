// SPDX-License-Identifier: Apache-2.0
#include "render/terrain/terrain_view.h"

#include <cstdio>
#include <string>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "render/terrain/terrain_caster.h"

namespace nephos {
TerrainView terrain_view(const HeightMap& map, const RenderOptions& options, double bend) {
    const TerrainCaster caster(map, options, bend);
    TerrainView view{options.camera.width, options.camera.height, {}};
    view.distance_m.resize(std::size_t(view.width) * std::size_t(view.height));
    tbb::parallel_for(0, view.height, [&](int y) {
        for (int x = 0; x < view.width; ++x)
            view.distance_m[std::size_t(y) * std::size_t(view.width) + std::size_t(x)] = caster.distance(x + 0.5, y + 0.5);
    });
    return view;
}

void require_above_terrain(const HeightMap& map, const RenderOptions& options) {
    const Vec3& eye = options.camera.position_m;
    const double ground = ground_height_at(&map, options.ground, eye.x, eye.y);
    if (eye.z > ground) return;
    char text[300];
    std::snprintf(text, sizeof text,
                  "camera: the position %g, %g, %g is in the ground, which is %.1f m high there; expected a point above it, or "
                  "camera.above_ground = true, by which heights are counted from the ground",
                  eye.x, eye.y, eye.z, ground);
    throw Error(ErrorCode::usage, text);
}

}  // namespace nephos
