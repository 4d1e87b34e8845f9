// SPDX-License-Identifier: Apache-2.0
#pragma once

// Screen-space bounding boxes of splats. Private to the module.

#include <cstdint>
#include <span>
#include <vector>

#include "render/frame/frame_data.h"
#include "render/frame/tile_bins.h"
#include "render/frame/view_sorting.h"
#include "render/options/camera.h"

namespace nephos {

// Flag of a number of splats_near_to_far(): the other bits are an index into ViewSortedSplats::billboards.
inline constexpr std::uint32_t kBillboardSplat = 1u << 31;

// Returns all splats of an order from the nearest to the farthest: an index into ViewSortedSplats::balls, or
// kBillboardSplat and an index into ViewSortedSplats::billboards.
std::vector<std::uint32_t> splats_near_to_far(const ViewSortedSplats& order);

// Returns for each splat, from the nearest to the farthest (the reverse of `order`), a bounding box in pixels
// relative to the part's corner. `splats`: splats_near_to_far(); may be empty for an order without
// billboards.
std::vector<PixelBox> screen_boxes(const ViewSortedSplats& order, const CameraFrame& camera,
                                   const Camera& options, const PicturePart& part,
                                   std::span<const std::uint32_t> splats = {});

}  // namespace nephos
