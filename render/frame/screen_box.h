// SPDX-License-Identifier: Apache-2.0
#pragma once

// Where splats fall on the screen. Private to the module.

#include <cstdint>
#include <span>
#include <vector>

#include "render/frame/frame_data.h"
#include "render/frame/tile_bins.h"
#include "render/frame/view_sorting.h"
#include "render/options/camera.h"

namespace nephos {

// Of a number of splats_near_to_far(): the rest is an index into ViewSortedSplats::billboards.
inline constexpr std::uint32_t kBillboardSplat = 1u << 31;

// All splats of an order from the nearest to the farthest: index into ViewSortedSplats::balls, or kBillboardSplat and one
// into ViewSortedSplats::billboards.
std::vector<std::uint32_t> splats_near_to_far(const ViewSortedSplats& order);

// For each splat, from the nearest to the farthest (the other way round than `order`), the pixels of the tile
// of the picture that it can touch, from the tile's corner on. `splats`: splats_near_to_far(); not needed for
// an order without billboards.
std::vector<PixelBox> screen_boxes(const ViewSortedSplats& order, const CameraFrame& camera,
                                   const Camera& options, const Tile& tile,
                                   std::span<const std::uint32_t> splats = {});

}  // namespace nephos
