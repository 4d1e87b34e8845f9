// SPDX-License-Identifier: Apache-2.0
#pragma once

// When voxels are drawn together as one larger metaball (level_of_detail.h). Plain data.

namespace nephos {

struct LevelOfDetailOptions {
    // Radius in the picture, pixels, at which the metaballs of a block of 2 x 2 x 2 voxels are drawn as one
    // if their optical depths spread by less than 1; at n times that radius they must spread n^2 times less.
    // 0..1000; larger is faster and softer, 0: every voxel is drawn for itself.
    double pixels = 2.5;
    bool operator==(const LevelOfDetailOptions&) const = default;
};

// Throws Error(usage) naming the first value that is out of its range.
void check(const LevelOfDetailOptions& options);

}  // namespace nephos
