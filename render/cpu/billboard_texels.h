// SPDX-License-Identifier: Apache-2.0
#pragma once

// The pictures of billboard_textures.h in the form that the processor samples. Private to the module.

#include <cstdint>
#include <vector>

#include "render/frame/billboard_textures.h"

namespace nephos {

// Each layer of each level has side + 2 rows of side + 2 texels: a rim without opacity around the picture. A
// texel has its own two bytes, opacity and opacity times brightness, in the lower half and those of the next
// in its row in the upper half: one fetch gets both that lie beside a point. After all layers of a level come
// the same with columns and rows exchanged.
struct BillboardTexels {
    std::vector<std::uint32_t> texels;
    std::vector<std::uint32_t> first;  // of each level; a layer has (side + 2)^2
    std::uint32_t layers = 0;          // before those with columns and rows exchanged
};
const BillboardTexels& billboard_texels();  // made at the first call; thread-safe
BillboardTexels billboard_texels(const BillboardPictures& pictures);

}  // namespace nephos
