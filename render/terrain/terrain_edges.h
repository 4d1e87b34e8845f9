// SPDX-License-Identifier: Apache-2.0
#pragma once

// Smooth edges of terrain. A pixel sees one point of it, so that crests before the sky would be stairs: where neighbours are
// far apart, more rays say what part of the pixel shows which of them. Private to the module.

#include "render/image/picture.h"
#include "render/terrain/terrain_view.h"

namespace nephos {

// Mixes beauty and transmittance of pixels at edges with those of their neighbours. `view` and `bend` are those of the picture.
void smooth_edges(const HeightMap& map, const RenderOptions& options, double bend, const TerrainView& view, Picture& picture);

}  // namespace nephos
