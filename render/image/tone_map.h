// SPDX-License-Identifier: Apache-2.0
#pragma once

// Tone mapping from scene-linear radiance to 8-bit sRGB. The curve is the identity up to 0.5, so that colours
// of a scene appear unchanged, and compresses highlights above it: bright cloud tops retain their relief.

#include <cstdint>
#include <vector>

#include "render/image/picture.h"

namespace nephos {

// Maps linear 0..inf to linear 0..1: x up to a = 0.5, then a + (1 - a) (1 - exp(-(x - a) / (1 - a))), with
// continuous value and slope at a. Negative and NaN give 0. Pure.
float tone_map(float radiance);

// Applies the sRGB transfer function (IEC 61966-2-1): linear 0..1 to encoded 0..1. Pure.
float encode_srgb(float linear);

// Returns the beauty layer as 8-bit sRGB, 3 bytes a pixel: multiplied by 2^exposure_ev, tone-mapped per
// channel, encoded, and rounded with a fixed ordered dither of at most half a step, so that a clear sky has
// no bands and equal pixels of two frames remain equal.
std::vector<std::uint8_t> to_srgb8(const Picture& picture, double exposure_ev);

}  // namespace nephos
