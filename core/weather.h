// SPDX-License-Identifier: Apache-2.0
#pragma once

// Plain types that several modules share.

namespace nephos {

// Texture of a billboard, generated when the renderer starts (render/frame/billboard_textures.h).
enum class BillboardTexture {
    soft,   // a hazy ball
    wispy,  // elongated fibres, as of cirrus
    dense,  // cauliflower-like knobs, as of cumulus congestus
};

// The precipitation of a rain area, which accumulates on the ground (seeds/ground_cover.h) and is drawn as
// particles and shafts (render/rain/precipitation.h).
enum class PrecipitationKind { rain, snow };

}  // namespace nephos
