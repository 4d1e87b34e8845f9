// SPDX-License-Identifier: Apache-2.0
#pragma once

// Planar reflections: the view of the camera mirrored at the plane of the ground. A reflected ray, mirrored,
// continues straight through the plane, so that this camera sees the mirror images of clouds at their right
// positions, at any distance. Rays reflected by ripples sample this view in their perturbed direction.
// Private to the module.

#include <cstddef>
#include <vector>

#include "render/image/picture.h"
#include "render/options/camera.h"
#include "render/options/options.h"
#include "render/shared/ground.h"

namespace nephos {

// Returns the mirrored camera, with `wet_ground.reflection_scale` of the resolution and a margin for perturbed rays, the
// wider the higher the waves of a ground of water.
Camera mirrored_camera(const RenderOptions& options);

// A mip pyramid of its picture for blurred reflections, each level half of the one before: radiance and the
// clouds' transmittance, four floats a texel.
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

// Returns the pyramid of a picture of `camera` without its texels, and their number.
MirrorView mirror_layout(const Camera& camera);
std::size_t mirror_texels(const MirrorView& view);
// Builds the pyramid of `picture`, which was drawn with `camera`.
MirrorView mirror_view(const Picture& picture, const Camera& camera);

}  // namespace nephos
