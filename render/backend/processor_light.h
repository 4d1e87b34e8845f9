// SPDX-License-Identifier: Apache-2.0
#pragma once

// Step 1 of D on the processor: what light_tiles.h has in compute shaders, in vectors of 4 to 16 lanes
// (Highway, chosen at run time), tiles in parallel. The test reference of the compute shaders, and what draws
// where there is no graphics card. The result does not depend on the number of threads. Private to the
// module.

#include <cstdint>
#include <span>
#include <vector>

#include "render/cloud/cloud_preparation.h"
#include "render/cloud/stage_times.h"
#include "render/frame/tile_bins.h"

namespace nephos {

// The requested light; an empty span requests all.
struct LightRequest {
    std::span<const std::uint8_t> centres;    // one for each of LightSortedSplats::splats: not 0 if requested
    std::span<const std::uint8_t> map_tiles;  // one for each tile of the map: not 0 if requested
};

// Fills what is requested of `shadow`, shadow_size^2 texels, and of `depths`, the optical depths between
// centres and sun, which has one for each of
// order.splats, and leaves the rest of both as it is. What one centre or texel gets has the same bits
// whatever else is requested.
void light_by_processor(const LightSortedSplats& order, int shadow_size, const LightRequest& requested,
                        std::vector<float>& depths, std::vector<float>& shadow,
                        const BatchLimits& limits = {}, StageTimes* times = nullptr);

// Fills the same of `sun_depths` and of `shadow` for the metaballs and tiles that are not 0: one byte for each of sun_depths,
// which has the order that the splats were sorted from, and for each tile.
void light_some_by_processor(const LightSortedSplats& order, int shadow_size, std::span<const std::uint8_t> balls,
                             std::span<const std::uint8_t> tiles, std::vector<float>& sun_depths,
                             std::vector<float>& shadow, StageTimes* times);

}  // namespace nephos
