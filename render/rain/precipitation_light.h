// SPDX-License-Identifier: Apache-2.0
#pragma once

// Light that rain and snow send to the eye. Private to the module.

#include "render/image/picture.h"
#include "render/options/camera.h"
#include "render/options/options.h"

namespace nephos {

// What lights the particles of one picture.
struct PrecipitationLight {
    Rgb surroundings{};  // mean radiance of what a particle shows: sky and clouds, and ground
    Rgb sun{};           // radiance of a white surface that faces the sun, without clouds
    Vec3 to_sun{0, 0, 1};
    Rgb flash{};  // of lightning: the same at 1 km from it
    Vec3 flash_m{};
    Rgb air_extinction_per_m{};
    PrecipitationKind kind = PrecipitationKind::rain;
};

// The surroundings are taken from the picture itself, before any rain is in it: a drop refracts light of a
// wide angle, upside down (Garg and Nayar 2007), and shows whatever sky, clouds and ground there are. Sky and
// ground count by shares that make drops bright before the ground and a little dark before the sky, as
// seen; where the picture shows little of one of them, the sky of the options and the ground in its light
// step in.
PrecipitationLight precipitation_light(const Picture& picture, const RenderOptions& options,
                                       const CameraFrame& camera, double time_s);

// That of the picture, or where it has none of the options' gradient.
PictureAir air_of(const Picture& picture, const RenderOptions& options);

// The share of the sunlight that reaches a place past the clouds: the picture's shadow map, which holds what
// is in front of all of it; places above the clouds' shadow are taken to be in it, too.
float sunlight_at(const Picture& picture, const Vec3& place_m);

// Drops scatter forward (Henyey and Greenstein 1941) with g = 0.85, flakes with 0.6: kForwardShare of the
// light, and the rest evenly.
inline constexpr double kForwardShare = 0.8;
double forward_g(PrecipitationKind kind);

// Radiance of a particle (or of a thick curtain of them) seen along a unit ray, at a place that `sunlight`
// (0..1) of the sun reaches: brighter against the light.
Rgb particle_radiance(const PrecipitationLight& light, const Vec3& ray, const Vec3& place_m, double sunlight);

}  // namespace nephos
