// SPDX-License-Identifier: Apache-2.0
#pragma once

// What lies before and behind a veil in the pixels of a row. Private to the module.

#include <array>
#include <cstddef>
#include <vector>

#include "render/frame/frame_data.h"

namespace nephos {

// A number for each pixel of a row and each colour.
using RowColours = std::array<std::vector<float>, 3>;

// Rays of a row of a picture.
struct RowRays {
    std::vector<float> x, y, z;   // unit
    std::vector<float> ground_m;  // distance of the ground; 1e30 where there is none
};
RowRays row_rays(const PictureFrame& frame, std::size_t y, std::size_t width);

// The air between the eye and a distance in each pixel: its transmittance and its light.
struct RowAir {
    RowColours beta, light;
};
RowAir row_air(const PictureFrame& frame, const RowRays& rays, const std::vector<float>& distance_m);

// Sky or ground behind the clouds of a row, with the air before it, without the sun's disc blurred by glare.
RowColours row_background(const PictureFrame& frame, const RowRays& rays, const float* shadow,
                          int shadow_size);

// Radiance of a white surface that faces the sun at a height above the eye.
Rgb sunlight_at_height(const PictureFrame& frame, double height_m);

}  // namespace nephos
