// SPDX-License-Identifier: Apache-2.0
#pragma once

// The sun's light on clouds with detail, by the processor, for all back-ends that march. Private to the module.

#include <cstdint>
#include <span>

#include "render/backend/lit_cloud.h"
#include "render/cloud/stage_times.h"

namespace nephos {

// Completes the light of those metaballs (of LitCloud::sun_depths) and tiles of the shadow map that are not 0, where
// there are volumes: they take the light away, and those metaballs that do not stand for them. All tiles are computed
// at once, or none.
void complete_light_of_volumes(LitCloud& cloud, std::span<const std::uint8_t> balls,
                               std::span<const std::uint8_t> tiles, StageTimes& times);

}  // namespace nephos
