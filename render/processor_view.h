// SPDX-License-Identifier: Apache-2.0
#pragma once

// Step 2 of D on the processor: what view_tiles.h has in compute shaders, in vectors of 4 to 16 lanes
// (Highway, chosen at run time), tiles in parallel. The test reference of the compute shaders, and what draws
// where there is no graphics card. The result does not depend on the number of threads. Private to the
// module.

#include <span>

#include "render/camera.h"
#include "render/eye_order.h"
#include "render/frame_data.h"
#include "render/picture.h"
#include "render/tile_bins.h"

namespace nephos {

// Draws the metaballs of `order` and what lies behind them into a part of the picture; `frame` is that of the
// part. The ground wears picture.shadow.
void view_by_processor(const RenderOptions& options, const CameraFrame& camera, const shader::Frame& frame,
                       const Tile& part, const EyeOrder& order, Picture& picture,
                       const BatchLimits& limits = {});

}  // namespace nephos
