// SPDX-License-Identifier: Apache-2.0
#include "render/cpu/billboard_texels.h"

namespace nephos {
namespace {

void append_level(const BillboardLevel& level, BillboardTexels& out) {
    const std::size_t side = std::size_t(level.side), layers = level.texels.size() / (2 * side * side);
    const std::size_t stride = side + 2;
    out.first.push_back(std::uint32_t(out.texels.size()));
    out.texels.resize(out.texels.size() + 2 * layers * stride * stride, 0);
    std::uint32_t* to = &out.texels[out.first.back()];
    for (std::size_t layer = 0; layer < 2 * layers; ++layer, to += stride * stride) {
        for (std::size_t j = 0; j < side; ++j) {
            for (std::size_t i = 0; i < side; ++i) {
                const std::size_t row = layer < layers ? j : i, column = layer < layers ? i : j;
                const std::uint8_t* from = &level.texels[2 * ((layer % layers * side + row) * side + column)];
                const std::uint32_t texel = from[0] | std::uint32_t(from[1]) << 8;
                std::uint32_t* const at = to + (j + 1) * stride + i + 1;
                at[0] |= texel;
                at[-1] |= texel << 16;
            }
        }
    }
}

BillboardTexels make_texels(const std::vector<BillboardLevel>& levels) {
    BillboardTexels texels;
    const std::size_t side = std::size_t(levels.front().side);
    texels.layers = std::uint32_t(levels.front().texels.size() / (2 * side * side));
    for (const BillboardLevel& level : levels) append_level(level, texels);
    return texels;
}

}  // namespace

const BillboardTexels& billboard_texels() {
    static const BillboardTexels texels = make_texels(billboard_textures());
    return texels;
}

BillboardTexels billboard_texels(const BillboardPictures& pictures) { return make_texels(pictures.levels); }

}  // namespace nephos
