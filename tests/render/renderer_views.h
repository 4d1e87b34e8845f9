// SPDX-License-Identifier: Apache-2.0
#pragma once

// Cameras all around and within the clouds of reference_render.h.

#include <cmath>
#include <numbers>
#include <vector>

#include "tests/render/picture_checks.h"

namespace nephos::test {

struct View {
    const char* name;
    RenderOptions options;
};

inline std::vector<View> views() {
    return {{"side", view({0, -4000, 800}, {0, 0, 1000})},
            {"below", view({100, 200, 10}, {100, 900, 1200}, 70)},
            {"above", view({-800, -500, 4000}, {0, 0, 800})},
            {"inside", view({50, 60, 1000}, {700, 300, 1100}, 60)},
            {"straight up", view({30, 40, 5}, {30, 40, 1000}, 90)},
            {"straight down", view({30, 40, 3000}, {30, 40, 0}, 40)},
            {"wide", view({-900, -900, 600}, {0, 0, 1000}, 150, 80, 40)},
            {"tall", view({0, -3000, 1000}, {0, 0, 1000}, 40, 7, 65)},
            {"far", view({60000, 90000, 8000}, {0, 0, 1000}, 3)}};
}

// Smaller metaballs than this are widened (renderer.h); a ray through the middle of a pixel is then no
// measure.
inline double smallest_radius_m(const Camera& camera) {
    const double pixel = 2 * std::tan(camera.vertical_fov_deg * std::numbers::pi / 360) / camera.height;
    return 1.3 * pixel *
           (std::hypot(camera.position_m.x, camera.position_m.y, camera.position_m.z - 1000) + 1500);
}

}  // namespace nephos::test
