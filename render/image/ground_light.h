// SPDX-License-Identifier: Apache-2.0
#pragma once

// Light below clouds that has been scattered in them: a closed sheet lets through no direct sunlight, and yet it is day
// below it.

#include <cstdint>
#include <vector>

#include "core/vec.h"

namespace nephos {

// A map of the ground; plain data. Its outermost texels have the light beyond it, which goes on from there.
struct GroundLight {
    static constexpr int kTexels = 96;  // on an edge

    Vec2 corner_m{0, 0};  // of the first texel, world
    Vec2 texel_m{1, 1};   // size of a texel
    // x fastest: of the sunlight that open ground has, the fraction that arrives scattered (lower 16 bits, 0..65535), and
    // the fraction of the sky's light (upper). Empty: all is open.
    std::vector<std::uint32_t> words;

    struct Fractions {
        double sun = 0, sky = 1;
    };
    // Returns the fractions at a place of the world, bilinearly between the middles of texels.
    Fractions at(const Vec2& place_m) const;
};

}  // namespace nephos
