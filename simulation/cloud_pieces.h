// SPDX-License-Identifier: Apache-2.0
#pragma once

// The clouds of a sky that are drawn directly, as the pieces from which rain falls (density/cloud_bases.h). Private to the
// module.

#include <span>
#include <vector>

#include "density/cloud_bases.h"
#include "seeds/sky_simulation.h"

namespace nephos {

// Returns a piece for each billboard that is there at a time, of all forms of the clouds, as SkyBillboards lists them.
// `clouds` have shapes of `sky`. Pure; thread-safe.
std::vector<CloudPiece> cloud_pieces(const SkySimulation& sky, std::span<const SkyCloud> clouds, double time_s);

}  // namespace nephos
