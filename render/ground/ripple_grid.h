// SPDX-License-Identifier: Apache-2.0
#pragma once

// One square of ripples spread over all water without its repetition showing: the plane is cut into hexagons,
// each has its own piece of the square, drawn by its number, and where three meet their slopes are added with
// weights whose squares sum to 1, which keeps the variance (Heitz and Neyret 2018). Private to the module.

#include <cstdint>

#include "core/vec.h"
#include "render/cloud/ground_cover_view.h"
#include "render/ground/ripples.h"

namespace nephos {

struct RippleGrid {
    RippleSlopes slopes;      // empty without ripples
    float strength = 0;       // of the slopes where it rains as hard as anywhere
    float most_mm_per_h = 1;  // there
    // The eye among the hexagons' corners (two skewed axes, whole part modulo 2^32) and in the square
    // (texels).
    std::uint32_t corner_x = 0, corner_y = 0;
    float from_x = 0, from_y = 0;
    float texel_x = 0, texel_y = 0;
};

RippleGrid ripple_grid(const GroundCoverView& cover, double time_s, double strength, const Vec3& eye_m);

inline constexpr double kRippleHexagon_m = 1.3;  // distance of corners of the triangles between hexagons

}  // namespace nephos
