// SPDX-License-Identifier: Apache-2.0
#pragma once

// The rain area that tests of rain look at.

#include <cmath>

#include "render/rain/precipitation.h"
#include "tests/render/picture_checks.h"

namespace nephos::test {

// An ellipse of 700 x 400 m, turned, 900 m north of the origin, below a cloud at 800 m.
inline RainCurtain rain_area() {
    RainCurtain c;
    c.x_m = 100;
    c.y_m = 900;
    c.semi_a_m = 700;
    c.semi_b_m = 400;
    c.axis_x = std::cos(0.4);
    c.axis_y = std::sin(0.4);
    c.base_m = 800;
    c.rate_mm_per_h = 20;
    return c;
}

inline RenderOptions rain_view(const Vec3& eye, const Vec3& target, int width, int height, int particles) {
    RenderOptions options;
    options.camera.position_m = eye;
    options.camera.target_m = target;
    options.camera.width = width;
    options.camera.height = height;
    options.precipitation.enabled = true;
    options.precipitation.particles = particles;
    return options;
}

}  // namespace nephos::test
