// SPDX-License-Identifier: Apache-2.0
#pragma once

// Random planes and boundaries for comparisons with naive twins.

#include <random>

#include "automaton/lattice.h"

namespace nephos::test {

inline BitPlane random_cells(Extent extent, double p, std::mt19937_64& random) {
    BitPlane plane(extent);
    std::bernoulli_distribution bit(p);
    for (int k = 0; k < extent.z; ++k)
        for (int j = 0; j < extent.y; ++j)
            for (int i = 0; i < extent.x; ++i)
                if (bit(random)) plane.set(i, j, k, true);
    return plane;
}

inline Boundaries random_boundaries(std::mt19937_64& random) {
    const auto one = [&] { return random() % 2 ? Boundary::periodic : Boundary::open; };
    return {one(), one(), one()};
}

// The neighbour of cell `at` along an axis of `cells` cells; -1 beyond an open side.
inline int neighbour(int at, int by, int cells, Boundary boundary) {
    const int to = at + by;
    if (to >= 0 && to < cells) return to;
    return boundary == Boundary::periodic ? (to % cells + cells) % cells : -1;
}

}  // namespace nephos::test
