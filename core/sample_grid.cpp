// SPDX-License-Identifier: Apache-2.0
#include "core/sample_grid.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace nephos {

double sample_at(const SampleGrid& grid, const Vec3& place_m, int part) {
    std::size_t low[3], high[3];
    double fraction[3];
    for (int axis = 0; axis < 3; ++axis) {
        const int last = grid.points[std::size_t(axis)] - 1;
        const double at = std::clamp((place_m[axis] - grid.first_m[axis]) / grid.spacing_m[axis], 0.0, double(last));
        low[axis] = std::size_t(std::min(std::floor(at), double(std::max(last - 1, 0))));
        high[axis] = std::min(low[axis] + 1, std::size_t(last));
        fraction[axis] = at - double(low[axis]);
    }
    const auto nx = std::size_t(grid.points[0]), ny = std::size_t(grid.points[1]), parts = std::size_t(grid.parts);
    const auto mix = [](double a, double b, double t) { return a + (b - a) * t; };
    const auto value = [&](std::size_t i, std::size_t j, std::size_t k) {
        return double(grid.values[parts * ((k * ny + j) * nx + i) + std::size_t(part)]);
    };
    const auto row = [&](std::size_t j, std::size_t k) {
        return mix(value(low[0], j, k), value(high[0], j, k), fraction[0]);
    };
    const auto plane = [&](std::size_t k) { return mix(row(low[1], k), row(high[1], k), fraction[1]); };
    return mix(plane(low[2]), plane(high[2]), fraction[2]);
}

}  // namespace nephos
