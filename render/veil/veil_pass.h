// SPDX-License-Identifier: Apache-2.0
#pragma once

// Veils per pixel (S): each ray is cut with the slab, the sum of octaves is evaluated along it, and what it scatters is
// composited with a finished picture by depth and transmittance, so that all back-ends show the same veil. The ground
// below loses what the sheet keeps. Private to the module.

#include <span>

#include "render/frame/frame_data.h"
#include "render/image/picture.h"
#include "render/veil/drawn_veil.h"

namespace nephos {

struct VeilPass {
    std::span<const DrawnVeil> veils;
    PictureFrame frame;  // of the whole picture, as the back-end drew it
    Vec3 eye_m{};
    Rgb ground_albedo{};
    const float* shadow = nullptr;  // texels of the frame's shadow map
    int shadow_size = 0;
};

// Draws the veils, the farthest first. Beauty, transmittance and depth change. Rows in parallel; the same bits for any
// number of threads.
void draw_veils(const VeilPass& pass, Picture& picture);

}  // namespace nephos
