// SPDX-License-Identifier: Apache-2.0
#pragma once

// The renderer's view of the map of water and snow on the ground (seeds/ground_cover.h) at the time of a
// frame. Texel (column, row) is the rectangle of texel_x_m by texel_y_m whose south-western corner is at (x_m
// + column texel_x_m, y_m + row texel_y_m); rows from south to north, x fastest. Towards its edge the map
// fades to the outside values.

#include <span>

namespace nephos {

struct GroundCoverView {
    double x_m = 0, y_m = 0;               // south-western corner, world
    double texel_x_m = 1, texel_y_m = 1;   // > 0
    int columns = 0, rows = 0;             // both 0: the values outside everywhere
    std::span<const float> water_mm;       // columns * rows, >= 0: film of water
    std::span<const float> snow_mm;        // likewise, of water in the snow
    std::span<const float> rain_mm_per_h;  // likewise: rain that falls into the water
    double outside_water_mm = 0, outside_snow_mm = 0, outside_rain_mm_per_h = 0;
};

}  // namespace nephos
