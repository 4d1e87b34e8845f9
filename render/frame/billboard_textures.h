// SPDX-License-Identifier: Apache-2.0
#pragma once

// The pictures on T's billboards, made of noise when a renderer starts: soft billboards, wisps and dense
// cauliflowers, each in several variants. Private to the module.

#include <cstdint>
#include <vector>

#include "render/cloud/splats.h"

namespace nephos {

inline constexpr int kBillboardKinds = 3;
inline constexpr int kBillboardVariants = 4;  // layers of a kind; layer = kind * kBillboardVariants + variant
inline constexpr int kBillboardTexels = 128;  // on each side of the finest level; a power of two
inline constexpr int kBillboardLevels = 5;    // 128 .. 8 texels: a coarser one would be all rim

// One level of all layers: texel (i, j) of layer l is the pair at 2 * ((l * side + j) * side + i), row 0 at
// the top. First value: opacity; second: opacity times the brightness of the cloud there, 0.7..1. Both 0..255
// for 0..1. Opacity is 0 at the rim and beyond the circle that touches the texture's sides, so no billboard
// shows its corners.
struct BillboardLevel {
    int side = 0;
    std::vector<std::uint8_t> texels;
};

// All levels, the finest first; each coarser one is the mean of 2x2 texels, with the rim's share moved
// inwards. The same bytes on every machine. Made at the first call, which takes some tenths of a second;
// thread-safe.
const std::vector<BillboardLevel>& billboard_textures();

// The texture of a billboard: one of its kind's, mirrored left and right (1), top and bottom (2), and with
// exchanged axes (4), in that order; fibres stay level.
struct BillboardPicture {
    int layer = 0, turn = 0;
};
BillboardPicture billboard_picture(BillboardTexture kind, std::uint32_t variant);

}  // namespace nephos
