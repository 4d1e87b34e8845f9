// SPDX-License-Identifier: Apache-2.0
#pragma once

// Parts of the unit cube, to which the parameters of a fit are scaled. Pure; thread-safe.

#include <cstddef>
#include <vector>

namespace nephos {

using Point = std::vector<double>;  // of the unit cube, a coordinate a dimension

// A box with sides along the axes; the whole cube as it is made.
struct UnitBox {
    std::vector<double> low, high;

    explicit UnitBox(std::size_t dimensions) : low(dimensions, 0.0), high(dimensions, 1.0) {}
    bool holds(const Point& point) const;
    bool is_whole() const;
    // Returns the box grown by a factor about its middle, within the cube.
    UnitBox grown(double factor) const;
};

// Returns whether points, one after the other, reach to all sides of a box. None lies on a side of the cube
// itself, where the prior ends: such a side is reached when points that fill the box could leave that gap,
// two of their spacings.
bool surround(const std::vector<double>& points, const UnitBox& box);

}  // namespace nephos
