// SPDX-License-Identifier: Apache-2.0
#pragma once

// Advection (D): v'(i,j,k) = v(i - dx, j - dy, k) by whole cells, with one displacement (dx, dy) per layer k.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "automaton/lattice.h"
#include "automaton/options.h"

namespace nephos {

// Returns the displacement of layer k in the step that starts at `time_s`, by the wind at the centres of its cells.
// Precondition: the fields of the wind are a profile (is_profile()). Pure.
Displacement displacement_of_layer(const AutomatonOptions& options, int k, double time_s);

// Shifts layer k of a plane in place by (dx, dy) cells of any size and sign. 0 flows in through open sides;
// periodic sides wrap around. `scratch` is reused memory. Different layers may be shifted in different
// threads.
void shift_layer(BitPlane& plane, int k, std::int64_t dx, std::int64_t dy, const Boundaries& boundaries,
                 std::vector<std::uint64_t>& scratch);

// Moves planes by the wind of the step that begins at `time_s`: their layer n is layer first + n of the lattice. `rest`, a
// number for each of their layers, is how far the air is beyond the bits, below a cell, before and after.
// Precondition: as of displacement_of_layer().
void advect(const AutomatonOptions& options, int first, double time_s, std::span<Displacement> rest,
            const std::array<BitPlane*, 3>& planes);

}  // namespace nephos
