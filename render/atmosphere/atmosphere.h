// SPDX-License-Identifier: Apache-2.0
#pragma once

// Precomputed radiance of a clear sky.
//
//     Atmosphere    does not depend on sun or eye:
//                     optical depths       from a height to space in a direction, for transmittance
//                     multiple scattering  mean radiance of light scattered twice and more (Hillaire 2020)
//                     irradiances          of sky and ground, from above, from below and sideways
//     SkyTable      radiance for one elevation of the sun and one height of the eye, in two parts: molecules
//                   with their phase function plus multiple scattering, and single scattering by particles
//                   without phase function. A pixel takes two look-ups (Sapronov); the aureole stays sharp
//
// Single scattering is integrated as by Nishita et al. 1993. Light scattered n > 1 times is isotropic, a
// geometric series over n: S. Hillaire, "A Scalable and Production Ready Sky and Atmosphere Rendering
// Technique", EGSR 2020, equations 5 to 11. Here the ground's reflection is part of that series.
//
// Altitudes are metres above the ground sphere. Radiances are for a sun of irradiance 1 above the air.
// Everything is const after construction and may be read by many threads; tables are computed with oneTBB and
// have the same bits for any number of threads.

#include <array>
#include <memory>
#include <vector>

#include "render/options/atmosphere_options.h"
#include "render/options/options.h"

namespace nephos {

// The air of the Earth. Coefficients are at sea level, in 1/m, for red, green and blue (680, 550, 440 nm):
// E. Bruneton and F. Neyret, "Precomputed Atmospheric Scattering", EGSR 2008, section 4, with the ozone of
// Bruneton's 2017 implementation, as in Hillaire 2020, table 1.
struct AtmosphereModel {
    double ground_radius_m = 6'360'000;
    double top_radius_m = 6'460'000;  // nothing scatters above
    Rgb rayleigh_per_m{5.802e-6, 13.558e-6, 33.1e-6};
    double rayleigh_height_m = 8'000;  // density falls off as exp(-altitude / height)
    double mie_scattering_per_m = 3.996e-6, mie_extinction_per_m = 4.440e-6;
    double mie_height_m = 1'200;
    double mie_g = 0.8;  // asymmetry, forward > 0
    Rgb ozone_per_m{0.650e-6, 1.881e-6, 0.085e-6};
    double ozone_centre_m = 25'000, ozone_half_width_m = 15'000;  // density is a tent between centre -+ width
    Rgb ground_albedo{0.3, 0.3, 0.3};
    bool operator==(const AtmosphereModel&) const = default;
};

// Returns the Earth's air with the options' haze and ozone.
AtmosphereModel atmosphere_model(const AtmosphereOptions& options, const Rgb& ground_albedo);

// Irradiance above the air of a sun of colour 1, in units of pi: a white surface that faces the sun at noon
// then has a radiance of about 1 (luminance of the zenith's transmittance: 0.876).
inline constexpr double kSunAboveAir = 1.14;

// Angular radius of the sun's disc, degrees.
inline constexpr double kSunRadius_deg = 0.265;

// Irradiance by sky and ground on a surface, per irradiance of the sun above the air; without direct
// sunlight.
struct SkyIrradiance {
    Rgb from_above{};  // on a surface that faces the zenith
    Rgb from_below{};  // ... that faces the ground
    Rgb sideways{};    // ... on a wall, the mean over its orientations
};

// Radiances, RGB and one unused number a texel; rows are elevations, columns azimuths from the sun's, by
// sky_across() and air_row() of render/shared/formulas.h. The first and last columns and rows are at the
// ends of the range.
struct SkyTable {
    std::vector<float> scattered;  // molecules with their phase function, plus multiple scattering
    std::vector<float> haze;       // single scattering by particles, without their phase function
};

// The air along rays up to a distance, for one elevation of the sun and one height of the eye, four numbers a
// texel: kSkyColumns distances by kSkyRows elevations, by air_distance() and air_row(). Radiances are those of
// SkyTable, at azimuths from the sun's whose cosines are kAirAzimuth, 0 and -kAirAzimuth; between, they are square in the
// cosine, as the phase function of molecules is.
struct AirTable {
    std::vector<float> transmittance;
    std::array<std::vector<float>, 3> scattered, haze;
};

// Returns the distance of a column of an AirTable, metres; `row` says the side of the horizon.
double air_table_distance_m(const AtmosphereModel& model, double eye_altitude_m, std::size_t row,
                            std::size_t column);

class Atmosphere {
  public:
    explicit Atmosphere(const AtmosphereModel& model);
    ~Atmosphere();
    Atmosphere(Atmosphere&&) noexcept;
    Atmosphere& operator=(Atmosphere&&) noexcept;

    const AtmosphereModel& model() const;

    // Returns the transmittance of the air between a point and space along a ray; `sine`: of its elevation. 0
    // where it meets the ground.
    Rgb transmittance(double altitude_m, double sine) const;
    // Returns the irradiance of the sun's disc on a surface that faces it, for elevations of -90..90 degrees.
    Rgb sunlight(double altitude_m, double sun_elevation_deg) const;
    // Returns the mean over all directions of the radiance of multiply scattered light (Hillaire's Psi).
    Rgb multiple_scattering(double altitude_m, double sun_sine) const;
    SkyIrradiance irradiance(double altitude_m, double sun_elevation_deg) const;

    // Computes the sky for directions from the horizon, which dips with the eye's height, to the zenith.
    SkyTable sky(double eye_altitude_m, double sun_elevation_deg) const;
    // Computes the air up to distances, for directions from straight down to straight up.
    AirTable air(double eye_altitude_m, double sun_elevation_deg) const;

  private:
    struct Tables;
    std::unique_ptr<const Tables> tables_;
};

}  // namespace nephos
