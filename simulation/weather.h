// SPDX-License-Identifier: Apache-2.0
#pragma once

// From the rain areas of a frame to what the renderer draws of them.

#include <span>

#include "render/rain/precipitation.h"
#include "scenes/format/scene.h"
#include "simulation/simulation.h"

namespace nephos {

// The curtains of all layers, from the ground of the picture to the middle of a layer's base heights, with
// the wind 50 m above the ground: the scene's, or that of the first layer when the scene has none. A curtain
// leans as rain of 6 m/s (snow of 1 m/s) falls through air that moves otherwise than its cloud, by at most 1.
Weather weather_of(const Scene& scene, std::span<const LayerFrame> layers, double time_s);

}  // namespace nephos
