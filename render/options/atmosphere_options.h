// SPDX-License-Identifier: Apache-2.0
#pragma once

// What a scene says about its sky (atmosphere.h has the physics behind it); plain data.

#include <array>

namespace nephos {

enum class AirModel {
    gradient,  // two colours and an extinction: RenderOptions::air
    physical,  // light scattered by molecules, haze and ozone of a round Earth's air
};

// With AirModel::physical RenderOptions::air has no effect, and Sun::colour is that above the air.
struct AtmosphereOptions {
    AirModel model = AirModel::gradient;
    // Particles in the air, as a multiple of clear air, 0..100: whitens the horizon, widens the sun's glow
    // and reddens low suns. 1 is a visibility of about 100 km, 10 of 20 km.
    double haze = 1.0;
    // Asymmetry of the particles' phase function, 0..0.95; larger: a smaller, brighter glow around the sun.
    double haze_g = 0.8;
    // Ozone, as a multiple of that of the Earth, 0..10: keeps the sky blue in twilight.
    double ozone = 1.0;
    // The light of sky and ground in clouds, as a multiple of what arrives, 0..10.
    double ambient = 1.0;
    // How far eye or camera adapt to a low sun and to twilight, 0..1: all light of sun and sky is multiplied
    // by (1 + 0.1 / illuminance of the ground)^adaptation, where a noon sun's is 1. 0: not at all, and the
    // picture is black long before the sky is.
    double adaptation = 0.6;
    bool sun_disc = true;  // draw the sun
    // Radiance of the sky without any sun, >= 0.
    std::array<double, 3> night{0.0006, 0.0009, 0.0016};
    bool operator==(const AtmosphereOptions&) const = default;
};

}  // namespace nephos
