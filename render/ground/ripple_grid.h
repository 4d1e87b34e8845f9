// SPDX-License-Identifier: Apache-2.0
#pragma once

// Tiles all water with one square of ripples without visible repetition: the plane is divided into hexagons,
// each has a random offset into the square, hashed from its number, and where three meet their slopes are
// blended with weights whose squares sum to 1, which preserves the variance (Heitz and Neyret 2018). Private
// to the module.

#include <cstdint>

#include "core/vec.h"
#include "render/cloud/splats.h"
#include "render/ground/ripples.h"

namespace nephos {

struct RippleGrid {
    RippleSlopes slopes;      // empty without ripples
    float strength = 0;       // factor of the slopes at the map's heaviest rain
    float most_mm_per_h = 1;  // the heaviest rain
    // Position of the eye on the lattice of hexagons (two skewed axes, integer part modulo 2^32) and in the
    // square (texels).
    std::uint32_t corner_x = 0, corner_y = 0;
    float from_x = 0, from_y = 0;
    float texel_x = 0, texel_y = 0;
};

RippleGrid ripple_grid(const GroundCoverView& cover, double time_s, double strength, const Vec3& eye_m);

inline constexpr double kRippleHexagon_m = 1.3;
static_assert(float(kRippleHexagon_m) == shader::kRippleApart_m);

}  // namespace nephos
