// SPDX-License-Identifier: Apache-2.0
#pragma once

// Options in the form that shaders read, and the little that is decided on the way: how bright day and dusk
// are. Private to the module.

#include "render/atmosphere/sky_light.h"
#include "render/image/picture.h"
#include "render/options/camera.h"
#include "render/options/options.h"
#include "render/shared/shared.h"

namespace nephos {

struct AirShells;

// A rectangle of the picture that is drawn at once, in pixels.
struct Tile {
    int x = 0, y = 0, width = 0, height = 0;
};

// Clouds that hide less than this have no depth (picture.h).
inline constexpr float kLeastOpacity = 1.0f / 1024.0f;

// How much of the day's light is left at a sun's elevation.
struct Daylight {
    double sun = 1;  // direct: 1 above 2 degrees, 0 below -2 (a cloud in 2 km height sees 1.4 degrees below
                     // the horizon)
    double sky =
        1;  // sky, ambient and air light: 1 above 10 degrees, 0.5 near the horizon, 0.002 at -18 (night)
};
Daylight daylight(double sun_elevation_deg);

// A frame with what is in images on the device.
struct PictureFrame : shader::Frame {
    const float* sky = nullptr;         // SkyLight::texels; null: gradient
    const float* scattering = nullptr;  // scattering_table.h, for metaballs on the processor
    const AirShells* shells = nullptr;  // likewise; null: none
};

// `flash` is null in the dark, `sky` with AirModel::gradient; the latter must outlive the frame.
PictureFrame frame_data(const RenderOptions& options, const CameraFrame& camera, const ShadowFrame& shadow,
                        const Flash* flash, const Tile& tile, const SkyLight* sky = nullptr);

// A picture with room for its pixels, without its shadow map.
Picture blank_picture(const RenderOptions& options);

// Stores the pixels of a tile: radiance with the clouds' transmittance, and the distance weighted by opacity,
// which may be null.
void store_tile(const float* radiance, const float* depth, const Tile& tile, Picture& picture);

// xyz and w as shaders take them.
inline shader::vec4 to_vec4(const Vec3& v, double w) {
    return {float(v.x), float(v.y), float(v.z), float(w)};
}

// Size in pixels of a unit at distance 1.
double pixels_per_unit(const Camera& camera, const CameraFrame& frame);

}  // namespace nephos
