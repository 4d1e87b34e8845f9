// SPDX-License-Identifier: Apache-2.0
#pragma once

// Vectors of world space, from GLM, and ranges. A default-initialised GLM vector is not zero: declare `Vec3 a{};`.

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

namespace nephos {

// A point or vector in the horizontal plane: x east, y north.
using Vec2 = glm::dvec2;
// A point or vector in world space (metres unless said otherwise): x east, y north, z up, right-handed.
using Vec3 = glm::dvec3;

// A closed range from which a uniform number is drawn; min <= max.
struct Range {
    double min = 0, max = 0;
    bool operator==(const Range&) const = default;
};

}  // namespace nephos
