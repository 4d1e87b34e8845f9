// SPDX-License-Identifier: Apache-2.0
#pragma once

// The tables of an Atmosphere. Private to the module. Lengths are kilometres.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "render/atmosphere/air_path.h"
#include "render/atmosphere/atmosphere.h"

namespace nephos {

struct Atmosphere::Tables {
    explicit Tables(const AtmosphereModel& m);

    Rgb optical_depth(double radius, double sine) const;
    Rgb sunlight(double radius, double sine) const;
    Rgb from_sun_on_ground(double sine) const;
    Rgb irradiance(std::size_t kind, double altitude_km, double sine) const;
    void make_columns();
    void make_psi();
    void make_psi_row(std::size_t row, std::vector<float>& psi) const;
    void make_irradiances();
    void make_irradiance_row(std::size_t row, std::size_t first_kind, std::size_t end_kind);
    Rgb ground_radiance(const AirPath& path, double sun, double cos_to_sun, bool with_sky) const;

    AtmosphereModel model;
    SphericalAir air;
    AirTables tables;
    std::vector<float> ground_sun;  // irradiance on the ground, by the sun's sine: kGroundSuns, 3 planes
    // Logarithms, by height and sun: 3 planes each of light from above, from below and sideways.
    std::array<std::vector<float>, 3> irradiances;
    static constexpr std::size_t kGroundSuns = 4 * kSunSines;
};

// Samples a plane of logarithms, kSunSines wide, bilinearly and returns the exponential.
double between_logs(const float* plane, double column, double row, std::size_t rows);

inline double radius_at(const SphericalAir& air, double altitude_m) {
    return std::clamp(air.ground + altitude_m / 1000, air.ground, air.top - 1e-3);
}
inline double sine_of(double degrees) { return std::sin(degrees * std::numbers::pi / 180); }

}  // namespace nephos
