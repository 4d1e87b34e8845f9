// SPDX-License-Identifier: Apache-2.0
#pragma once

// What a valid scene may not mean: for its author, not for the simulation.

#include <string>
#include <vector>

#include "scenes/format/scene.h"

namespace nephos {

// Returns a sentence for each finding: base models that nothing uses; parcels that reach above an open top of their
// lattice, which cuts their clouds flat; and, where clouds do not thin out towards open sides (detail.apron_cells, with detail), those
// that reach beyond them. Ellipsoids count as far as their radius. Pure.
std::vector<std::string> warnings(const Scene& scene);

}  // namespace nephos
