// SPDX-License-Identifier: Apache-2.0
#pragma once

// Level of detail (D, S: voxels far away larger, fewer metaballs): a block of 2 x 2 x 2 voxels becomes one
// metaball with their optical mass (density * radius^3), its centre of gravity and, for its radius, their
// second moment. Blocks of blocks likewise, up to 8 x 8 x 8. Blocks lie on a lattice that the world fixes, so
// neither the eye nor the density moves them.
//
// Merging blurs. What is lost is a block's contrast: with t_i the optical depths through the centres of its
// eight children (0 where there is none),
//
//     contrast^2 = variance(t) + (kEdge mean(t))^2
//
// where the second term stands for a block that is even in itself but may be a dense cloud's edge. It is
// independent of the eye, and on faint rims, veils and in even interiors small. A block is merged below
//
//     options.contrast / 4^(level - 1) * max(1, options.pixels / r)^2,   level 1 = 2 x 2 x 2 voxels,
//     r = radius of its children in the picture, pixels
//
// by level because a larger block shows in as many more pixels; so whole levels go where voxels are small.
// Between kFull of that threshold and the threshold itself both levels are drawn, each with a share of the
// density: the metaballs' optical depths are continuous in the eye's place and in the voxels' densities, and
// nothing pops. A level above is merged at most as far as all of its children are.
//
// No Vulkan here. Private to the module.

#include <optional>
#include <vector>

#include "render/cloud_preparation.h"
#include "render/level_of_detail_options.h"
#include "render/splats.h"

namespace nephos {

// From where a cloud is seen; pixels_per_unit: size in pixels of a unit at distance 1.
struct DetailView {
    Vec3 eye_m;
    double pixels_per_unit = 0;
    bool operator==(const DetailView&) const = default;
};

// What is drawn in the place of a cloud.
struct MergedCloud {
    std::vector<Metaball> metaballs;
    std::vector<float> depth_scale;  // of each, as PreparedCloud::depth_scale
};

// `given`: what prepare() makes of `cloud`. Nothing if no two metaballs are merged: also where there are no
// voxels, with more than 16 different radii, balls farther than 2^22 voxels from the world's origin, or
// hardly any two of a block following each other (metaballs() puts them in order). The sum of density *
// radius^3 stays to rounding. The result does not depend on the number of threads. A few ms for 200,000
// metaballs.
std::optional<MergedCloud> merge_voxels(const PreparedCloud& given, const MetaballCloud& cloud,
                                        const DetailView& view, const LevelOfDetailOptions& options);

// The box around the centres of the metaballs of `given` and their smallest radius.
struct DetailBounds {
    Vec3 low_m, high_m;
    double least_radius_m = 0;
};
DetailBounds detail_bounds(const PreparedCloud& given);

// False only if merge_voxels() gives the same from this view as from any nearer one.
bool depends_on_view(const DetailBounds& bounds, const DetailView& view, const LevelOfDetailOptions& options);

}  // namespace nephos
