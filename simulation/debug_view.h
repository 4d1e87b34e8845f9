// SPDX-License-Identifier: Apache-2.0
#pragma once

// T's figure 28: what the clouds of a sky consist of, as lines over the picture. Boxes in blue, axes through
// the clouds' centres, an arrow for each root, and the rays of the absorption factor, red inside of boxes.

#include <optional>
#include <span>
#include <vector>

#include "render/image/overlay.h"
#include "seeds/light_absorption.h"
#include "seeds/sky_simulation.h"

namespace nephos {

// Lines of the clouds that the camera can see. Rays go to `light`. Pure.
std::vector<WorldLine> debug_lines(const SkySimulation& sky, std::span<const SkyCloud> clouds,
                                   const RenderOptions& options, const Light& light);

}  // namespace nephos
