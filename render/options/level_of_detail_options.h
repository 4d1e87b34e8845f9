// SPDX-License-Identifier: Apache-2.0
#pragma once

// Criterion by which voxels are merged into one larger metaball (render/cloud/level_of_detail.h). Plain data.

namespace nephos {

struct LevelOfDetailOptions {
    // Projected radius in pixels, 0..1000, at which the metaballs of a block of 2 x 2 x 2 voxels are merged
    // if their optical depths differ by less than 1; at n times that radius they must differ by n^2 times
    // less. Larger is faster and softer; 0: no merging.
    double pixels = 2.5;
    bool operator==(const LevelOfDetailOptions&) const = default;
};

// Throws Error(usage) naming the first value that is out of its range.
void check(const LevelOfDetailOptions& options);

}  // namespace nephos
