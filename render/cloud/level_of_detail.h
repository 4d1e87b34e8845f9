// SPDX-License-Identifier: Apache-2.0
#pragma once

// Level of detail (D, S: voxels far away larger, fewer metaballs): a block of 2 x 2 x 2 voxels becomes one
// metaball with their optical mass (density * radius^3), their centre of gravity and, by its radius, their
// second moment, of which the part that comes from their places counts kSpread times: with it alone full
// blocks of metaballs of 1.5 edges would get 1.08 of their distance as radius, which ripples
// (density/metaballs.h). Blocks of blocks likewise, up to 8 x 8 x 8. Blocks lie on a lattice that the world
// fixes, so neither the eye nor the density moves them.
//
// Merging blurs over the size of a block. What that takes from a ray is about the block's contrast: with t_i
// the optical depths through the centres of its eight children (0 where there is none),
//
//     contrast^2 = variance(t) + (kEdge mean(t))^2
//
// where the second term stands for the light, which falls off through an even block, and for the edge of a
// dense cloud. Contrast is small on faint rims, in veils and in even interiors. It shows in as many pixels as
// the block covers, so that the picture's mean difference grows with contrast times r^2, r = radius of the
// children in the picture. Hence a block is merged below
//
//     contrast = kLevel^(level - 1) (options.pixels / r)^2,    level 1 = 2 x 2 x 2 voxels,
//
// the same loss in the picture for every metaball that is saved: inner and faint voxels early, distant ones
// all. Between kFull of this threshold and the threshold itself both levels are drawn, each with a share of
// the density: all optical depths are continuous in the eye's place and in the voxels' densities, and nothing
// pops. A larger block is merged at most as far as all of its children are.
//
// What cannot be seen from anywhere may lose all its contrast: 4 x 4 x 4 voxels are merged, as far as they go
// also with their neighbours to 8 x 8 x 8, where the least optical depth between them and the outside
// (block_cover.h) is kHidden, or in part from kVeiled on. An octant covers others by its thinnest voxel, and
// not at all if one is missing: nothing that one may look through is closed. Of Disney's cloud where every
// voxel is opaque that is a twelfth; ragged clouds have hardly any such voxels.
//
// Measured and dropped: a threshold that does not depend on r (three times the difference for as many
// metaballs; the light of an unchanged cloud would outlive a step of the eye, but computing it for the fewer
// metaballs costs less than drawing all of them), the largest or the sum of the depths instead of their
// spread (twice the metaballs).
//
// No Vulkan here. Private to the module.

#include <optional>
#include <vector>

#include "render/cloud/block_cover.h"
#include "render/cloud/cloud_preparation.h"
#include "render/cloud/splats.h"
#include "render/cloud/voxel_blocks.h"
#include "render/options/level_of_detail_options.h"

namespace nephos {

// From where a cloud is seen; pixels_per_unit: size in pixels of a unit at distance 1.
struct DetailView {
    Vec3 eye_m{};
    double pixels_per_unit = 0;
    bool operator==(const DetailView&) const = default;
};

// What is drawn in the place of a cloud.
struct MergedCloud {
    std::vector<Metaball> metaballs;
    std::vector<float> depth_scale;  // of each, as PreparedCloud::depth_scale
};

// What does not depend on the eye: the blocks of a cloud, and how far their octants are hidden, 0..1.
struct DetailBlocks {
    double radius_voxels = 1;  // of the metaballs
    VoxelBlocks voxels;
    std::vector<OfOctants> hidden;  // one for each block
};

// `given`: what prepare() makes of `cloud`. Nothing where there are no voxels: also with more than 16
// different radii, balls farther than 2^22 voxels from the world's origin, or hardly any two of a block
// following each other (metaballs() puts them in order). The result does not depend on the number of threads.
// Some 15 ns a metaball.
std::optional<DetailBlocks> detail_blocks(const PreparedCloud& given, const MetaballCloud& cloud);

// `blocks`: those of the same cloud. Nothing if no two metaballs are merged. The sum of density * radius^3
// stays to rounding. The result does not depend on the number of threads. Some 10 ns a metaball.
std::optional<MergedCloud> merge_voxels(const PreparedCloud& given, const MetaballCloud& cloud,
                                        const DetailBlocks& blocks, const DetailView& view,
                                        const LevelOfDetailOptions& options);

}  // namespace nephos
