// SPDX-License-Identifier: Apache-2.0
#pragma once

// Automatic exposure: a histogram of a picture's luminance, read as a camera's meter does. Pure functions;
// the histogram has integers, so that its sums are the same for any number of threads.

#include "render/image/picture.h"
#include "render/options/options.h"

namespace nephos {

// Returns the exposure in stops that brings the mean logarithm of the luminance, over the brighter half
// of the pixels but the last 2 %, to 0.42, for four fifths of the difference: what is dim stays dimmer. A
// picture without light gives 0. At least -6, at most 12 stops.
double metered_ev(const Picture& picture);

// Returns the exposure of a picture, stops: camera.exposure_ev, and with Exposure::automatic metered_ev()
// added to it.
double exposure_ev(const Picture& picture, const Camera& camera);

// Returns the exposure of a frame that follows another by `elapsed_s` of film, as an eye with the time
// constant `adaptation_s` adapts: target + (before - target) exp(-elapsed / adaptation). 0: at once.
double adapted_ev(double before_ev, double target_ev, double elapsed_s, double adaptation_s);

}  // namespace nephos
