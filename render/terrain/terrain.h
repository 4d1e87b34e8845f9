// SPDX-License-Identifier: Apache-2.0
#pragma once

// The ground of a scene's options: read from its file, or generated.

#include <memory>

#include "render/terrain/height_map.h"

namespace nephos {

// Returns null when the options have neither a height map nor relief. Relief that is in use already is shared: to generate
// it takes seconds. Thread-safe. Throws as check(options), read_height_file() and height_map().
std::shared_ptr<const HeightMap> make_terrain(const TerrainOptions& options, const Ground& ground);

}  // namespace nephos
