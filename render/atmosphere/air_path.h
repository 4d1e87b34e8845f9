// SPDX-License-Identifier: Apache-2.0
#pragma once

// Numerical integration of single scattering along a ray through the air, for Atmosphere. Lengths are in
// kilometres. Private to the module.
//
// The ray is divided into parts, shorter where density changes faster. For each part the weights
//
//     w = integral over the part of  transmittance to the eye * scattering coefficient
//
// are integrated finely, once for all suns, and the sunlight is evaluated at one point, the centroid of the
// weights: sunlight that varies linearly along the part is integrated exactly.

#include <cstddef>
#include <span>
#include <vector>

#include "render/atmosphere/atmosphere.h"

namespace nephos {

inline constexpr std::size_t kColumnSines = 256, kColumnRadii = 64;  // table of optical depths to space
inline constexpr std::size_t kSunSines = 128, kPsiRadii = 32;        // table of multiple scattering
inline constexpr std::size_t kAirLanes = 16;                         // numbers of suns are multiples of it

// Lengths in km, coefficients in 1/km.
struct SphericalAir {
    double ground, top;                                            // radii
    double rayleigh[3], mie_scattering, mie_extinction, ozone[3];  // on the ground; of ozone at its densest
    double per_rayleigh_height, per_mie_height, ozone_centre, per_ozone_half_width;

    explicit SphericalAir(const AtmosphereModel& model);
    double horizontal(double radius) const;  // from a sphere's tangent point to `radius`
    double most_horizontal() const { return horizontal(top); }
    // Distance along a ray from `radius` to the top, and to the ground (negative when the ray misses it).
    double to_top(double radius, double sine) const;
    double to_ground(double radius, double sine) const;
    double horizon_sine(double radius) const;  // of the ray that touches the ground, <= 0
};

// Coordinates of tables, as indices with fractions.
double sun_coordinate(double sine);                             // 0..kSunSines - 1, sines from -0.5 on
double sun_sine(double coordinate);                             // its inverse
double psi_coordinate(const SphericalAir& air, double radius);  // 0..kPsiRadii - 1
double psi_radius(const SphericalAir& air, double coordinate);
double column_coordinate(const SphericalAir& air, double radius);  // 0..kColumnRadii - 1
double column_radius(const SphericalAir& air, double coordinate);

struct AirPart {
    float distance, radius;     // of the centre of gravity
    float rayleigh[3], mie[3];  // weights
};

struct AirPath {
    double start_radius = 0, length = 0;
    bool meets_ground = false;
    std::vector<AirPart> parts;
    double transmittance[3] = {};  // of all of it
};

// Returns the path from a point to the top of the air or to the ground. `even`: 0 makes parts shortest where
// the ray is lowest, 1 equal.
AirPath air_path(const SphericalAir& air, double radius, double sine, std::size_t parts, double even = 0);

// Returns one part of a path, from `begin` to `end`; `transmittance` is that from the eye to its begin and becomes
// that to its end.
AirPart air_part(const SphericalAir& air, double radius, double sine, double begin, double end,
                 double (&transmittance)[3]);

// Tables in the kernel's layout: planes for red, green, blue (of `columns`: rayleigh, mie, ozone), rows of
// radii.
struct AirTables {
    std::vector<float> columns;  // km of air of the density on the ground, 3 planes
    std::vector<float> psi;      // logarithms of multiple scattering, 3 planes; empty: none
};

// Light scattered towards the eye along a path, without phase functions, for several suns: by molecules, by
// particles, and multiply scattered. Each plane has one number per sun.
struct ScatteredPlanes {
    std::vector<float> rayleigh[3], mie[3], many[3];
    explicit ScatteredPlanes(std::size_t suns);
};
// Computes it for suns whose sine of elevation at the path's start is `sun_sine`; `cos_to_sun`: of the angle
// between ray and sun. Both spans have a multiple of kAirLanes elements.
void scatter_along(const SphericalAir& air, const AirTables& tables, const AirPath& path,
                   std::span<const float> sun_sine, std::span<const float> cos_to_sun, ScatteredPlanes& out);

// Returns the fraction of the sun's disc above the horizon.
double visible_sun(double sine, double horizon_sine);

}  // namespace nephos
