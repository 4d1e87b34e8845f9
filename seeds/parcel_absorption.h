// SPDX-License-Identifier: Apache-2.0
#pragma once

// T's light absorption factor (light_absorption.h) for the voxels of an automaton that clouds drive. Every box of a cloud
// is an ellipsoid there (coupling.h), so the light's way inside the cloud is measured in the ellipsoids:
//
//     absorbed(x) = clamp(sum over the cloud's ellipsoids of weight * length inside / light distance, 0, 1)
//
// along the ray from the place x to the sun. It concerns the voxels that lie in the cloud, by how far in:
//
//     part(x) = max over the cloud's ellipsoids of min(1, 4 weight) * clamp((1.5 - r) / 0.5, 0, 1)
//
// with r = |x - centre| in semi-axes: all of it within an ellipsoid, none from one and a half of its size on, so that
// neither another cloud nor the rim has an edge of light. The clouds together leave
//
//     sunlight(x) = product over the clouds of 1 - strength * part(x) * absorbed(x)
//
// A cloud of infinite light distance leaves all. Of a changing cloud each form counts by itself. Where sides of a lattice are
// periodic, its clouds have images beyond them, as its ellipsoids have.
//
// Places ask only clouds whose ellipsoids reach the column that they are in: tens of ellipsoids a place.

#include <cstdint>
#include <span>
#include <vector>

#include "seeds/coupling.h"

namespace nephos {

// The ellipsoids of one form of a cloud, as far as they are there.
struct AbsorbingCloud {
    std::vector<ActiveEllipsoid> ellipsoids;
    double light_distance_m = 0;  // > 0, finite
    double strength = 1;          // 0..1, of the factor
};

// What the clouds of a layer do to the light in its voxels.
struct ParcelLight {
    double strength = 1;  // 0..1; 0: nothing
    // The edges of the world in directions in which the lattice is periodic; 0: it is not.
    Vec2 period_m{0, 0};
};

// Appends the clouds of a layer that have a finite light distance, at a time that decides the forms of those that change, with
// their images. `clouds` have shapes of `sky`.
void append_absorbing(std::vector<AbsorbingCloud>& out, const SkySimulation& sky,
                      std::span<const SkyCloud> clouds, const CouplingOptions& coupling,
                      const ParcelLight& light, double time_s);

class ParcelAbsorption {
  public:
    // `to_sun`: any length > 0. Throws Error(usage) on a direction or a cloud out of the ranges above.
    ParcelAbsorption(std::span<const AbsorbingCloud> clouds, const Vec3& to_sun);

    bool empty() const { return clouds_.empty(); }

    // Returns the fraction of the sunlight, 0..1, that the clouds leave to voxels at a place of the world. Thread-safe.
    double sunlight_at(const Vec3& place_m) const;

    // Returns the fraction of the light of a lightning that the clouds leave to voxels at a place: the same with the way
    // to the lightning, which may be in a cloud, in the place of that to the sun. Thread-safe.
    double lightning_at(const Vec3& place_m, const Vec3& flash_m) const;

    // Returns all numbers that sunlight_at() depends on, for keys of caches.
    std::vector<double> content() const;

  private:
    // An ellipsoid as the unit sphere of a space of its own.
    struct Parcel {
        Vec3 centre_m, per_m;  // 1 / semi-axes
        Vec3 way;              // of the sun's light there, for each metre in the world
        double weight = 1;
    };
    struct Group {
        std::size_t first = 0, count = 0;  // of parcels_
        double light_distance_m = 1, strength = 1;
        Vec3 low_m, high_m;  // beyond it the cloud has no part
    };

    // `way_of(parcel)`: Parcel::way of the light, which is `reach_m` away.
    template <class WayOf>
    double absorbed_part(const Group& cloud, const Vec3& place_m, double reach_m, const WayOf& way_of) const;
    template <class WayOf>
    double left_at(const Vec3& place_m, double reach_m, const WayOf& way_of) const;
    void bin();

    Vec3 to_sun_;
    std::vector<Parcel> parcels_;
    std::vector<Group> clouds_;
    // Clouds by level cells of the world: of each cell those from first_[cell] to first_[cell + 1].
    Vec2 low_m_{0, 0}, per_m_{0, 0};
    int cells_[2] = {0, 0};
    std::vector<std::uint32_t> first_, listed_;
};

}  // namespace nephos
