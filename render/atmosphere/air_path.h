// SPDX-License-Identifier: Apache-2.0
#pragma once

// The parts of a ray through the air, and the light that they scatter (Atmosphere). Lengths are kilometres.
// Private to the module.
//
// The ray is cut where density changes; of each part the weights
//
//     w = integral over the part of  transmittance to the eye * scattering coefficient
//
// are integrated finely, once for all suns, and the sun's light is taken at one place, the weights' centre of
// gravity: light that changes linearly along the part is integrated exactly.

#include <cstddef>
#include <span>
#include <vector>

#include "render/atmosphere/atmosphere.h"

namespace nephos {

inline constexpr std::size_t kColumnSines = 256, kColumnRadii = 64;  // table of columns
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
    // Along a ray from `radius`: to the top, and to the ground (negative when it passes).
    double to_top(double radius, double sine) const;
    double to_ground(double radius, double sine) const;
    double horizon_sine(double radius) const;  // of the ray that touches the ground, <= 0
};

// Places in tables, as indices with fractions.
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

// From a point to the top of the air or to the ground. `even`: 0 cuts it most finely where it is lowest, 1
// evenly.
AirPath air_path(const SphericalAir& air, double radius, double sine, std::size_t parts, double even = 0);

// Tables as the kernel reads them: planes for red, green, blue (columns: rayleigh, mie, ozone), rows of
// radii.
struct AirTables {
    std::vector<float> columns;  // km of air of the density on the ground, 3 planes
    std::vector<float> psi;      // logarithms of multiple scattering, 3 planes; empty: none
};

// What parts of a path scatter of suns at `sun_sine` (as seen from the path's start) towards the eye, without
// phase functions; `cos_to_sun`: between ray and sun. Each plane has as many numbers as there are suns.
struct ScatteredPlanes {
    std::vector<float> rayleigh[3], mie[3], many[3];
    explicit ScatteredPlanes(std::size_t suns);
};
void scatter_along(const SphericalAir& air, const AirTables& tables, const AirPath& path,
                   std::span<const float> sun_sine, std::span<const float> cos_to_sun, ScatteredPlanes& out);

// Share of the sun's disc above the horizon.
double visible_sun(double sine, double horizon_sine);

// Nodes and weights of the Gauss-Legendre rule on 0..1.
struct GaussRule {
    std::vector<double> nodes, weights;
    explicit GaussRule(int count);
};

}  // namespace nephos
