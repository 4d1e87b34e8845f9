// SPDX-License-Identifier: Apache-2.0
#include "render/terrain/terrain_view.h"

#include <tbb/parallel_for.h>

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

}  // namespace nephos
