// SPDX-License-Identifier: Apache-2.0
#pragma once

// Conversion of options to the uniforms of a frame, and the brightness of day and dusk. Private to the
// module.

#include "render/atmosphere/sky_light.h"
#include "render/image/picture.h"
#include "render/options/camera.h"
#include "render/options/options.h"
#include "render/shared/shared.h"

namespace nephos {

struct AirShells;
struct GroundLight;
struct MarchedScene;

// A rectangle of the image that is drawn at once, in pixels; not one of the tiles of tile_bins.h.
struct PicturePart {
    int x = 0, y = 0, width = 0, height = 0;
};

// Clouds of less opacity have no depth (picture.h).
inline constexpr float kLeastOpacity = 1.0f / 1024.0f;

// Factors of the light of day by the sun's elevation.
struct Daylight {
    // Direct light: 1 above 2 degrees, 0 below -2 (the horizon of a cloud at a height of 2 km is 1.4 degrees
    // lower).
    double sun = 1;
    // Sky, ambient and air light: 1 above 10 degrees, 0.5 near the horizon, 0.002 at -18 (night).
    double sky = 1;
};
Daylight daylight(double sun_elevation_deg);

// Returns the transmittance below which nothing is seen behind what is before it. `chord`: of the unit sphere, from the ray to
// the direction to the sun.
inline float opaque_beside_sun(const shader::FrameUniforms& frame, float chord) {
    const bool sun = frame.sun_disc.w > 0 && (chord - shader::kSunRadius) * frame.up.w < 1.0f;
    return sun ? shader::kSunOpaque : shader::kOpaque;
}

// Uniforms with pointers to the data that is in images on the device, for back-ends on the processor.
struct PictureFrame : shader::FrameUniforms {
    const float* sky = nullptr;         // SkyLight::texels; null: gradient
    const float* scattering = nullptr;  // scattering_table.h, for metaballs on the processor
    bool bows = false;                  // whether it has rows by colours
    const AirShells* shells = nullptr;  // likewise; null: none
    // Distances at which the rays of the whole picture meet ground that is not level (terrain_view.h), row by row; null: it
    // is. Nothing is drawn beyond, and no background there.
    const float* terrain = nullptr;
    const MarchedScene* endless = nullptr;  // clouds that repeat to the horizon; null: none does
    // Scattered light below clouds; null: that of open ground. Where a point relative to the eye is in it.
    const GroundLight* ground_light = nullptr;
    shader::vec4 ground_light_place{};
};

// Returns the uniforms of a frame. `flash` is null without lightning, `sky` with AirModel::gradient; the
// latter must outlive the result.
PictureFrame frame_data(const RenderOptions& options, const CameraFrame& camera, const ShadowFrame& shadow,
                        const Flash* flash, const PicturePart& part, const SkyLight* sky = nullptr);

// Returns how a point relative to the eye becomes a texel of the map: its x and y times the first two numbers plus the
// last two, counted from the middle of the first texel.
shader::vec4 ground_light_place(const GroundLight& light, const Vec3& eye_m);
// Sets what the ground of a frame receives below clouds; `light` must outlive `frame`.
void use_ground_light(const GroundLight& light, const Vec3& eye_m, PictureFrame& frame);

// Returns 1 / m: by this times the square of its distance a place on the ground's plane lies above the round Earth; 0
// without a sky, when the ground is a plane.
inline float earth_bend(const SkyLight* sky) {
    return sky == nullptr ? 0.0f : float(0.5 / (sky->model.ground_radius_m + sky->eye_altitude_m));
}

// Returns a picture with its pixels allocated, without a shadow map.
Picture blank_picture(const RenderOptions& options);

// Stores the pixels of a part: radiance with the clouds' transmittance (4 floats a pixel), and the
// opacity-weighted distance, which may be null.
void store_part(const float* radiance, const float* depth, const PicturePart& part, Picture& picture);

// Returns a shader vector.
inline shader::vec4 to_vec4(const Vec3& v, double w) {
    return {float(v.x), float(v.y), float(v.z), float(w)};
}

// Returns the size in pixels of a unit at distance 1.
double pixels_per_unit(const Camera& camera, const CameraFrame& frame);

}  // namespace nephos
