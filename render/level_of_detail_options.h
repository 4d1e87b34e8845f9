// SPDX-License-Identifier: Apache-2.0
#pragma once

// When voxels are drawn together as one larger metaball (level_of_detail.h). Plain data.

namespace nephos {

struct LevelOfDetailOptions {
    // Optical depth: a block of 2 x 2 x 2 voxels whose metaballs differ by less is drawn as one, near and
    // far, because what is lost hardly shows. 0..10; larger is faster and softer, 0: every voxel is drawn for
    // itself.
    double contrast = 0.2;
    // Metaballs whose radius in the picture is n times smaller than this many pixels may differ n^2 times as
    // much. 0..1000; larger is faster and softer far away, 0: distance makes no difference.
    double pixels = 4;
    bool operator==(const LevelOfDetailOptions&) const = default;
};

// Throws Error(usage) naming the first value that is out of its range.
void check(const LevelOfDetailOptions& options);

}  // namespace nephos
