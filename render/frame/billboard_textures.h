// SPDX-License-Identifier: Apache-2.0
#pragma once

// Textures of T's billboards, generated from noise when a renderer starts: soft, wispy and dense, each in
// several variants. Private to the module.

#include <cstdint>
#include <vector>

#include "render/cloud/splats.h"
#include "render/shared/shared.h"

namespace nephos {

inline constexpr int kBillboardKinds = 3;
inline constexpr int kBillboardVariants = 4;  // layers of a kind; layer = kind * kBillboardVariants + variant
inline constexpr int kBillboardTexels = int(shader::kBillboardTexels);
inline constexpr int kBillboardLayers = kBillboardKinds * kBillboardVariants;  // of the textures made from noise
inline constexpr int kBillboardLevels = 5;  // 128 .. 8 texels: a coarser one would consist of its rim

// One mip level of all layers: texel (i, j) of layer l is the pair at 2 * ((l * side + j) * side + i), row 0
// at the top. First value: opacity; second: opacity times a brightness of 0.7..1. Both 0..255 for 0..1.
// Opacity is 0 at the rim and outside the inscribed circle, so that corners are invisible.
struct BillboardLevel {
    int side = 0;
    std::vector<std::uint8_t> texels;
};

// Returns all levels, the finest first; each coarser one is the mean of 2x2 texels, with the opacity of the
// rim moved inwards. The same bytes on every machine. The first call generates them in some tenths of a
// second. Thread-safe.
const std::vector<BillboardLevel>& billboard_textures();

// Levels in the form that the processor samples. Each layer of each level has side + 2 rows of side + 2 texels: a rim
// without opacity around the picture. A texel has its own two bytes, opacity and opacity times brightness, in the lower
// half and those of the next in its row in the upper half: one fetch gets both that lie beside a point. After all layers
// of a level come the same with columns and rows exchanged.
struct BillboardTexels {
    std::vector<std::uint32_t> texels;
    std::vector<std::uint32_t> first;  // of each level; a layer has (side + 2)^2
    std::uint32_t layers = 0;          // before those with columns and rows exchanged
};

// Textures from noise, and behind their layers one for each picture of billboard_pictures().
struct BillboardPictures {
    std::uint64_t serial = 0;  // unlike that of all others; above 0
    int count = 0;             // of pictures
    std::vector<BillboardLevel> levels;
    BillboardTexels texels;  // of `levels`
};

// Returns the levels with the pictures, or those of billboard_textures() for null.
inline const std::vector<BillboardLevel>& billboard_levels(const BillboardPictures* pictures) {
    return pictures != nullptr ? pictures->levels : billboard_textures();
}

// The same for the processor. Thread-safe.
const BillboardTexels& billboard_texels(const BillboardPictures* pictures);

// The texture of a billboard: a layer, and in `turn` the flags mirrored left-right (1), top-bottom (2) and
// axes exchanged (4), applied in that order; fibres remain horizontal.
struct BillboardPicture {
    int layer = 0, turn = 0;
};
BillboardPicture billboard_picture(BillboardTexture kind, std::uint32_t variant);
// The same of one with a picture of its own: upright and not mirrored.
inline BillboardPicture own_picture(int index) { return {kBillboardLayers + index, 0}; }

}  // namespace nephos
