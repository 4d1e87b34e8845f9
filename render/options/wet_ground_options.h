// SPDX-License-Identifier: Apache-2.0
#pragma once

// Options of the appearance of wet and snowy ground; a map gives the amounts
// (render/cloud/ground_cover_view.h).

#include <array>

namespace nephos {

struct WetGroundOptions {
    // Film at which soil has darkened by 1 - 1/e of the difference between dry and soaked, mm, > 0.
    double soaking_mm = 0.25;
    // Film at which puddles cover half of the ground, mm, > 0: larger means fewer puddles.
    double puddle_film_mm = 2.0;
    double puddle_size_m = 5.0;  // size of the largest puddles, 0.1..1000
    // Strength of reflections, 0..1; 0: none, and no mirrored view is rendered.
    double reflection = 1.0;
    double reflection_scale = 0.5;  // resolution of the mirrored view relative to the image, 0.1..1
    // Reflectance of wet ground that is not under water, relative to still water, 0..1.
    double sheen = 0.25;
    double ripples = 1.0;        // factor of the height of the ripples of drops, 0..10; 0: still water
    double snow_cover_mm = 2.0;  // snow, in mm of water, that covers half of the ground, > 0
    std::array<double, 3> snow_albedo{0.86, 0.88, 0.90};  // 0..1
    bool operator==(const WetGroundOptions&) const = default;
};

// Throws Error(usage) naming the first value that is out of its range.
void check(const WetGroundOptions& options);

}  // namespace nephos
