// SPDX-License-Identifier: Apache-2.0
#pragma once

// Heights that are generated (Relief). Private to the module.

#include "render/terrain/height_map.h"

namespace nephos {

// Returns the heights of TerrainOptions::relief: `cells` + 1 nodes along the longer side, from 0 to 1. Octaves of gradient
// noise (core/noise.h), each displaced by a coarse one so that crests bend; of hills their sum, of ridges Musgrave's ridged
// multifractal (Ebert et al. 2003, chapter 16): (1 - |noise|)^2, each octave weighted by the one before, so that valleys
// are smooth and crests rough. Ridges are then worn by rivers (erosion.h). A function of the options alone.
HeightImage relief_heights(const TerrainOptions& options);

}  // namespace nephos
