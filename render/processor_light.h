// SPDX-License-Identifier: Apache-2.0
#pragma once

// Step 1 of D on the processor: what light_tiles.h has in compute shaders, in vectors of 4 to 16 lanes
// (Highway, chosen at run time), tiles in parallel. The test reference of the compute shaders, and what draws
// where there is no graphics card. The result does not depend on the number of threads. Private to the
// module.

#include <vector>

#include "render/cloud_preparation.h"
#include "render/tile_bins.h"

namespace nephos {

// Fills `shadow`, shadow_size^2 texels, and returns the light at the centres, in the order of `order`.
std::vector<float> light_by_processor(const SunOrder& order, int shadow_size, std::vector<float>& shadow,
                                      const BatchLimits& limits = {});

}  // namespace nephos
