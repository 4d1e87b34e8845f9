// SPDX-License-Identifier: Apache-2.0
#pragma once

// Where the wind has carried the density of a step by another moment. The automaton's bits move by whole cells, behind
// the air by up to one, and q is a mean over several steps (density/smoothing.h), so q of step s lies where its bits lay
// on average:
//
//     P(s) = sum w(t') floor(C(s + t')) / sum w(t')      C(n): way of the air in the first n steps, in cells
//
// Carried by C(t) - P(s) it lies where the air is at the time t, whichever step it comes from, and clouds move as evenly
// as the wind.

#include <cstdint>
#include <vector>

#include "automaton/automaton.h"
#include "core/vec.h"
#include "density/options.h"
#include "scenes/format/scene.h"

namespace nephos {

// Returns the displacement of each layer of the lattice, in cells, that takes q of step `of` to the moment `to`.
// Preconditions: of + smoothing.t0 <= automaton.steps(); `to` lies within a step that was taken, or at its end. Pure.
std::vector<Vec2> displacement_of_density(const Automaton& automaton, const SmoothingOptions& smoothing, std::uint64_t of,
                                          const Moment& to);

}  // namespace nephos
