// SPDX-License-Identifier: Apache-2.0
#pragma once

// Line overlays on finished pictures, without occlusion: for debug views.

#include <span>

#include "render/image/picture.h"
#include "render/options/options.h"

namespace nephos {

struct WorldLine {
    Vec3 from_m{}, to_m{};       // world
    Rgb colour{1, 1, 1};         // linear, in the tone-mapped picture, independent of exposure
    double width_pixels = 1.25;  // > 0
};

// Draws the lines in their order into the beauty layer, antialiased and clipped at the eye's plane. `camera`
// is that of the picture. Throws as camera_frame(). Thread-safe for different pictures.
void draw_lines(Picture& picture, const Camera& camera, std::span<const WorldLine> lines);

}  // namespace nephos
