// SPDX-License-Identifier: Apache-2.0
#include "render/rain/precipitation_light.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <tbb/parallel_for.h>

#include "core/math.h"
#include "core/vec.h"
#include "render/frame/frame_data.h"
#include "render/options/phase_function.h"
#include "render/rain/rainbow.h"

namespace nephos {
namespace {

// Times pi: radiance per radiance of a white surface that faces the light; without the bows.
double lobe_phase(PrecipitationKind kind, double cosine) {
    return kForwardFraction * std::numbers::pi * henyey_greenstein(cosine, forward_g(kind)) +
           (1 - kForwardFraction) * 0.25;
}

constexpr double kSkyFraction[2] = {0.68, 0.8};  // of a drop's and a flake's light, the rest is the ground's

// The same with the bows of drops.
Rgb particle_phase(PrecipitationKind kind, double cosine) {
    const double lobe = lobe_phase(kind, cosine);
    if (kind == PrecipitationKind::snow) return {lobe, lobe, lobe};
    const Rainbow& bow = rainbow();
    const std::array<double, 3> at = bow.at(cosine);
    const double rest = (1 - bow.share) * lobe;
    return {rest + at[0], rest + at[1], rest + at[2]};
}

}  // namespace

double forward_g(PrecipitationKind kind) { return kind == PrecipitationKind::rain ? 0.85 : 0.6; }

PictureAir air_of(const Picture& picture, const RenderOptions& options) {
    if (picture.air) return *picture.air;
    const Daylight day = daylight(options.sun.elevation_deg);
    PictureAir air;
    air.extinction_per_m = options.air.extinction_per_m;
    for (std::size_t c = 0; c < 3; ++c) {
        air.sun[c] = day.sun * options.sun.colour[c];
        air.sky[c] = 0.5 * (options.air.horizon[c] + options.air.zenith[c]) * day.sky;
        for (Rgb& horizon : air.horizon) horizon[c] = day.sky * options.air.horizon[c];
    }
    return air;
}

PrecipitationLight precipitation_light(const Picture& picture, const RenderOptions& options, double time_s) {
    PrecipitationLight light;
    light.kind = options.precipitation.kind;
    light.to_sun = direction_to_sun(options.sun);
    const PictureAir air = air_of(picture, options);
    light.sun = air.sun;
    light.ground = &picture.ground_light;
    const double sky = kSkyFraction[int(light.kind)], level = std::max(light.to_sun.z, 0.0);
    for (std::size_t c = 0; c < 3; ++c) {
        const double of_all = sky + (1 - sky) * options.ground.albedo[c];
        light.by_sky[c] = of_all * air.sky[c];
        light.by_scattered_sun[c] = of_all * level * air.sun[c];
        light.by_sunlit_ground[c] = (1 - sky) * options.ground.albedo[c] * level * air.sun[c];
    }
    light.air_extinction_per_m = air.extinction_per_m;
    if (const std::optional<Flash> flash = flash_at(options.lightning, time_s)) {
        for (std::size_t c = 0; c < 3; ++c) light.flash[c] = flash->intensity * flash->colour[c];
        light.flash_m = flash->position_m;
    }
    return light;
}

namespace {

float sunlight_of_map(const Picture& picture, const Vec3& place_m) {
    if (picture.shadow.empty()) return 1.0f;
    const ShadowFrame& f = picture.shadow_frame;
    const Vec3 from = place_m - f.origin_m;
    const double size = picture.shadow_size;
    const double u = dot(from, f.u_axis_m) / dot(f.u_axis_m, f.u_axis_m) * size - 0.5;
    const double v = dot(from, f.v_axis_m) / dot(f.v_axis_m, f.v_axis_m) * size - 0.5;
    if (!(u > -1 && u < size && v > -1 && v < size)) return 1.0f;
    const int x = int(std::floor(u)), y = int(std::floor(v));
    const float fraction_x = float(u - x), fraction_y = float(v - y);
    const auto texel = [&](int column, int row) {
        if (column < 0 || row < 0 || column >= picture.shadow_size || row >= picture.shadow_size) return 1.0f;
        return picture.shadow[std::size_t(row) * std::size_t(picture.shadow_size) + std::size_t(column)];
    };
    const float above = texel(x, y) + fraction_x * (texel(x + 1, y) - texel(x, y));
    const float below = texel(x, y + 1) + fraction_x * (texel(x + 1, y + 1) - texel(x, y + 1));
    return above + fraction_y * (below - above);
}

}  // namespace

float sunlight_at(const Picture& picture, const Vec3& place_m) {
    const float left = sunlight_of_map(picture, place_m);
    return picture.sunlight_of_veils ? left * picture.sunlight_of_veils(place_m) : left;
}

std::vector<float> shadow_with_veils(const Picture& picture, double low_m) {
    constexpr double kLeastSunSine = 0.02;  // as in veil_shade.cpp
    if (!picture.sunlight_of_veils || picture.shadow.empty()) return {};
    std::vector<float> shadow = picture.shadow;
    const ShadowFrame& f = picture.shadow_frame;
    const int size = picture.shadow_size;
    const double down = std::min(f.direction.z, -kLeastSunSine);
    tbb::parallel_for(0, size, [&](int row) {
        for (int column = 0; column < size; ++column) {
            const Vec3 start =
                f.origin_m + ((column + 0.5) / size) * f.u_axis_m + ((row + 0.5) / size) * f.v_axis_m;
            shadow[std::size_t(row) * std::size_t(size) + std::size_t(column)] *=
                picture.sunlight_of_veils(start + ((low_m - start.z) / down) * f.direction);
        }
    });
    return shadow;
}

Rgb particle_radiance(const PrecipitationLight& light, const Vec3& ray, const Vec3& place_m,
                      double sunlight) {
    const Rgb sun = particle_phase(light.kind, dot(ray, light.to_sun));
    const GroundLight::Fractions below = light.ground != nullptr ? light.ground->at(Vec2(place_m)) : GroundLight::Fractions{};
    double flash = 0;
    if (light.flash[0] + light.flash[1] + light.flash[2] > 0) {
        const Vec3 way = light.flash_m - place_m;
        const double squared = std::max(dot(way, way), 1e4);
        flash = 1e6 / squared * lobe_phase(light.kind, dot(ray, (1 / std::sqrt(squared)) * way));
    }
    Rgb radiance;
    for (std::size_t c = 0; c < 3; ++c)
        radiance[c] = below.sky * light.by_sky[c] + below.sun * light.by_scattered_sun[c] +
                      sunlight * (light.by_sunlit_ground[c] + sun[c] * light.sun[c]) + flash * light.flash[c];
    return radiance;
}

}  // namespace nephos
