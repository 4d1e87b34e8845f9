// SPDX-License-Identifier: Apache-2.0
#pragma once

// Judges the voxels of a run for `nephos verify`: each density file decoded, compared with the manifest, with the files of
// the layers and with the frame before. Private to the module.

#include <vector>

#include "simulation/run_listing.h"
#include "simulation/verify.h"

namespace nephos {

// Decodes every density file and appends the checks. One process reads ahead; what it cannot read is tried once more alone,
// which tells whose fault it is, and the rest goes on.
void check_content(const RunListing& run, const VerifyOptions& options, std::vector<Check>& checks);

}  // namespace nephos
