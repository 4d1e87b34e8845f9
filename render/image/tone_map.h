// SPDX-License-Identifier: Apache-2.0
#pragma once

// From scene-linear radiance to the 8 bits of a screen. The curve is the identity up to 0.5, so that what an
// artist sets as a sky colour is what the picture shows, and rolls off smoothly above it: bright cloud tops
// keep their relief.

#include <cstdint>
#include <vector>

#include "render/image/picture.h"

namespace nephos {

// Linear 0..inf to linear 0..1: x up to a = 0.5, then a + (1 - a) (1 - exp(-(x - a) / (1 - a))). Value and
// slope are continuous at a. Negative and NaN give 0.
float tone_map(float radiance);

// The sRGB transfer function (IEC 61966-2-1): linear 0..1 to encoded 0..1.
float encode_srgb(float linear);

// The beauty layer as 8-bit sRGB, 3 bytes a pixel: times 2^exposure_ev, tone-mapped per channel, encoded, and
// rounded with a fixed ordered dither of at most half a step, so that a plain sky shows no bands and equal
// pixels of two frames stay equal.
std::vector<std::uint8_t> to_srgb8(const Picture& picture, double exposure_ev);

}  // namespace nephos
