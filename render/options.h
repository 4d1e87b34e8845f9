// SPDX-License-Identifier: Apache-2.0
#pragma once

// What a picture needs besides the density: camera, light, air, ground, output; plain data in world units.
// Colours are linear RGB (Rec. 709 primaries); radiance 1 is that of a white (Lambertian) surface that
// faces a sun of colour 1.

#include <array>
#include <string>

#include "automaton/lattice.h"

namespace nephos {

using Rgb = std::array<double, 3>;

// Perspective camera. World z is up in the picture; looking straight up or down, y (north) is.
struct Camera {
    Vec3 position_m{0, -4000, 300};
    Vec3 target_m{0, 0, 1200};       // must differ from position_m
    double vertical_fov_deg = 50.0;  // 1..170
    int width = 640, height = 480;   // pixels, 1..16384
    double exposure_ev = 0.0;        // stops; the picture is multiplied by 2^ev before tone mapping
    bool operator==(const Camera&) const = default;
};

struct Sun {
    double elevation_deg = 40.0;  // above the horizon, -18..90
    double azimuth_deg = 135.0;   // where the sun stands, clockwise from north
    Rgb colour{1.0, 0.96, 0.9};   // >= 0
    bool operator==(const Sun&) const = default;
};

// How a cloud scatters light (D: the colour of a metaball). With the defaults a thick cloud top in the sun
// has a radiance of about 1, white at exposure 0, and its base is a bluish grey.
struct CloudLight {
    double albedo = 1.0;  // single-scattering albedo, 0..1; below 1 the whole cloud is darker
    // Henyey-Greenstein asymmetry, -0.99..0.99. Forward is > 0: brighter rims against the sun, and sunlight
    // that reaches deeper.
    double g = 0.5;
    // Strength of the sunlight that arrives after many scatterings, 0..10; it reaches far into a cloud, where
    // the direct beam does not. 0 = single scattering only, as in D: grey tops, dark bases.
    double multiple_scattering = 1.0;
    Rgb ambient_top{0.19, 0.24, 0.33};   // light from the sky that a cloud's top scatters, >= 0
    Rgb ambient_base{0.11, 0.14, 0.19};  // ... and its base; between them by height
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

struct RenderOptions {
    Camera camera;
    Sun sun;
    CloudLight light;
    Air air;
    Ground ground;
    int shadow_map_size = 1024;  // texels on a side, 16..8192
    bool operator==(const RenderOptions&) const = default;
};

// Throws Error(usage) naming the first value that is out of its range.
void check(const RenderOptions& options);

}  // namespace nephos
