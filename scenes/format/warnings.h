// SPDX-License-Identifier: Apache-2.0
#pragma once

// Notes for the author of a valid scene about what it may not mean. They change nothing in a simulation.

#include <string>
#include <vector>

#include "scenes/format/scene.h"

namespace nephos {

// Returns a sentence for each finding: base models that nothing uses; parcels that reach above an open top of their
// lattice, which cuts their clouds flat; and those that reach beyond open sides where clouds do not thin out towards
// these (detail.apron_cells, or no detail). Ellipsoids count as far as their radius. Pure.
std::vector<std::string> warnings(const Scene& scene);

// Returns a sentence for each group of keys that have no effect because of how layers draw their clouds: billboards of
// base models that only automata use, what only automata read in layers without one. Pure.
std::vector<std::string> keys_without_effect(const Scene& scene);

}  // namespace nephos
