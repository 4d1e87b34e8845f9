// SPDX-License-Identifier: Apache-2.0
#pragma once

// Step 0 of D: the billboard textures, one for each of n = 64 density levels, from the analytic line integral of f
// (column() in shaders/shared.h).

#include <vector>

namespace nephos {

// kAttenuationLevels layers of kAttenuationTexels^2 texels, x fastest, then y, then layers. The texel (i, j) of layer l
// is the opacity 1 - exp(-depth_scale * column) of a metaball at the point (i, j) / 63 of its billboard, in units of
// its radius from the middle (the other three quarters are mirror images), with depth_scale = attenuation_depth_scale(l).
// 0 outside the ball. Opacity rather than transmittance: thin balls keep all their digits.
std::vector<float> attenuation_textures();

// Optical depth scale (extinction at the centre times radius) of a layer: kMaxDepthScale (l / 63)^3.
float attenuation_depth_scale(int layer);

}  // namespace nephos
