// SPDX-License-Identifier: Apache-2.0
#pragma once

// Where splats fall on the screen. Private to the module.

#include <cstdint>
#include <span>
#include <vector>

#include "render/camera.h"
#include "render/eye_order.h"
#include "render/frame_data.h"
#include "render/tile_bins.h"

namespace nephos {

// Of a number of splats_near_to_far(): the rest is an index into EyeOrder::puffs.
inline constexpr std::uint32_t kPuffSplat = 1u << 31;

// All splats of an order from the nearest to the farthest: index into EyeOrder::balls, or kPuffSplat and one
// into EyeOrder::puffs.
std::vector<std::uint32_t> splats_near_to_far(const EyeOrder& order);

// For each splat, from the nearest to the farthest (the other way round than `order`), the pixels of the tile
// of the picture that it can touch, from the tile's corner on. `splats`: splats_near_to_far(); not needed for
// an order without billboards.
std::vector<PixelBox> screen_boxes(const EyeOrder& order, const CameraFrame& camera, const Camera& options,
                                   const Tile& tile, std::span<const std::uint32_t> splats = {});

}  // namespace nephos
