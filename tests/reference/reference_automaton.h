// SPDX-License-Identifier: Apache-2.0
#pragma once

// The automaton one cell at a time, beside the formulas of D: the twin that the kernels are compared with. It
// shares with them the options, the carried ellipsoids and the choice of level per block; rules,
// probabilities, random words and advection are written out here again, without bit tricks.

#include <cstdint>
#include <vector>

#include "automaton/automaton.h"
#include "automaton/lattice.h"
#include "automaton/options.h"

namespace nephos::reference {

// One byte a cell, 0 or 1, x fastest (linear_index).
struct Cells {
    Extent extent;
    std::vector<std::uint8_t> hum, act, cld;
    bool operator==(const Cells&) const = default;
};

Cells to_cells(BitPlaneView hum, BitPlaneView act, BitPlaneView cld);
Lattice to_lattice(const Cells& cells);

// The first state: births on the empty lattice, with the ellipsoids of time 0.
Cells first_state(const AutomatonOptions& options, const std::vector<ActiveEllipsoid>& ellipsoids);

// Growth alone (D, after Nagel).
Cells grow(const Cells& cells, const Boundaries& boundaries);

// Extinction and birth of step `step` with these ellipsoids.
void extinguish_and_bear(Cells& cells, const AutomatonOptions& options, std::uint32_t step,
                         const std::vector<ActiveEllipsoid>& ellipsoids);

// v'(i,j,k) = v(i - dx, j - dy, k) in layer k.
void advect_layer(Cells& cells, const Boundaries& boundaries, int k, std::int64_t dx, std::int64_t dy);

// p of one draw (0 hum, 1 act, 2 ext) at a cell in double precision, straight from the head of field.h.
double probability(const AutomatonOptions& options, const std::vector<ActiveEllipsoid>& ellipsoids, int draw,
                   int i, int j, int k);

}  // namespace nephos::reference
