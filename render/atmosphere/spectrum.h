// SPDX-License-Identifier: Apache-2.0
#pragma once

// Colours of daylight from six wavelengths. Radiances at kWavelengths_nm, each relative to the sun's spectrum
// above the air, become linear sRGB by one matrix, fitted to integration with the CIE 1931 matching functions
// in steps of 1 nm (tests/reference/fit_spectrum.py has the sources): the largest error over light behind up
// to 38 airmasses, scattered or not, is 0.001 of a colour's largest channel. White is the sun at 60 degrees
// through clear air, adapted by Bradford's matrix; the sun above the air has a luminance of 1. Private to the
// module.

#include <array>
#include <cstddef>

#include "render/options/options.h"

namespace nephos {

inline constexpr std::size_t kWavelengths = 6;
inline constexpr std::array<double, kWavelengths> kWavelengths_nm{415, 455, 520, 565, 620, 695};

inline constexpr double kRgbOfWavelengths[3][kWavelengths] = {
    {0.0289504326, 0.00693114264, -0.540817539, 0.456223142, 0.958261774, 0.0387119461},
    {-0.0271237725, -0.0433391719, 0.618848844, 0.461705148, -2.93552699e-05, -0.00750081304},
    {0.187230738, 0.99176173, 0.0802096654, -0.0965295695, -0.0137658665, -0.000608125382},
};

// Absorption by the Earth's ozone where it is densest, 1/m.
inline constexpr std::array<double, kWavelengths> kOzone_per_m{2.22564e-8, 1.60817e-7, 1.1495e-6,
                                                               2.40164e-6, 2.00988e-6, 4.53512e-7};

// Colours of thin air, 1/m: the means of the coefficients over what the eye sees.
inline constexpr Rgb kThinRayleigh_per_m{6.36803e-6, 1.365324e-5, 3.187530e-5};
inline constexpr Rgb kThinOzone_per_m{2.56555e-6, 1.80063e-6, 0};

// Returns the scattering by molecules on the ground, 1/m; wavelength^-4, as in AtmosphereModel. Pure.
constexpr double rayleigh_per_m(double wavelength_nm) {
    const double square = wavelength_nm * wavelength_nm * 1e-6;
    return 1.24062e-6 / (square * square);
}

// Moves a colour out of the reach of sRGB towards grey of the same luminance until no channel is negative;
// others are returned as they are. Pure.
Rgb into_gamut(const Rgb& colour);

}  // namespace nephos
