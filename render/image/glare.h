// SPDX-License-Identifier: Apache-2.0
#pragma once

// Glare: light that lens and eye scatter around whatever is bright. The scattered light falls off with the
// angle as the photopic point spread function of G. Spencer, P. Shirley, K. Zimmerman and D. Greenberg,
// "Physically-Based Glare Effects for Digital Images", SIGGRAPH 1995:
//
//     per steradian, theta in degrees:  0.478 * 20.91 / theta^3 + 0.138 * 72.37 / theta^2
//
// whose narrow first term, of less than a pixel, stays where it is. Both powers are sums of Gaussians, one
// per octave of the angle, and each Gaussian is a level of a pyramid of halved pictures, so that the glow of
// a sun has the same angles at any size of the picture. What leaves a pixel is taken from it: the sum of the
// light is kept, but for what would fall beside the picture, which stays at its pixel.

#include <vector>

#include "render/image/picture.h"
#include "render/options/options.h"

namespace nephos {

// Share of the light that the Gaussian of standard deviation `sigma_deg` scatters, of those one octave apart;
// `strength` is relative to the eye's. Pure.
double glare_share(double sigma_deg, double strength);

// Returns the beauty layer with camera.glare; unchanged where that is 0. The same bits for any number of
// threads.
std::vector<float> with_glare(const Picture& picture, const Camera& camera);

}  // namespace nephos
