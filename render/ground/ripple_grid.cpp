// SPDX-License-Identifier: Apache-2.0
#include "render/ground/ripple_grid.h"

#include <algorithm>
#include <cmath>

namespace nephos {

RippleGrid ripple_grid(const GroundCoverView& cover, double time_s, double strength, const Vec3& eye_m) {
    double most = cover.outside_rain_mm_per_h;
    for (const float rain : cover.rain_mm_per_h) most = std::max(most, double(rain));
    RippleGrid grid;
    if (!(most > 0) || !(strength > 0)) return grid;
    grid.slopes = ripple_slopes(time_s, most);
    grid.strength = float(strength);
    grid.most_mm_per_h = float(most);
    const double x = (eye_m.x - eye_m.y / std::sqrt(3.0)) / kRippleHexagon_m,
                 y = eye_m.y * 2 / std::sqrt(3.0) / kRippleHexagon_m;
    grid.corner_x = std::uint32_t(std::int64_t(std::floor(x)));
    grid.corner_y = std::uint32_t(std::int64_t(std::floor(y)));
    grid.from_x = float(x - std::floor(x));
    grid.from_y = float(y - std::floor(y));
    const auto texel = [](double at_m) {
        const double squares = at_m / kRippleSize_m;
        return float((squares - std::floor(squares)) * kRippleTexels);
    };
    grid.texel_x = texel(eye_m.x);
    grid.texel_y = texel(eye_m.y);
    return grid;
}

}  // namespace nephos
