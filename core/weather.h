// SPDX-License-Identifier: Apache-2.0
#pragma once

// Plain types of weather that several modules share.

namespace nephos {

// Pictures that billboards wear, made when the renderer starts (render/frame/billboard_textures.h).
enum class BillboardTexture {
    soft,   // a hazy ball
    wispy,  // drawn out fibres
    dense,  // a cauliflower's head
};

// What falls from rain areas: onto the ground (seeds/ground_cover.h) and before the eye
// (render/rain/precipitation.h).
enum class PrecipitationKind { rain, snow };

}  // namespace nephos
