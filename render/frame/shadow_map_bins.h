// SPDX-License-Identifier: Apache-2.0
#pragma once

// Binning of metaballs and of their centres into the shadow map's tiles. Private to the module.

#include <span>
#include <vector>

#include "render/cloud/cloud_preparation.h"
#include "render/frame/tile_bins.h"

namespace nephos {

// Returns a bounding box in texels for each splat.
std::vector<PixelBox> light_boxes(std::span<const shader::LightSplat> splats);

// Bins the centres, in each tile in order from the sun. Every centre is in one tile, except those whose
// `wanted` is 0; if `wanted` is empty, none is excepted.
TileBins bin_centres(std::span<const shader::LightSplat> splats, const TileGrid& grid,
                     std::span<const std::uint8_t> wanted = {});

}  // namespace nephos
