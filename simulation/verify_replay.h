// SPDX-License-Identifier: Apache-2.0
#pragma once

// The simulation of a run done anew by `nephos verify --replay`. Private to the module.

#include "simulation/run_listing.h"
#include "simulation/verify.h"

namespace nephos {

// Simulates `count` frames of the run from its first on, and compares their states, and the voxels of files that are not refined, with those of
// the manifest, and says how many.
// Takes what the scene starts from, which must be as it was; otherwise the check is not done, and says why.
Check replay_frames(const RunListing& run, int count);

}  // namespace nephos
