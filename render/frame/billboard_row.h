// SPDX-License-Identifier: Apache-2.0
#pragma once

// What a billboard's texture leaves of the light, for a place and for a row of places. Private to the module.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "render/frame/billboard_textures.h"

namespace nephos {

// One layer of a level of the textures, as a turned billboard has it.
struct TurnedTexture {
    const std::uint32_t* texels;  // of the layer
    int stride;
    float across, up_scale;  // texels for a step of 1 to the right, and up
    float middle, last;      // texels

    // `level`: 0 = the finest; `layer` and `turn`: of BillboardPicture.
    TurnedTexture(const BillboardTexels& all, unsigned level, unsigned layer, unsigned turn) {
        const int side = kBillboardTexels >> level;
        const unsigned exchanged = (turn & 4u) != 0 ? all.layers : 0;
        stride = side + 2;
        texels = &all.texels[all.first[level] + (layer + exchanged) * unsigned(stride * stride)];
        const float half = 0.5f * float(side);
        across = (turn & 1u) != 0 ? -half : half;
        up_scale = (turn & 2u) != 0 ? half : -half;
        middle = half + 0.5f;  // one for the rim, half for the middle of a texel
        last = float(side) + 0.999f;
    }

    // Opacity, 0..1, between texels; `right` and `up` from -1 to 1.
    float opacity(float right, float up) const {
        const float x = std::clamp(middle + across * right, 0.0f, last),
                    y = std::clamp(middle + up_scale * up, 0.0f, last);
        const int i = int(x), j = int(y);
        const auto line = [&](std::uint32_t pair) {
            const float here = float(pair & 255u), next = float(pair >> 16 & 255u);
            return here + (x - float(i)) * (next - here);
        };
        const float above = line(texels[j * stride + i]), below = line(texels[(j + 1) * stride + i]);
        return (above + (y - float(j)) * (below - above)) * (1.0f / 255);
    }
};

// Places at the same distances from left to right: -1 is a billboard's left rim, 1 its right one.
struct PlacesInRow {
    float first = 0, step = 0;
};

// Multiplies each of `light` by 1 - opacity * the texture's opacity at its place of the row at height `up` (-1..1).
void shade_row(const TurnedTexture& texture, const PlacesInRow& places, float up, float opacity,
               std::span<float> light);

}  // namespace nephos
