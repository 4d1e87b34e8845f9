// SPDX-License-Identifier: Apache-2.0
#pragma once

// The simulations that the benchmarks step.

#include <cstdint>

#include "automaton/automaton.h"
#include "automaton/lattice.h"

namespace nephos::bench {

// Random bits, about half of them set (one in sixteen of act): no block can be skipped.
inline Lattice random_lattice(Extent extent) {
    Lattice lattice{BitPlane(extent), BitPlane(extent), BitPlane(extent)};
    std::uint64_t state = 88172645463325252u;
    const auto next = [&state] {
        state ^= state << 13;
        state ^= state >> 7;
        return state ^= state << 17;
    };
    for (std::uint64_t& word : lattice.hum.words()) word = next();
    for (std::uint64_t& word : lattice.act.words()) word = next() & next() & next() & next();
    for (std::uint64_t& word : lattice.cld.words()) word = next();
    return lattice;
}

inline AutomatonOptions cube(int edge, Probabilities background) {
    AutomatonOptions options;
    options.extent = {edge, edge, edge};
    options.placement.cell_size_m = 10;
    options.field.background = background;
    return options;
}

// 200 ellipsoids with p <= 0.01 at their centres: half of the blocks lie in one or more of them.
inline AutomatonOptions ellipsoid_cube(int edge, double background_ext) {
    AutomatonOptions options = cube(edge, {0, 0, background_ext});
    for (int i = 0; i < 200; ++i) {
        Ellipsoid e;
        e.centre_m = {(i * 37 % edge) * 10.0, (i * 101 % edge) * 10.0, (i * 59 % edge) * 10.0};
        e.semi_axes_m = {edge * 1.2, edge * 1.0, edge * 0.8};
        e.yaw_deg = 15.0 * i;
        e.centre = {0.01, 0.001, 0.2 * background_ext};
        e.rim = {0, 0, background_ext};
        options.field.ellipsoids.push_back(e);
    }
    return options;
}

}  // namespace nephos::bench
