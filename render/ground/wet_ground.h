// SPDX-License-Identifier: Apache-2.0
#pragma once

// Wet and snowy ground in a finished picture. The ground is behind everything else, so its light can be
// replaced afterwards:
//
//     beauty += transmittance * (beta * (ground now - dry ground) + reflected light)
//
// per pixel on the ground, with the picture's transmittance of the clouds and beta of the air. It is thus
// independent of air, clouds and rain in front, and one implementation on the processor serves the back-ends
// cpu and blended; vulkan has passes of its own (render/vulkan/device_ground.h), but for ground that is not
// level. Shadows on wet ground and snow are those of dry ground: all
// are lit by the light of the picture's ground of albedo 1.
//
// At a point with a film of V mm of water and W mm of water in the snow:
//
//     soaked       by 1 - exp(-V / soaking_mm) from dry to soaked_albedo()
//     under water  where noise, the depth of the hollows, lies below V: half of it at V = wet_ground.half_mm
//     white        where another noise, the height of tufts, lies below W
//
// Water reflects the mirrored view (mirror_view.h) by water_reflectance() of the angle, with the slopes of
// ripples; ripples too small for a pixel are roughness instead. Wet soil reflects weakly and much blurred.
// Internal to this source tree.

#include <optional>

#include "render/atmosphere/sky_light.h"
#include "render/cloud/splats.h"
#include "render/ground/mirror_view.h"
#include "render/image/picture.h"
#include "render/options/options.h"
#include "render/shared/ground.h"

namespace nephos {

// Reflectance of water at normal incidence, ((n - 1) / (n + 1))^2 with n = 1.333.
inline constexpr float kWaterNormalReflectance = shader::kWaterFromAbove;
inline constexpr float kFilmSpread = shader::kFilmDeviations;

// Returns the Fresnel reflectance of water with a variance of slopes at a cosine of the angle of view from
// above, averaged over the visible slopes: Bruneton, Neyret and Holzschuch 2010, section 5; Schlick's for
// variance 0.
double water_reflectance(double cosine, double slope_variance);

// Returns the albedo of soaked ground for light that has passed the surface of its film: outgoing light is
// reflected back down with the probability p = 1 - (1 - 0.066) / n^2, which gives (1 - p) a / (1 - p a) for
// the dry albedo a. Lekner and Dorf 1988, with Angstrom's absorption.
double soaked_albedo(double dry_albedo);
double soaked_back_reflectance();  // p

// Returns true when ground is in view and is country (country.h) or water (water.h), which draw_wet_ground() draws, too.
bool shows_pattern(const RenderOptions& options);
// Returns true when water or snow and ground are in view.
bool shows_wet_ground(const RenderOptions& options, const GroundCoverView& cover);
// Returns true for either.
inline bool shows_ground(const RenderOptions& options, const GroundCoverView& cover) {
    return shows_wet_ground(options, cover) || shows_pattern(options);
}
// Returns the cover of a scene's ground; none where it is dry.
const GroundCoverView& cover_of(const Splats& splats);
// Returns true when reflections need a mirrored view.
bool shows_reflections(const RenderOptions& options, const GroundCoverView& cover);

// Returns the mean albedo of the ground that is not water, with the snow on it: what lights falling snow from below.
Rgb mean_albedo(const RenderOptions& options, const GroundCoverView& cover);

struct GroundLight;
struct MarchedScene;

struct WetGround {
    const RenderOptions& options;
    const GroundCoverView& cover;
    const Flash* flash = nullptr;        // null without lightning
    double time_s = 0;                   // of the ripples
    const MirrorView* mirror = nullptr;  // null: no reflections
    const float* shadow = nullptr;       // shadow map, valid on visible ground
    int shadow_size = 0;
    const SkyLight* sky = nullptr;  // of the picture; null: gradient
    const MarchedScene* endless = nullptr;  // as PictureFrame::endless
    const GroundLight* light = nullptr;     // below clouds; null: as without
};

// Replaces the light of level ground, rows in parallel; the result does not depend on the number of threads.
void draw_wet_ground(const WetGround& ground, Picture& picture);

// Throws Error(usage) naming the first value that is not as a GroundCoverView wants it.
void check(const GroundCoverView& cover);

}  // namespace nephos
