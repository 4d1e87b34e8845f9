// SPDX-License-Identifier: Apache-2.0
#pragma once

// Rain seen from afar: curtains between cloud and ground, as a medium in the elliptic cylinders of the rain
// areas, which lean with the wind. Private to the module.

#include <cstdint>
#include <span>

#include "render/options.h"
#include "render/picture.h"
#include "render/precipitation_light.h"
#include "render/rain_container.h"

namespace nephos {

// Extinction per metre of rain of a rate as seen from afar: twice its geometric shadow.
double rain_extinction_per_m(PrecipitationKind kind, double rate_mm_per_h);

// The share of the rain that is left at a height between ground (0) and cloud (1).
double left_of_rain(double height, double evaporation);

// Draws the curtains over the picture, each by its distance before or behind the picture's clouds, along
// every pixel's ray by steps. `camera` is the camera at the time. Rows in parallel; the same bits for any
// number of threads.
void draw_shafts(Picture& picture, const RenderOptions& options, const CameraFrame& camera,
                 std::span<const RainCurtain> curtains, const PrecipitationLight& light, double time_s,
                 std::uint64_t seed);

}  // namespace nephos
