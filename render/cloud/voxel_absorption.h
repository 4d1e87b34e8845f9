// SPDX-License-Identifier: Apache-2.0
#pragma once

// T's light absorption factor (CFA) for clouds of metaballs, as an alternative to D's light pass: for any
// light outside of the cloud, also below the horizon or near by, with no picture from the light.
//
// T sums up the lengths of a ray inside the boxes of a cloud. Here the boxes are cubes of one size, side by
// side, whose edge is half of the metaballs' mean radius, so about a voxel (larger when there would be more
// than 2^24 cubes); a length counts by the cube's mean density, 1 = saturated:
//
//     absorbed = clamp(sum over cubes of density * length inside / light distance, 0, 1)
//
// along the ray from a metaball's centre to the light, its own cube from the centre outwards. A metaball's
// content (the integral of its field) is shared among the eight cubes around its centre by their nearness in
// each axis, so the densities do not depend on how cubes and lattice lie to each other.
//
// Error: against the integral of the metaballs' own density along the same ray, the cubes blur by about two
// edges, so `absorbed` is off by at most two edges / light distance, a sixth of that in the root mean square
// (the test measures it). Cost: a ray visits each cube on its way once. Private to the module; const
// functions may run in several threads.

#include <vector>

#include "render/cloud/cloud_preparation.h"

namespace nephos {

class DensityBlocks {
  public:
    // `extinction_per_m` as in MetaballCloud: what the density 1 means.
    DensityBlocks(const PreparedCloud& cloud, double extinction_per_m);

    // Sum of density * length along a ray, in metres, up to `length_m`; stops early beyond `enough_m`.
    // `way`: unit vector.
    double column_m(const Vec3& from_m, const Vec3& way, double length_m, double enough_m) const;

    // The definition above, for a light at infinity and for one at a place.
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

// What replaces the light pass: the light that arrives at each of cloud.visible, 1 - absorbed, ...
std::vector<float> light_by_absorption(const PreparedCloud& cloud, const DensityBlocks& blocks,
                                       const Vec3& to_sun, double light_distance_m);
// ... from lightning, ...
std::vector<float> flash_by_absorption(const PreparedCloud& cloud, const DensityBlocks& blocks,
                                       const Vec3& flash_m, double light_distance_m);
// ... and the texels of the shadow map, as Picture::shadow.
std::vector<float> shadow_by_absorption(const DensityBlocks& blocks, const ShadowFrame& frame,
                                        int shadow_size, double light_distance_m);

}  // namespace nephos
