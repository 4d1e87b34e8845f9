// SPDX-License-Identifier: Apache-2.0
#pragma once

// What all pixels of the pass over the ground share (wet_ground.h). Private to the module.

#include <vector>

#include "render/cloud/splats.h"
#include "render/frame/frame_data.h"
#include "render/ground/country.h"
#include "render/ground/ground_noise.h"
#include "render/ground/mirror_view.h"
#include "render/ground/ripple_grid.h"
#include "render/ground/water.h"

namespace nephos {

// The map's texels from points relative to the eye: column = from_x + per_x x - 1/2.
struct CoverTexels {
    const GroundCoverView* map = nullptr;
    float from_x = 0, from_y = 0, per_x = 0, per_y = 0;
};

struct GroundPass {
    const WetGroundOptions* look = nullptr;
    PictureFrame white;  // of ground with an albedo of 1
    shader::vec4 dry;    // its albedo where it is plain
    Country country;
    Water water;
    const float* shadow = nullptr;
    int shadow_size = 0;
    CoverTexels cover;
    std::vector<NoiseOctave> hollows, tufts;
    RippleGrid ripples;
    const MirrorView* mirror = nullptr;
    float reflection = 0;
    bool lying = false;  // whether water or snow lie somewhere, or rain makes ripples
};

struct WetGround;

// Returns the pass over a picture of these options, whose shadow map has this frame. Refers to what `ground` refers to.
GroundPass ground_pass(const WetGround& ground, const ShadowFrame& shadow_frame);

}  // namespace nephos
