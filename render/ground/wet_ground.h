// SPDX-License-Identifier: Apache-2.0
#pragma once

// Wet and snowy ground in a finished picture. The ground lies behind everything else, so what it looks like
// can be exchanged afterwards:
//
//     beauty += transmittance * (beta * (ground now - dry ground) + reflected light)
//
// per pixel that sees ground, with the picture's own transmittance of the clouds and beta of the air. One
// code on the processor thus serves all ways of drawing, which agree as well as they did before; and what is
// in front (air, clouds, rain) needs to know nothing of it. The sun's shadow lies on wet ground and on snow
// as on dry ground: all are lit by the light of the picture's ground, of albedo 1.
//
// At a point with a film of V mm of water and W mm of water in the snow:
//
//     soaked       by 1 - exp(-V / soaking_mm) from dry to soaked_albedo()
//     under water  where noise, the depth of the hollows, lies below V: covered_share() on the average
//     white        where another noise, the height of tufts, lies below W
//
// Water reflects the mirrored view (mirror_view.h) by water_reflectance() of its angle, with the slopes of
// ripples; where these are too small for a pixel they make the surface rough instead. Wet soil does the same
// weakly and much blurred. Private to the module.

#include <optional>

#include "render/atmosphere/sky_light.h"
#include "render/cloud/ground_cover_view.h"
#include "render/ground/mirror_view.h"
#include "render/image/picture.h"
#include "render/options/options.h"

namespace nephos {

// Of water at normal incidence, ((n - 1) / (n + 1))^2 with n = 1.333.
inline constexpr float kWaterNormalReflectance = 0.0204f;
inline constexpr float kFilmSpread = 0.6f;  // of the logarithm of the hollows' depths: standard deviation

// Fresnel reflectance of water whose slopes have this variance, seen at this cosine from above, averaged over
// the slopes that can be seen: Bruneton, Neyret and Holzschuch 2010, section 5; Schlick's for variance 0.
double water_reflectance(double cosine, double slope_variance);

// Light that soaked ground scatters, of what gets through the surface of its film: light on its way out is
// reflected back down with the probability p = 1 - (1 - 0.066) / n^2 and gets another chance to be absorbed,
// (1 - p) a / (1 - p a) for the dry albedo a. Lekner and Dorf 1988, with Angstrom's absorption.
double soaked_albedo(double dry_albedo);

// Share of level ground below a film, half of which is below `half_mm`.
double covered_share(double film_mm, double half_mm);

// Whether there is anything to draw: water, snow, and ground in view.
bool shows_wet_ground(const RenderOptions& options, const GroundCoverView& cover);
// Whether it needs a mirrored view.
bool shows_reflections(const RenderOptions& options, const GroundCoverView& cover);

struct WetGround {
    const RenderOptions& options;
    const GroundCoverView& cover;
    const Flash* flash = nullptr;        // null in the dark
    double time_s = 0;                   // of the ripples
    const MirrorView* mirror = nullptr;  // null: no reflections
    const float* shadow = nullptr;       // the map that the ground wears, known where the picture shows it
    int shadow_size = 0;
    const SkyLight* sky = nullptr;  // of the picture; null: gradient
};

// Rows in parallel; the result does not depend on the number of threads.
void draw_wet_ground(const WetGround& ground, Picture& picture);

// Throws Error(usage) naming the first value that is not as ground_cover_view.h wants it.
void check(const GroundCoverView& cover);

}  // namespace nephos
