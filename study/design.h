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
    sobol,  // quasi-random points that fill the cube evenly (Joe and Kuo 2008); more points keep the first ones
};

std::string_view design_name(Design design);

// Returns `count` points of `dimensions` numbers in 0..1, point by point. For random, latin_hypercube and sobol; of
// `seed` only the first two depend. Pure: equal arguments give equal points. Throws Error(usage) for Sobol points of more
// than 3,667 dimensions.
std::vector<double> unit_points(Design design, std::uint64_t count, std::size_t dimensions,
                                std::uint64_t seed);

}  // namespace nephos
