// SPDX-License-Identifier: Apache-2.0
#pragma once

// What still water mirrors: the view of a camera below the ground, mirrored at its plane. A ray that the
// water reflects goes on, mirrored, straight through the plane, so this second eye sees clouds just where
// their mirror images stand, at any distance. Ripples turn reflected rays out of that direction a little, and
// see what stands there in this view. Private to the module.

#include <vector>

#include "render/image/picture.h"
#include "render/options/camera.h"

namespace nephos {

// Wider than the camera's view by a margin for what ripples turn away, with `scale` of its resolution.
Camera mirrored_camera(const Camera& camera, double ground_m, double scale);

// Its picture in ever coarser levels, each half of the one before, for reflections that are blurred: radiance
// and the clouds' transmittance, four floats a texel.
struct MirrorView {
    struct Level {
        int first = 0;  // texel
        int width = 0, height = 0;
    };
    CameraFrame frame;
    std::vector<Level> levels;
    std::vector<float> texels;
    double pixels_per_unit = 1;  // of the first level, at distance 1
};

// `picture` was drawn with `camera`.
MirrorView mirror_view(const Picture& picture, const Camera& camera);

}  // namespace nephos
