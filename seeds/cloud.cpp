// SPDX-License-Identifier: Apache-2.0
#include "seeds/cloud.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <glm/common.hpp>

#include "core/vec.h"

namespace nephos {

void enclose(Cloud& cloud) {
    cloud.centre_m = cloud.low_m = cloud.high_m = {};
    cloud.radius_m = 0;
    if (cloud.boxes.empty()) return;
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    Vec3 low(kInfinity), high(-kInfinity);
    for (const SeedBox& b : cloud.boxes) {
        low = glm::min(low, b.centre_m - b.size_m / 2.0);
        high = glm::max(high, b.centre_m + b.size_m / 2.0);
    }
    cloud.low_m = low;
    cloud.high_m = high;
    cloud.centre_m = low * 0.5 + high * 0.5;
    double corner2 = 0, farthest = 0;
    for (SeedBox& b : cloud.boxes) {
        const Vec3 to = b.centre_m - cloud.centre_m;
        const Vec3 d(std::abs(to.x), std::abs(to.y), std::abs(to.z));  // glm::abs() has branches
        const Vec3 corner = d + b.size_m * 0.5;
        corner2 = std::max(corner2, dot(corner, corner));
        b.distance = std::sqrt(dot(d, d));
        farthest = std::max(farthest, b.distance);
    }
    cloud.radius_m = std::sqrt(corner2);
    for (SeedBox& b : cloud.boxes) b.distance = farthest > 0 ? b.distance / farthest : 0;
}

}  // namespace nephos
