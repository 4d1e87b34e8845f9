// SPDX-License-Identifier: Apache-2.0
#pragma once

// Tone mapping from scene-linear radiance to 8-bit sRGB. The curve is the identity up to 0.5, so that colours
// of a scene appear unchanged, and compresses highlights above it: bright cloud tops retain their relief.

#include <array>
#include <cstdint>
#include <vector>

#include "core/srgb.h"
#include "render/image/picture.h"
#include "render/options/options.h"

namespace nephos {

// Maps linear 0..inf to linear 0..1: x up to a = 0.5, then a + (1 - a) (1 - exp(-(x - a) / (1 - a))), with
// continuous value and slope at a. Negative and NaN give 0. Pure.
float tone_map(float radiance);

// Maps linear colours 0..inf to 0..1 with ToneCurve::neutral, after the PBR Neutral Tone Mapper (Khronos Group,
// 2024). Colours whose largest channel p is at most a = 0.6 are unchanged; of others it becomes
// q = 1 - (1 - a)^2 / (p + 1 - 2 a), with continuous value and slope, the channels keep their ratios, and then
// fade to white by 1 - 1 / (1 + 0.15 (p - q)). Khronos begins at 0.76, and takes 0.04 off before, the
// reflection of a dielectric: here cloud tops of 0.7 to 1.5 shall keep relief, and skies have no such
// reflection. Negative and NaN give 0. Pure.
std::array<float, 3> neutral_tone(const std::array<float, 3>& radiance);

// Returns the beauty layer as 8-bit sRGB, 3 bytes a pixel: multiplied by 2^exposure_ev, tone-mapped by the
// curve, encoded, and rounded with a fixed ordered dither of at most half a step, so that a clear sky has
// no bands and equal pixels of two frames remain equal.
std::vector<std::uint8_t> to_srgb8(const Picture& picture, double exposure_ev,
                                   ToneCurve curve = ToneCurve::exponential);

// The same with all that the camera does to a picture: glare, exposure, tone curve.
std::vector<std::uint8_t> to_srgb8(const Picture& picture, const Camera& camera);

}  // namespace nephos
