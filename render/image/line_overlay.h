// SPDX-License-Identifier: Apache-2.0
#pragma once

// Straight lines drawn over a finished picture, in the foreground: for views that explain what is in it.

#include <span>

#include "render/image/picture.h"
#include "render/options/options.h"

namespace nephos {

struct WorldLine {
    Vec3 from_m{}, to_m{};       // world
    Rgb colour{1, 1, 1};         // as it shows in the tone-mapped picture, whatever the exposure; linear
    double width_pixels = 1.25;  // > 0
};

// Draws the lines in their order into the beauty layer; the part of a line behind the eye is left out. Smooth
// edges. `camera` is that of the picture. Pure but for the picture; throws as camera_frame().
void draw_lines(Picture& picture, const Camera& camera, std::span<const WorldLine> lines);

}  // namespace nephos
