// SPDX-License-Identifier: Apache-2.0
#include "render/frame/shadow_map_bins.h"

#include <algorithm>

#include <tbb/parallel_for.h>

#include "render/frame/tile_bins.h"
#include "render/shared/half_floats.h"

namespace nephos {

std::vector<PixelBox> light_boxes(std::span<const shader::LightSplat> splats) {
    std::vector<PixelBox> boxes(splats.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, splats.size(), 8192), [&](const auto& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
            const shader::LightSplat& s = splats[i];
            const auto [rx, ry] = unpack_halves(s.radii);
            boxes[i] = {floor_to_pixel(s.x - rx), floor_to_pixel(s.y - ry), ceil_to_pixel(s.x + rx),
                        ceil_to_pixel(s.y + ry)};
        }
    });
    return boxes;
}

TileBins bin_centres(std::span<const shader::LightSplat> splats, const TileGrid& grid,
                     std::span<const std::uint8_t> wanted) {
    std::vector<PixelBox> centres(splats.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, centres.size(), 8192), [&](const auto& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
            if (!wanted.empty() && wanted[i] == 0) continue;
            const int x = std::clamp(int(splats[i].x), 0, grid.width - 1),
                      y = std::clamp(int(splats[i].y), 0, grid.height - 1);
            centres[i] = {x, y, x + 1, y + 1};
        }
    });
    return bin_into_tiles(centres, grid);
}

}  // namespace nephos
