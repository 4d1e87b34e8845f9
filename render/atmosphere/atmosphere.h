// SPDX-License-Identifier: Apache-2.0
#pragma once

// The light of a clear sky, in tables.
//
//     Atmosphere    does not depend on sun or eye:
//                     columns              air between a height and space in a direction; transmittance
//                     multiple scattering  mean radiance of light scattered twice and more (Hillaire 2020)
//                     irradiances          of sky and ground, from above, from below and from all sides
//     SkyTable      the sky at one height of the sun as an eye at one height sees it: light scattered by
//                   molecules and many times, with its phase function, and light scattered once by particles,
//                   without: a pixel takes two look-ups (Sapronov), and the glow around the sun stays sharp
//
// Single scattering is integrated as by Nishita et al. 1993; light scattered n > 1 times arrives from all
// sides alike, a geometric series over n: S. Hillaire, "A Scalable and Production Ready Sky and Atmosphere
// Rendering Technique", EGSR 2020, equations 5 to 11. Here the ground's reflection is part of that series.
//
// Altitudes are metres above the ground sphere. All light is for a sun of irradiance 1 above the air.
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

AtmosphereModel atmosphere_model(const AtmosphereOptions& options, const Rgb& ground_albedo);

// Irradiance above the air of a sun of colour 1, in units of pi: a white surface that faces the sun at noon
// then has a radiance of about 1 (luminance of the zenith's transmittance: 0.876).
inline constexpr double kSunAboveAir = 1.14;

// Half the angle under which the sun is seen, degrees.
inline constexpr double kSunRadius_deg = 0.265;

// Light that falls on a surface, per irradiance of the sun above the air; without the sun's own.
struct SkyIrradiance {
    Rgb from_above{};  // on a surface that faces the zenith
    Rgb from_below{};  // ... that faces the ground
    Rgb sideways{};    // ... on a wall, the mean over its orientations
};

// Radiances, RGB and one unused number a texel; rows are elevations, columns azimuths from the sun's:
// sky_across() and sky_upwards() of render/shared/shared.h. Column and row 0 and the last lie on the ends.
struct SkyTable {
    std::vector<float> scattered;  // by molecules, with their phase function, and many times by all
    std::vector<float> haze;       // once by particles, without their phase function
};

class Atmosphere {
  public:
    explicit Atmosphere(const AtmosphereModel& model);
    ~Atmosphere();
    Atmosphere(Atmosphere&&) noexcept;
    Atmosphere& operator=(Atmosphere&&) noexcept;

    const AtmosphereModel& model() const;

    // Of the air between a point and space; `sine`: of the elevation of the ray. 0 where it meets the ground.
    Rgb transmittance(double altitude_m, double sine) const;
    // Irradiance of the sun's disc on a surface that faces it, -90..90 degrees.
    Rgb sunlight(double altitude_m, double sun_elevation_deg) const;
    // Mean over all directions of the radiance of light that was scattered before (Hillaire's Psi).
    Rgb multiple_scattering(double altitude_m, double sun_sine) const;
    SkyIrradiance irradiance(double altitude_m, double sun_elevation_deg) const;

    // Directions from the horizontal to the zenith.
    SkyTable sky(double eye_altitude_m, double sun_elevation_deg) const;

  private:
    struct Tables;
    std::unique_ptr<const Tables> tables_;
};

// Radiance along a ray: `sine` of its elevation (0..1), cosine of its azimuth from the sun's, cosine of the
// angle to the sun. As the shaders have it (shaders/sky.glsl).
Rgb sky_radiance(const SkyTable& table, double sine, double cos_azimuth, double cos_to_sun, double mie_g);

}  // namespace nephos
