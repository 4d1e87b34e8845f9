// SPDX-License-Identifier: Apache-2.0
#pragma once

// Overlays on finished pictures, for all back-ends: lines without occlusion, for debug views, and streaks,
// which are motion-blurred particles.

#include <span>

#include "render/image/picture.h"
#include "render/options/options.h"

namespace nephos {

struct WorldLine {
    Vec3 from_m{}, to_m{};       // world
    Rgb colour{1, 1, 1};         // as it shows in the tone-mapped picture, whatever the exposure; linear
    double width_pixels = 1.25;  // > 0
};

// Draws the lines in their order into the beauty layer, antialiased and clipped at the eye's plane. `camera`
// is that of the picture. Throws as camera_frame(). Thread-safe for different pictures.
void draw_lines(Picture& picture, const Camera& camera, std::span<const WorldLine> lines);

struct Streak {
    float x0 = 0, y0 = 0, x1 = 0, y1 = 0;  // ends, pixels
    float width = 1;                       // pixels, >= 1
    float opacity = 0;                     // 0..1
    float distance_m = 0;                  // from the eye
    float red = 0, green = 0, blue = 0;    // radiance
};

// Blends the streaks into the beauty layer, in their order: pixel = pixel + opacity * cover * seen *
// (radiance - pixel), where `seen` is 1 before the cloud of the pixel (Picture::depth_m) and the cloud's
// transmittance behind it. Edges and ends are smooth; a streak covers its length times its width in pixels,
// at least one either way. Bands of rows in parallel; the same bits for any number of threads.
void draw_streaks(Picture& picture, std::span<const Streak> streaks);

}  // namespace nephos
