// SPDX-License-Identifier: Apache-2.0
#pragma once

// Metaballs and their centres on the shadow map's tiles. No Vulkan here. Private to the module.

#include <span>
#include <vector>

#include "render/cloud/cloud_preparation.h"
#include "render/frame/tile_bins.h"

namespace nephos {

// The texels that each splat can touch.
std::vector<PixelBox> light_boxes(std::span<const shader::LightSplat> splats);

// Which centres lie in which tile, in each tile in order from the sun. Every centre is in one tile, but for
// those whose `wanted` is 0; without it all are wanted.
TileBins bin_centres(std::span<const shader::LightSplat> splats, const TileGrid& grid,
                     std::span<const std::uint8_t> wanted = {});

}  // namespace nephos
