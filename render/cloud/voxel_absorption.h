// SPDX-License-Identifier: Apache-2.0
#pragma once

// T's light absorption factor (CFA) for clouds of metaballs, an alternative to D's light pass for any light
// outside of the cloud, also below the horizon or near by, without a shadow map.
//
// T sums the lengths of a ray inside the boxes of a cloud. Here the boxes are the cubes of a regular grid
// whose edge is half of the metaballs' mean radius, about a voxel (larger when there would be more than 2^24
// cubes); each length is weighted by the cube's mean density, 1 = saturated:
//
//     absorbed = clamp(sum over cubes of density * length inside / light distance, 0, 1)
//
// along the ray from a metaball's centre to the light, its own cube from the centre outwards. The volume
// integral of a metaball's field is distributed over the eight cubes around its centre by trilinear weights,
// so that densities do not depend on the alignment of cubes and lattice.
//
// Error: relative to the line integral of the metaballs' own density, the cubes blur by about two edges, so
// the error of `absorbed` is at most two edges / light distance, a sixth of that in the root mean square
// (measured by the test). Cost: one visit per cube on the ray. Private to the module; const functions are
// thread-safe.

#include <vector>

#include "render/cloud/cloud_preparation.h"

namespace nephos {

class DensityBlocks {
  public:
    // Builds the grid; `extinction_per_m` as in MetaballCloud.
    DensityBlocks(const PreparedCloud& cloud, double extinction_per_m);

    // Returns the sum of density * length along a ray, in metres, up to `length_m`; stops early beyond
    // `enough_m`. `way`: unit direction.
    double column_m(const Vec3& from_m, const Vec3& way, double length_m, double enough_m) const;

    // Return `absorbed` as defined above, for a light at infinity and for one at a position.
    double absorbed_towards(const Vec3& from_m, const Vec3& to_light, double light_distance_m) const;
    double absorbed_from(const Vec3& from_m, const Vec3& light_m, double light_distance_m) const;

    double edge_m() const { return edge_m_; }

  private:
    float density(const int (&cell)[3]) const;

    double edge_m_ = 1;
    double origin_m_[3] = {};  // lower corner of the first cube
    int size_[3] = {};         // cubes on each axis
    std::vector<float> densities_;
};

// Return the transmitted fraction of light, 1 - absorbed, at each of cloud.visible: of the sun, ...
std::vector<float> light_by_absorption(const PreparedCloud& cloud, const DensityBlocks& blocks,
                                       const Vec3& to_sun, double light_distance_m);
// ... of lightning, ...
std::vector<float> flash_by_absorption(const PreparedCloud& cloud, const DensityBlocks& blocks,
                                       const Vec3& flash_m, double light_distance_m);
// ... and in the texels of the shadow map, laid out as Picture::shadow.
std::vector<float> shadow_by_absorption(const DensityBlocks& blocks, const ShadowFrame& frame,
                                        int shadow_size, double light_distance_m);

}  // namespace nephos
