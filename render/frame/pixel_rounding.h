// SPDX-License-Identifier: Apache-2.0
#pragma once

// Rounds to whole pixels: four times for each splat, for which calls of std::floor take too long where the
// processor that is compiled for has no instruction for it. Private to the module.

#include <algorithm>

namespace nephos {

// Far beyond any picture, and far from the limits of int.
inline constexpr double kFarthestPixel = 1e6;

inline int floor_to_pixel(double value) {
    const double near = std::clamp(value, -kFarthestPixel, kFarthestPixel);
    const int towards_zero = int(near);
    return towards_zero - (near < towards_zero ? 1 : 0);
}

inline int ceil_to_pixel(double value) {
    const double near = std::clamp(value, -kFarthestPixel, kFarthestPixel);
    const int towards_zero = int(near);
    return towards_zero + (near > towards_zero ? 1 : 0);
}

}  // namespace nephos
