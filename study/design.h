// SPDX-License-Identifier: Apache-2.0
#pragma once

// Points of a design in the unit cube: where a study looks.

#include <cstdint>
#include <string_view>
#include <vector>

namespace nephos {

enum class Design {
    grid,    // every value of every axis with every other; the last axis runs fastest
    list,    // the first values of all axes, then the second ones, ...
    random,  // independent uniform points; more points keep the first ones
    latin_hypercube,  // each axis is cut into as many strata as there are points, with one point in each (McKay et al. 1979)
    // Quasi-random points that fill the cube evenly (Joe and Kuo 2008), moved by a digital shift of the seed; more points
    // keep the first ones.
    sobol,
};

std::string_view design_name(Design design);

// Returns `count` points of `dimensions` numbers, 0 <= x < 1, point by point, for random, latin_hypercube and sobol. Pure:
// equal arguments give equal points. Throws Error(usage) for Sobol points of more than 3,667 dimensions.
std::vector<double> unit_points(Design design, std::uint64_t count, std::size_t dimensions,
                                std::uint64_t seed);

// Returns the points first .. first + count - 1 of the Sobol sequence of a seed, so that whoever comes back for more gets
// others. Pure. Throws as unit_points().
std::vector<double> sobol_points(std::uint64_t first, std::uint64_t count, std::size_t dimensions,
                                 std::uint64_t seed);

}  // namespace nephos
