// SPDX-License-Identifier: Apache-2.0
#pragma once

// Step 0 of D: the billboard textures, one for each of n = 64 density levels, from the analytic line integral
// of f (line_integral() in render/shared/shared.h).

#include <vector>

namespace nephos {

// kAttenuationLevels layers of kAttenuationTexels^2 texels of two values, x fastest, then y, then layers.
// Texel (i, j) of layer l describes the point (i, j) / 63 of the billboard, in units of the radius from its
// middle (the other three quarters are mirror images): the opacity 1 - exp(-depth_scale * column) with
// depth_scale = attenuation_depth_scale(l), and the same for layer l + 1, so that one look-up serves to mix
// two layers. 0 outside the ball. Opacity rather than transmittance: thin balls keep all their digits.
std::vector<float> attenuation_textures();

// Optical depth scale (extinction at the centre times radius) of a layer: kMaxDepthScale (l / 63)^3.
float attenuation_depth_scale(int layer);

}  // namespace nephos
