// SPDX-License-Identifier: Apache-2.0
#pragma once

// The detail of a scene's frames: the same for pictures and for files.

#include <optional>

#include "density/density_grid.h"
#include "density/detail.h"
#include "scenes/format/scene.h"

namespace nephos {

// Returns the detail of a density of the scene at a time: of layer `layer`, or without one that of a scene without
// layers. The wind in the middle of its height carries all of it alike, of a veil that at its top; bumps are stretched along the
// wind, or along a veil's fibres. Where it is not enabled, nothing is drawn with
// it. Pictures have images of the density only where these go on to the horizon. Pure.
DetailSetting detail_setting(const Scene& scene, std::optional<std::size_t> layer, const DensityGrid& density,
                             double time_s);

}  // namespace nephos
