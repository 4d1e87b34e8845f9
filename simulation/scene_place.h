// SPDX-License-Identifier: Apache-2.0
#pragma once

// What files say of the air and the box that voxels lie in: the wind by height, and the lengths after which the box
// repeats. Functions are pure and thread-safe.

#include <cstddef>
#include <optional>
#include <vector>

#include "core/wind.h"
#include "scenes/format/scene.h"

namespace nephos {

// Returns the wind at a moment as a table that is linear between its levels and constant beyond them: of a layer, or
// of all together (nullopt), where each height has the wind of the first layer whose lattice holds it. Layers of
// different winds are sampled at the centres of `size` voxels from `box.origin_m` up. Empty in calm air.
std::vector<WindLevel> wind_levels(const Scene& scene, std::optional<std::size_t> layer, const Placement& box,
                                   Extent size, double time_s);

// Returns the wind of all heights as such a table, without a box: the levels of each layer's wind within its lattice, with the
// centres of that one's lowest and highest cells and of those beyond, and those of the common wind outside.
std::vector<WindLevel> wind_profile(const Scene& scene, double time_s);

// Returns the wind at a height: of the first layer whose lattice holds it, else the common one.
Velocity wind_at_height(const Scene& scene, double height_m, double time_s);

// Returns the velocity at the centre of each level of voxels, size.z of them.
std::vector<Velocity> wind_of_levels(const Scene& scene, std::optional<std::size_t> layer,
                                     const Placement& box, Extent size, double time_s);

// Returns the lengths in metres after which the density of a layer, or of all together, repeats; 0 on an axis where it
// does not. Of several layers an axis repeats if it does so in all of them, over the same stretch of the world.
Vec3 period_m(const Scene& scene, std::optional<std::size_t> layer);

// Returns the height of the world's origin above mean sea level: over an ellipsoid as far as the place says how high mean sea
// level stands there (geoid_height_m). 0 without a place. Pure.
double msl_height_m(const Georeference& place);

// Latitude and longitude on WGS 84, in degrees.
struct GeodeticPlace {
    double latitude_deg = 0, longitude_deg = 0;
};

// Returns where a point of the world lies on Earth. Precondition: place.given. Pure.
GeodeticPlace geodetic_place(const Georeference& place, const Vec3& world_m);

}  // namespace nephos
