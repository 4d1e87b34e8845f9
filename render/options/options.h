// SPDX-License-Identifier: Apache-2.0
#pragma once

// Options of rendering (D, T, S, P: docs/sources.md): camera, light, air, ground, precipitation; plain data
// in world units. Colours are linear RGB (Rec. 709 primaries); radiance 1 is that of a white (Lambertian)
// surface that faces a sun of colour 1.

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/vec.h"
#include "render/options/atmosphere_options.h"
#include "render/options/phase_function.h"
#include "render/options/precipitation_options.h"
#include "render/options/shell_options.h"
#include "render/options/terrain_options.h"

namespace nephos {

using Rgb = std::array<double, 3>;

// A key frame of a camera that moves.
struct CameraKey {
    double time_s = 0;  // simulated; keys rise strictly
    Vec3 position_m{0, -4000, 300};
    Vec3 target_m{0, 0, 1200};  // differs from position_m
    bool operator==(const CameraKey&) const = default;
};

// How a picture's exposure is found.
enum class Exposure {
    manual,     // Camera::exposure_ev
    automatic,  // metered in the picture (render/image/exposure.h), plus Camera::exposure_ev
};

// The curve from radiance to what a screen shows.
enum class ToneCurve {
    exponential,  // each channel on its own: the identity up to 0.5, then an exponential shoulder
    neutral,      // keeps hue: the channels are compressed together from 0.6 on (after Khronos PBR Neutral)
};

// A perspective camera. World z is up in the image; y (north) is when it looks straight up or down.
struct Camera {
    Vec3 position_m{0, -4000, 300};
    Vec3 target_m{0, 0, 1200};       // must differ from position_m
    double vertical_fov_deg = 50.0;  // 1..170
    int width = 640, height = 480;   // pixels, 1..16384
    double exposure_ev = 0.0;        // stops; radiance is multiplied by 2^ev before tone mapping
    Exposure exposure = Exposure::manual;
    // Time constant with which an automatic exposure follows from frame to frame of a run, seconds of film,
    // 0..60; 0: each frame has its own.
    double adaptation_s = 0;
    ToneCurve tone_curve = ToneCurve::exponential;
    // Light that the camera scatters around bright things (render/image/glare.h), relative to the human eye,
    // 0..1. 0: none, and the sun's disc is bounded to a radiance of 6; otherwise it is as bright as it is.
    double glare = 0;
    // Key frames that replace position_m and target_m (camera_at()); empty: a static camera.
    std::vector<CameraKey> path;
    // True: the z of position_m, target_m and of those of the path are above the ground below them (standing_camera()).
    bool above_ground = false;
    bool operator==(const Camera&) const = default;
};

struct Sun {
    double elevation_deg = 40.0;  // above the horizon, -18..90
    double azimuth_deg = 135.0;   // direction of the sun, clockwise from north
    Rgb colour{1.0, 0.96, 0.9};   // >= 0; with the physical sky the colour above the air
    // Day ("2026-06-21") and universal time ("18:30" or "18:30:15"), which with latitude and longitude
    // replace elevation and azimuth; both texts or neither.
    std::string date, time;
    double latitude_deg = 0, longitude_deg = 0;  // -90..90, north; -180..180, east
    bool moves = false;  // follows simulated time, which begins at date and time; needs a date
    bool operator==(const Sun&) const = default;
};

// Returns the unit vector towards the sun by its elevation and azimuth. Pure.
Vec3 direction_to_sun(const Sun& sun);

// Returns the sun at a simulated time, with elevation and azimuth computed from its date if it has one and
// the elevation clamped to -18 degrees, the end of twilight. Throws Error(usage) when date or time are
// invalid.
Sun sun_at(const Sun& sun, double time_s);

// The method of sunlight's attenuation in voxel clouds.
enum class Lighting {
    light_pass,  // D, step 1: exponential attenuation by the metaballs between a centre and the sun
    cfa,         // T's light absorption factor over blocks of voxels (voxel_absorption.h)
};

// The approximation of multiply scattered sunlight.
enum class MultipleScattering {
    // One isotropic term that decays with the optical depth tau towards the sun like diffusion through a
    // slab: 1 / (1 + 1.5 (1 - mean cosine) tau). It reaches deepest.
    diffusion,
    // Octaves of the direct light, each weaker, less attenuated and more isotropic than the one before.
    octaves,
};

// Wrenninge, Kulla and Lundqvist 2013, "Oz: The Great and Volumetric": the light scattered towards the eye is
//     sum over o = 0 .. count-1 of scattering^o exp(-extinction^o tau) p(theta, directed by asymmetry^o)
// Octave 0 is single scattering and exact; the others approximate longer and longer paths.
struct ScatteringOctaves {
    int count = 8;             // 1..8; 1 = single scattering
    double scattering = 0.65;  // 0..1: larger is brighter
    double extinction = 0.5;   // 0..1: smaller reaches deeper
    double asymmetry = 0.6;    // 0..1: smaller is more isotropic
    bool operator==(const ScatteringOctaves&) const = default;
};

// Scattering of light in clouds (D: the colour of a metaball). With the defaults a thick cloud top in the sun
// has a radiance of about 1, white at exposure 0, and its base is a bluish grey.
struct CloudLight {
    double albedo = 1.0;  // single-scattering albedo, 0..1; below 1 the whole cloud is darker
    // Forward scattering (g > 0) gives brighter rims against the sun and deeper penetration of sunlight.
    PhaseFunction phase;
    // Fogbow and glory in sunlight that clouds and fog scatter once, 0..1: 1 is Mie's solution for droplets of
    // phase.droplet_diameter_um behind the sun's back, whatever the phase function (droplet_phase.h); 0 none.
    double bows = 0;
    double droplet_variance = 0.05;  // effective variance of their radii, 0.01..0.3; smaller: more rings
    MultipleScattering multiple = MultipleScattering::diffusion;
    ScatteringOctaves octaves;
    // Strength of multiply scattered sunlight, 0..10, which reaches deeper into a cloud than the direct beam.
    // 0 = single scattering only, as in D: grey tops, dark bases.
    double multiple_scattering = 1.0;
    Rgb ambient_top{0.19, 0.24, 0.33};   // light from the sky that a cloud's top scatters, >= 0
    Rgb ambient_base{0.11, 0.14, 0.19};  // the same for its base; linear in height between them
    Lighting lighting =
        Lighting::light_pass;  // of voxel clouds; clouds drawn as billboards always have the CFA
    // Path length in a voxel cloud of density 1 after which the CFA (T) has absorbed a light, > 0, may be
    // infinite. Larger: light reaches deeper. 2 / extinction_per_m admits as much light in total as the light
    // pass (the areas below 1 - x / distance and exp(-extinction x) are equal). Clouds drawn as billboards
    // have the distance of their base model.
    double light_distance_m = 100.0;
    // Number of billboard clouds of a layer whose absorption is updated per frame of a film for a moving sun
    // (T: 1), >= 0; 0: all of them. The schedule depends on the frame's number alone
    // (seeds/light_schedule.h); new clouds are computed in addition.
    int cfa_clouds_per_frame = 0;
    bool operator==(const CloudLight&) const = default;
};

struct Air {
    // Extinction of aerial perspective, >= 0: the fraction beta = exp(-extinction * distance) of the light of
    // clouds and ground arrives, and (1 - beta) * horizon is added.
    Rgb extinction_per_m{1.4e-5, 1.8e-5, 2.6e-5};
    Rgb horizon{0.72, 0.80, 0.90};  // >= 0
    Rgb zenith{0.18, 0.36, 0.74};   // >= 0
    bool operator==(const Air&) const = default;
};

enum class GroundPattern {
    plain,    // one albedo
    country,  // fields, hedges and woods of noise, with that albedo in the mean (render/ground/country.h)
    water,    // a sea with waves, which mirrors the sky (render/ground/water.h); the albedo is that below its surface
};

struct Ground {
    double height_m = 0.0;  // world z of the plane; under the physical sky of the sphere below the eye
    Rgb albedo{0.12, 0.15, 0.07};  // 0..1
    GroundPattern pattern = GroundPattern::plain;
    double field_m = 260;  // size of a field of the country, 20..5000 m
    bool operator==(const Ground&) const = default;
};

// Waves of a ground of water.
struct WaterOptions {
    double wind_m_per_s = 6;    // 10 m above it, 0..25; 0: a still mirror
    double from_deg = 270;      // whence it blows, clockwise from north, 0..360
    double whitecaps = 1;       // cover of foam as a multiple of that which belongs to the wind, 0..10
    bool operator==(const WaterOptions&) const = default;
};

// Options of the appearance of wet and snowy ground; a GroundCoverView has the amounts
// (render/cloud/splats.h).
struct WetGroundOptions {
    // Film at which soil has darkened by 1 - 1/e of the difference between dry and soaked, mm, > 0.
    double soaking_mm = 0.25;
    // Film at which puddles cover half of the ground, mm, > 0: larger means fewer puddles.
    double puddle_film_mm = 2.0;
    double puddle_size_m = 5.0;  // size of the largest puddles, 0.1..1000
    // Strength of reflections, 0..1; 0: none, and no mirrored view is rendered.
    double reflection = 1.0;
    double reflection_scale = 0.5;  // resolution of that second view relative to the picture, 0.1..1
    // Reflectance of wet ground that is not under water, relative to still water, 0..1.
    double sheen = 0.25;
    double ripples = 1.0;        // height of the rings that drops make, 0..10; 0: still water
    double snow_cover_mm = 2.0;  // snow, in mm of water, that covers half of the ground, > 0
    std::array<double, 3> snow_albedo{0.86, 0.88, 0.90};  // 0..1
    bool operator==(const WetGroundOptions&) const = default;
};

// When voxels are drawn together as one larger metaball (render/cloud/level_of_detail.h).
struct LevelOfDetailOptions {
    // Projected radius in pixels, 0..1000, at which the metaballs of a block of 2 x 2 x 2 voxels are merged
    // if their optical depths differ by less than 1; at n times that radius they must differ by n^2 times
    // less. Larger is faster and softer; 0: no merging.
    double pixels = 2.5;
    bool operator==(const LevelOfDetailOptions&) const = default;
};

// A flash of lightning: a point light for clouds and ground. Its intensity is greatest at its begin and fades
// as (1 - t / duration)^2; of several simultaneous ones the brightest is used.
struct LightningFlash {
    Vec3 position_m{0, 0, 1000};
    double time_s = 0;           // simulated time at which it begins, >= 0
    double duration_s = 1;       // > 0
    Rgb colour{0.75, 0.8, 1.0};  // 0..1
    // Irradiance at a distance of 1 km, relative to a sun of colour 1, >= 0; falls off with the square of the
    // distance beyond 100 m.
    double intensity = 1;
    bool operator==(const LightningFlash&) const = default;
};

// The light of a flash at one time.
struct Flash {
    Vec3 position_m{};
    Rgb colour{};          // as above
    double intensity = 0;  // as above, now; > 0
};

// Returns the brightest flash at a time, the first of equals; nullopt if there is none. Pure.
std::optional<Flash> flash_at(std::span<const LightningFlash> lightning, double time_s);

// Line overlays on images of T's clouds, for debugging (T, figure 28).
struct DebugView {
    bool boxes = false;  // edges of the seed boxes, blue
    bool axes = false;   // axes through the clouds' centres: x red, y green, z blue
    bool roots = false;  // an arrow for each root of each seed of the base model, blue
    bool rays = false;   // from the boxes' centres to the light, yellow, red inside boxes
    bool any() const { return boxes || axes || roots || rays; }
    bool operator==(const DebugView&) const = default;
};

struct RenderOptions {
    Camera camera;
    Sun sun;
    CloudLight light;
    Air air;
    AtmosphereOptions atmosphere;
    Ground ground;
    TerrainOptions terrain;       // of ground that is not level
    WaterOptions water;           // where the ground is water
    WetGroundOptions wet_ground;  // appearance of wet and snowy ground
    Shells shells;
    LightShafts light_shafts;
    Fog fog;
    int shadow_map_size = 1024;  // texels on a side, 16..8192
    std::vector<LightningFlash> lightning;
    PrecipitationOptions precipitation;
    LevelOfDetailOptions level_of_detail;
    DebugView debug_view;
    bool operator==(const RenderOptions&) const = default;
};

// Throws Error(usage) naming the first value that is out of its range.
void check(const RenderOptions& options);

}  // namespace nephos
