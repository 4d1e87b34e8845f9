// SPDX-License-Identifier: Apache-2.0
#pragma once

// Radiance of rain and snow. Private to the module.

#include <vector>

#include "render/image/picture.h"
#include "render/options/options.h"
#include "render/shared/rain.h"

namespace nephos {

// The light on the particles of one frame.
struct PrecipitationLight {
    // What a particle refracts of its surroundings is
    //     fractions.sky * by_sky + fractions.sun * by_scattered_sun + sunlight * by_sunlit_ground
    // with the fractions of GroundLight at its place and the direct sunlight (0..1) there. The terms are the light of the
    // sky, that of sunlight which clouds scatter down, each with ground in it, and that of ground in the sun.
    Rgb by_sky{}, by_scattered_sun{}, by_sunlit_ground{};
    const GroundLight* ground = nullptr;  // null: no cloud
    Rgb sun{};                            // radiance of a white surface that faces the sun, without clouds
    Vec3 to_sun{0, 0, 1};
    Rgb flash{};  // of lightning: the same at 1 km from it
    Vec3 flash_m{};
    Rgb air_extinction_per_m{};
    PrecipitationKind kind = PrecipitationKind::rain;
};

// Returns the light by the picture's air and its map of light below clouds, which it refers to. A drop refracts a
// wide-angle view of its surroundings upside down (Garg and Nayar 2007): two thirds of it is sky or cloud, the rest
// ground. So drops are bright before the ground and a little dark before the sky, as observed; and their light depends on
// where they are, not on where the camera looks.
PrecipitationLight precipitation_light(const Picture& picture, const RenderOptions& options, double time_s);

// Returns Picture::air, or if there is none the air of the options' gradient.
PictureAir air_of(const Picture& picture, const RenderOptions& options);

// Returns the fraction of sunlight that reaches a point, by the picture's shadow map and veils. The map is for points
// below all clouds; points between or above them count as shaded, too.
float sunlight_at(const Picture& picture, const Vec3& place_m);

// Returns the texels of the picture's shadow map times what veils leave on the same lines of light at a height below them;
// empty: the map itself says all.
std::vector<float> shadow_with_veils(const Picture& picture, double low_m);

// Phase function of particles: the fraction kForwardFraction is Henyey-Greenstein with g = 0.85 for drops and
// 0.6 for flakes, the rest isotropic. Drops have their bows beside it (rainbow.h).
using shader::kForwardFraction;
double forward_g(PrecipitationKind kind);

// Returns the radiance of a particle, or of an opaque curtain of particles, along a unit ray; `sunlight`
// (0..1): as of sunlight_at(). Brighter against the light.
Rgb particle_radiance(const PrecipitationLight& light, const Vec3& ray, const Vec3& place_m, double sunlight);

}  // namespace nephos
