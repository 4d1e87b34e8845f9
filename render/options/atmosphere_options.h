// SPDX-License-Identifier: Apache-2.0
#pragma once

// Options of the sky; plain data (physics: render/atmosphere/atmosphere.h).

#include <array>

namespace nephos {

enum class AirModel {
    gradient,  // two colours and an extinction: RenderOptions::air
    physical,  // scattering and absorption by molecules, haze and ozone around a spherical Earth
};

// How the physical sky gets its colours.
enum class SkyColours {
    primaries,  // light of 680, 550 and 440 nm is red, green and blue
    spectral,   // six wavelengths, integrated to sRGB, with white balanced to the noon sun
};

// With AirModel::physical, RenderOptions::air has no effect, and Sun::colour is the colour above the air.
struct AtmosphereOptions {
    AirModel model = AirModel::gradient;
    SkyColours colours = SkyColours::primaries;
    // Aerosol, relative to clear air, 0..100: more whitens the horizon, widens the sun's aureole and reddens
    // low suns. With the extinction of molecules the visibility (Koschmieder 1924: a contrast of 2 % is left) is
    // 217 km at 1, 58 km at 12, 27 km at 30.
    double haze = 12.0;
    // Asymmetry of the aerosol's phase function, 0..0.95; larger: a smaller, brighter aureole.
    double haze_g = 0.8;
    // Ozone, relative to that of the Earth, 0..10: makes the zenith blue in twilight.
    double ozone = 1.0;
    // Factor of the ambient light of sky and ground in clouds, 0..10; 1 is physical.
    double ambient = 1.0;
    // Adaptation of exposure to a low sun and to twilight, 0..1: all light of sun and sky is multiplied by
    // (1 + 0.1 / illuminance of the ground)^adaptation, with an illuminance of 1 at noon. With 0 images of
    // twilight are black.
    double adaptation = 0.6;
    bool sun_disc = true;  // draw the sun's disc
    // Radiance of the night sky, >= 0.
    std::array<double, 3> night{0.0006, 0.0009, 0.0016};
    bool operator==(const AtmosphereOptions&) const = default;
};

}  // namespace nephos
