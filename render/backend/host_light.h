// SPDX-License-Identifier: Apache-2.0
#pragma once

// The sun's light by the processor, for all back-ends, where more than plain metaballs takes it away: clouds with detail
// that are marched, and what stands before the sun beside voxels (SunScreen). Private to the module.

#include <cstdint>
#include <span>

#include "render/backend/lit_cloud.h"
#include "render/cloud/stage_times.h"

namespace nephos {

// Completes the light of those metaballs (of LitCloud::sun_depths) and tiles of the shadow map that are not 0: volumes take
// it away, metaballs that do not stand for them, and the screen; veils are not in the map, as the ground below them is
// darkened when they are drawn. All tiles are computed at once, or none. Precondition: LitCloud::lit_on_host().
void complete_light_on_host(LitCloud& cloud, std::span<const std::uint8_t> balls,
                            std::span<const std::uint8_t> tiles, StageTimes& times);
// The same of all metaballs and tiles, and notes it.
void complete_light_on_host(LitCloud& cloud, StageTimes& times);

// Adds the screen to light that came from elsewhere (Renderer::Impl::absorb_sunlight()).
void add_screen(LitCloud& cloud);

// Makes cloud.billboard_sunlight that of `splats`. After cache_volumes().
void cache_billboard_light(LitCloud& cloud, const Splats& splats, const RenderOptions& options,
                           StageTimes& times);

}  // namespace nephos
