// SPDX-License-Identifier: Apache-2.0
#pragma once

// Advection (D): v'(i,j,k) = v(i - dx, j - dy, k) by whole cells, with one displacement (dx, dy) per layer k.

#include <cstdint>
#include <vector>

#include "automaton/lattice.h"

namespace nephos {

// Shifts layer k of a plane in place by (dx, dy) cells of any size and sign. 0 flows in through open sides;
// periodic sides wrap around. `scratch` is reused memory. Different layers may be shifted in different
// threads.
void shift_layer(BitPlane& plane, int k, std::int64_t dx, std::int64_t dy, const Boundaries& boundaries,
                 std::vector<std::uint64_t>& scratch);

}  // namespace nephos
