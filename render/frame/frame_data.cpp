// SPDX-License-Identifier: Apache-2.0
#include "render/frame/frame_data.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <tbb/parallel_for.h>

#include "core/math.h"
#include "core/vec.h"
#include "render/cloud/cloud_preparation.h"
#include "render/image/ground_light.h"

namespace nephos {
namespace {

shader::vec4 scaled_colour(const Rgb& c, double scale, double w) {
    return {float(scale * c[0]), float(scale * c[1]), float(scale * c[2]), float(w)};
}

// Rows of the map from a point relative to the eye to a shadow map coordinate 0..1.
shader::vec4 shadow_row(const Vec3& axis, const ShadowFrame& shadow, const Vec3& eye) {
    const Vec3 row = (1.0 / dot(axis, axis)) * axis;
    return to_vec4(row, dot(row, eye - shadow.origin_m));
}

// Replaces the gradient's values by those of the physical sky.
void use_sky(const RenderOptions& options, const SkyLight& sky, PictureFrame& frame) {
    const AtmosphereModel& air = sky.model;
    frame.sky = sky.texels.data();
    frame.sunlight = scaled_colour(sky.ground_sun, 1.0, 0);
    frame.ambient_top = scaled_colour(sky.ambient_top, 1.0, frame.ambient_top.w);
    frame.ambient_base = scaled_colour(sky.ambient_base, 1.0, 0);
    frame.rayleigh = scaled_colour(air.rayleigh_per_m, 1.0, 1.0 / air.rayleigh_height_m);
    const double haze = air.mie_extinction_per_m;
    frame.haze = scaled_colour(Rgb{haze, haze, haze}, 1.0, 1.0 / air.mie_height_m);
    frame.air = {float(sky.eye_altitude_m), float(air.mie_g),
                 haze > 0 ? float(air.mie_scattering_per_m / haze) : 0.0f, 1.0f};
    const double radius = air.ground_radius_m + sky.eye_altitude_m,
                 across = sky.eye_altitude_m * (air.ground_radius_m + radius) / radius;
    frame.earth = {-float(std::sqrt(across / radius)), float(across), earth_bend(&sky), 0};
    frame.sun_disc = scaled_colour(sky.disc, 1.0, sky.has_disc ? 1.0 : 0.0);
    frame.sun_fade = scaled_colour(sky.disc_fade, 1.0, 0.0);
    const double sine = std::max(0.0, direction_to_sun(options.sun).z);
    Rgb skylit{}, sunlit{};
    for (std::size_t c = 0; c < 3; ++c) {
        skylit[c] = options.ground.albedo[c] * sky.ground_sky[c];
        sunlit[c] = options.ground.albedo[c] * sky.ground_sun[c] * sine;
    }
    frame.ground = scaled_colour(skylit, 1.0, frame.ground.w);
    frame.ground_sun = scaled_colour(sunlit, 1.0, frame.ground_sun.w);
}

}  // namespace

Daylight daylight(double sun_elevation_deg) {
    const double below = std::max(0.0, 10.0 - sun_elevation_deg);
    return {smoothstep(-2, 2, sun_elevation_deg), std::exp(-0.0079 * below * below)};
}

Picture blank_picture(const RenderOptions& options) {
    Picture picture;
    picture.width = options.camera.width;
    picture.height = options.camera.height;
    picture.beauty.resize(3 * picture.pixels());
    picture.transmittance.resize(picture.pixels());
    picture.depth_m.resize(picture.pixels());
    picture.shadow_size = options.shadow_map_size;
    return picture;
}

double pixels_per_unit(const Camera& camera, const CameraFrame& frame) {
    return camera.height / (2.0 * frame.half_height);
}

PictureFrame frame_data(const RenderOptions& options, const CameraFrame& camera, const ShadowFrame& shadow,
                        const Flash* flash, const PicturePart& part, const SkyLight* sky) {
    const Vec3 to_sun = direction_to_sun(options.sun);
    const Daylight day = daylight(options.sun.elevation_deg);
    const CloudLight& light = options.light;
    const double width = options.camera.width, height = options.camera.height;
    const Vec3& eye = camera.position_m;

    PictureFrame frame;
    frame.right = to_vec4(camera.half_width * camera.right, 0);
    frame.up = to_vec4(camera.half_height * camera.up, pixels_per_unit(options.camera, camera));
    frame.forward = to_vec4(camera.forward, 0);
    frame.picture = {float(width), float(height), float(part.x), float(part.y)};
    // -1..1 across the picture to -1..1 across the part.
    frame.part = {float(width / part.width), float(height / part.height),
                  float((width - 2.0 * part.x - part.width) / part.width),
                  float((height - 2.0 * part.y - part.height) / part.height)};
    frame.to_sun = to_vec4(to_sun, 0);
    frame.sunlight = scaled_colour(options.sun.colour, day.sun, 0);
    frame.ambient_top = scaled_colour(light.ambient_top, day.sky, light.albedo);
    frame.ambient_base = scaled_colour(light.ambient_base, day.sky, 0);
    frame.air_extinction = scaled_colour(options.air.extinction_per_m, 1.0, 0);
    frame.horizon = scaled_colour(options.air.horizon, day.sky, options.light_shafts.sun_share);
    frame.zenith = scaled_colour(options.air.zenith, day.sky, options.light_shafts.g);

    // The open sky lights the ground with about the mean of its two colours; radiance of a white surface in
    // it is that.
    Rgb skylit{}, sunlit{};
    for (std::size_t c = 0; c < 3; ++c) {
        skylit[c] =
            options.ground.albedo[c] * 0.5 * (options.air.horizon[c] + options.air.zenith[c]) * day.sky;
        sunlit[c] = options.ground.albedo[c] * options.sun.colour[c] * day.sun * std::max(0.0, to_sun.z);
    }
    const bool has_ground = eye.z > options.ground.height_m;
    frame.ground = scaled_colour(skylit, 1.0, options.ground.height_m - eye.z);
    frame.ground_sun = scaled_colour(sunlit, 1.0, has_ground ? 1.0 : 0.0);
    frame.earth = {0, -2 * frame.ground.w, 0, 0};  // a plane
    frame.shadow_u = shadow_row(shadow.u_axis_m, shadow, eye);
    frame.shadow_v = shadow_row(shadow.v_axis_m, shadow, eye);
    if (flash != nullptr) {
        Rgb lit{};
        for (std::size_t c = 0; c < 3; ++c) lit[c] = options.ground.albedo[c] * flash->colour[c];
        frame.flash = to_vec4(flash->position_m - eye, flash->intensity);
        frame.flash_colour = scaled_colour(flash->colour, 1.0, 0);
        frame.ground_flash = scaled_colour(lit, flash->intensity, 0);
    }
    if (sky != nullptr) use_sky(options, *sky, frame);
    return frame;
}

shader::vec4 ground_light_place(const GroundLight& light, const Vec3& eye_m) {
    const Vec2 at_eye = (Vec2(eye_m) - light.corner_m) / light.texel_m - 0.5;
    return {float(1 / light.texel_m.x), float(1 / light.texel_m.y), float(at_eye.x), float(at_eye.y)};
}

void use_ground_light(const GroundLight& light, const Vec3& eye_m, PictureFrame& frame) {
    frame.ground_light = light.words.empty() ? nullptr : &light;
    frame.ground_light_place = ground_light_place(light, eye_m);
}

void store_part(const float* radiance, const float* depth, const PicturePart& part, Picture& picture) {
    tbb::parallel_for(0, part.height, [&](int y) {
        std::size_t to = std::size_t(part.y + y) * std::size_t(picture.width) + std::size_t(part.x);
        std::size_t from = std::size_t(y) * std::size_t(part.width);
        for (int x = 0; x < part.width; ++x, ++to, ++from) {
            std::copy_n(radiance + 4 * from, 3, &picture.beauty[3 * to]);
            const float transmittance = radiance[4 * from + 3];
            picture.transmittance[to] = transmittance;
            const float opacity = 1.0f - transmittance;
            picture.depth_m[to] = depth != nullptr && opacity >= kLeastOpacity
                                      ? depth[from] / opacity
                                      : std::numeric_limits<float>::infinity();
        }
    });
}

}  // namespace nephos
