// SPDX-License-Identifier: Apache-2.0
#pragma once

// What a picture needs besides the density: camera, light, air, ground, output; plain data in world units.
// Colours are linear RGB (Rec. 709 primaries); radiance 1 is that of a white (Lambertian) surface that
// faces a sun of colour 1.

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/vec.h"
#include "render/options/atmosphere_options.h"
#include "render/options/camera_path.h"
#include "render/options/level_of_detail_options.h"
#include "render/options/phase_function.h"
#include "render/options/precipitation_options.h"
#include "render/options/scattering_options.h"
#include "render/options/shell_options.h"
#include "render/options/wet_ground_options.h"

namespace nephos {

using Rgb = std::array<double, 3>;

// Perspective camera. World z is up in the picture; looking straight up or down, y (north) is.
struct Camera {
    Vec3 position_m{0, -4000, 300};
    Vec3 target_m{0, 0, 1200};       // must differ from position_m
    double vertical_fov_deg = 50.0;  // 1..170
    int width = 640, height = 480;   // pixels, 1..16384
    double exposure_ev = 0.0;        // stops; the picture is multiplied by 2^ev before tone mapping
    // Where it is at which time, instead of position_m and target_m (camera_at()); empty: it stands still.
    std::vector<CameraKey> path;
    bool operator==(const Camera&) const = default;
};

struct Sun {
    double elevation_deg = 40.0;  // above the horizon, -18..90
    double azimuth_deg = 135.0;   // where the sun stands, clockwise from north
    Rgb colour{1.0, 0.96, 0.9};   // >= 0; with the physical sky that above the air
    // Instead of elevation and azimuth: day ("2026-06-21") and universal time ("18:30" or "18:30:15") at a
    // place; both texts or neither.
    std::string date, time;
    double latitude_deg = 0, longitude_deg = 0;  // -90..90, north; -180..180, east
    bool moves = false;  // with simulated time, which begins at that moment; needs a date
    bool operator==(const Sun&) const = default;
};

// Direction from the world to the sun by its elevation and azimuth; unit.
Vec3 direction_to_sun(const Sun& sun);

// The sun at a simulated time, with elevation and azimuth from its date where it has one; below -18 degrees,
// where nothing changes any more, it stays at -18. Throws Error(usage) when date and time are no moment.
Sun sun_at(const Sun& sun, double time_s);

// How the light of the sun finds its way into voxel clouds.
enum class Lighting {
    light_pass,  // D, step 1: exponential attenuation by the metaballs between a centre and the sun
    cfa,         // T's light absorption factor over blocks of voxels (voxel_absorption.h)
};

// How a cloud scatters light (D: the colour of a metaball). With the defaults a thick cloud top in the sun
// has a radiance of about 1, white at exposure 0, and its base is a bluish grey.
struct CloudLight {
    double albedo = 1.0;  // single-scattering albedo, 0..1; below 1 the whole cloud is darker
    // Forward (g > 0): brighter rims against the sun, and sunlight that reaches deeper.
    PhaseFunction phase;
    MultipleScattering multiple = MultipleScattering::diffusion;
    ScatteringOctaves octaves;
    // Strength of the sunlight that arrives after many scatterings, 0..10; it reaches far into a cloud, where
    // the direct beam does not. 0 = single scattering only, as in D: grey tops, dark bases.
    double multiple_scattering = 1.0;
    Rgb ambient_top{0.19, 0.24, 0.33};   // light from the sky that a cloud's top scatters, >= 0
    Rgb ambient_base{0.11, 0.14, 0.19};  // ... and its base; between them by height
    Lighting lighting =
        Lighting::light_pass;  // of voxel clouds; clouds drawn as billboards always have the CFA
    // T: the way in a voxel cloud of density 1 after which a light is absorbed, by the CFA; > 0, may be
    // infinite. Larger: light reaches deeper. 2 / extinction_per_m lets in as much light in all as the light
    // pass (the area below 1 - x / distance is that below exp(-extinction x)). Clouds drawn as billboards
    // have that of their model.
    double light_distance_m = 100.0;
    // Clouds of a layer drawn as billboards whose absorption is computed anew in one frame of a film because
    // the sun moved (T: 1), >= 0; 0: all of them. Each keeps the sun of the frame whose turn it was, and a
    // frame's number decides whose turn it is (seeds/light_schedule.h); clouds that are new come on top.
    int cfa_clouds_per_frame = 0;
    bool operator==(const CloudLight&) const = default;
};

struct Air {
    // Aerial perspective: beta = exp(-extinction * distance) of the light of clouds and ground arrives, >= 0;
    // the rest is the colour of the horizon.
    Rgb extinction_per_m{1.4e-5, 1.8e-5, 2.6e-5};
    Rgb horizon{0.72, 0.80, 0.90};  // >= 0
    Rgb zenith{0.18, 0.36, 0.74};   // >= 0
    bool operator==(const Air&) const = default;
};

struct Ground {
    double height_m = 0.0;         // world z of the plane
    Rgb albedo{0.12, 0.15, 0.07};  // 0..1
    bool operator==(const Ground&) const = default;
};

// A flash of lightning: it lights clouds and ground from its place. At its begin it is brightest and then
// fades as (1 - t / duration)^2; of several that burn at one moment the brightest lights the picture.
struct LightningFlash {
    Vec3 position_m{0, 0, 1000};
    double time_s = 0;           // simulated time at which it begins, >= 0
    double duration_s = 1;       // > 0
    Rgb colour{0.75, 0.8, 1.0};  // 0..1
    // Irradiance at a distance of 1 km in units of that of a sun of colour 1; falls off with the square of
    // the distance (from 100 m on). >= 0
    double intensity = 1;
    bool operator==(const LightningFlash&) const = default;
};

// The lightning of one moment.
struct Flash {
    Vec3 position_m{};
    Rgb colour{};          // as above
    double intensity = 0;  // as above, now; > 0
};

// The brightest flash that burns at a time, the first of equals; none when it is dark.
std::optional<Flash> flash_at(std::span<const LightningFlash> lightning, double time_s);

// What is drawn over the picture of T's clouds (T, figure 28).
struct DebugView {
    bool boxes = false;  // edges of the seed boxes, blue
    bool axes = false;   // axes through the clouds' centres: x red, y green, z blue
    bool roots = false;  // an arrow for each root of each seed of the base model, yellow
    bool rays = false;   // from the boxes' centres to the light, red where they are inside of boxes
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
    WetGroundOptions wet_ground;  // how it looks where it is wet or white
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
