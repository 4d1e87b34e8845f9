// SPDX-License-Identifier: Apache-2.0
#pragma once

// Level of detail (D, S: larger voxels far away, fewer metaballs): a block of 2 x 2 x 2 voxels is merged into
// one metaball with their optical mass (density * radius^3), centre of gravity and, by its radius, second
// moment. The part of the second moment that comes from the distances of the centres is multiplied by
// kSpread: without that, full blocks of metaballs with a radius of 1.5 voxels would be merged into metaballs
// with a radius of 1.08 times their spacing, too little overlap for an even density (density/metaballs.h).
// Blocks of blocks are merged likewise, up to 8 x 8 x 8. The lattice of blocks is fixed in the world,
// independent of camera and density.
//
// Merging blurs over the size of a block. The error along a ray is about the block's contrast: with t_i the
// optical depths through the centres of its eight children (0 where there is none),
//
//     contrast^2 = variance(t) + (kEdge mean(t))^2
//
// where the second term stands for the light, which falls off through an even block, and for the edge of a
// dense cloud. Contrast is small on faint rims, in veils and in even interiors. The error affects as many
// pixels as the block covers, so that the mean difference of the image grows with contrast times r^2, r =
// projected radius of the children in pixels. Hence a block is merged below
//
//     contrast = kLevel^(level - 1) (options.pixels / r)^2,    level 1 = 2 x 2 x 2 voxels,
//
// the same error in the image for every metaball that is saved: inner and faint voxels early, distant ones
// all. Between kFull of this threshold and the threshold itself both levels are drawn, with weights of the
// density: all optical depths are continuous in the eye's position and in the voxels' densities, and nothing
// pops. The weight of a larger block is at most that of each of its children.
//
// Occluded blocks are merged whatever their contrast: 4 x 4 x 4 voxels, where possible with their neighbours
// to 8 x 8 x 8, where the least optical depth between them and the outside (block_cover.h) is kHidden, and
// partially from kVeiled on. An octant occludes by its thinnest voxel, and not at all if one is missing, so
// that no gap is closed. That holds for a twelfth of the voxels of Disney's cloud if each voxel is opaque;
// ragged clouds have hardly any such voxels.
//
// Alternatives that were measured and dropped: a threshold independent of r (three times the difference for
// as many metaballs; it would let the light of an unchanged cloud be reused when the camera moves, but
// recomputing it for the fewer metaballs costs less than drawing all of them), and the maximum or the sum of
// the depths instead of their spread (twice the metaballs).
//
// Private to the module.

#include <optional>
#include <vector>

#include "render/cloud/block_cover.h"
#include "render/cloud/cloud_preparation.h"
#include "render/cloud/splats.h"
#include "render/cloud/voxel_blocks.h"
#include "render/options/options.h"

namespace nephos {

// The view of a cloud; pixels_per_unit: size in pixels of a unit at distance 1.
struct DetailView {
    Vec3 eye_m{};
    double pixels_per_unit = 0;
    bool operator==(const DetailView&) const = default;
};

// The metaballs that replace those of a cloud.
struct MergedCloud {
    std::vector<Metaball> metaballs;
    std::vector<float> depth_scale;      // of each, as PreparedCloud::depth_scale
    std::vector<std::uint8_t> detailed;  // of each, as PreparedCloud::detailed
};

// The view-independent part: the blocks of a cloud, and the occlusion of their octants, 0..1.
struct DetailBlocks {
    double radius_voxels = 1;  // of the metaballs
    VoxelBlocks voxels;
    std::vector<OfOctants> hidden;  // one for each block
};

// Finds the blocks of a cloud. `given`: the result of prepare(cloud). Returns nullopt where the metaballs are
// no voxels: with more than 16 different radii, centres farther than 2^22 voxels from the world's origin, or
// hardly any two successive ones in one block (metaballs() orders them). The result does not depend on the
// number of threads. Takes some 15 ns a metaball.
std::optional<DetailBlocks> detail_blocks(const PreparedCloud& given, const MetaballCloud& cloud);

// Merges metaballs for a view; `blocks`: those of the same cloud. Returns nullopt if none are merged.
// Preserves the sum of density * radius^3 up to rounding. The result does not depend on the number of
// threads. Takes some 10 ns a metaball.
std::optional<MergedCloud> merge_voxels(const PreparedCloud& given, const MetaballCloud& cloud,
                                        const DetailBlocks& blocks, const DetailView& view,
                                        const LevelOfDetailOptions& options);

}  // namespace nephos
