// SPDX-License-Identifier: Apache-2.0
#pragma once

// Advection (D): v'(i,j,k) = v(i - dx, j - dy, k), whole cells, a displacement of its own for each layer.

#include <cstdint>
#include <vector>

#include "automaton/lattice.h"

namespace nephos {

// Shifts layer k of a plane in place by (dx, dy) cells, any size and sign. Open sides let 0 flow in; periodic
// ones bring back what leaves. `scratch` is memory to reuse. Different layers may be shifted in different
// threads.
void shift_layer(BitPlane& plane, int k, std::int64_t dx, std::int64_t dy, const Boundaries& boundaries,
                 std::vector<std::uint64_t>& scratch);

}  // namespace nephos
