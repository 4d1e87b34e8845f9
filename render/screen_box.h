// SPDX-License-Identifier: Apache-2.0
#pragma once

// Where metaballs fall on the screen. Private to the module.

#include <vector>

#include "render/camera.h"
#include "render/eye_order.h"
#include "render/frame_data.h"
#include "render/tile_bins.h"

namespace nephos {

// For each ball of the order, from the nearest to the farthest (the other way round than `order`), the pixels
// of the tile of the picture that it can touch, from the tile's corner on.
std::vector<PixelBox> screen_boxes(const EyeOrder& order, const CameraFrame& camera, const Camera& options,
                                   const Tile& tile);

}  // namespace nephos
