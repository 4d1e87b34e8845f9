// SPDX-License-Identifier: Apache-2.0
#pragma once

// Motion-blurred particles, composited over finished pictures as streaks. The same code for all back-ends.

#include <span>

#include "render/image/picture.h"

namespace nephos {

struct Streak {
    float x0 = 0, y0 = 0, x1 = 0, y1 = 0;  // ends, pixels
    float width = 1;                       // pixels, >= 1
    float opacity = 0;                     // 0..1
    float distance_m = 0;                  // from the eye
    float red = 0, green = 0, blue = 0;    // radiance
};

// Blends the streaks into the beauty layer, in their order:
//
//     pixel = pixel + opacity * cover * visible * (radiance - pixel)
//
// where `visible` is 1 in front of the cloud of the pixel (Picture::depth_m) and the cloud's transmittance
// behind it. Edges and ends are antialiased; a streak covers its length times its width in pixels, at least
// one pixel in each. Runs bands of rows in parallel; the bits are the same for any number of threads.
void draw_streaks(Picture& picture, std::span<const Streak> streaks);

}  // namespace nephos
