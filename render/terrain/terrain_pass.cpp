// SPDX-License-Identifier: Apache-2.0
#include "render/terrain/terrain_pass.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include <tbb/parallel_for.h>

#include "render/frame/frame_data.h"
#include "render/ground/ground_pass.h"
#include "render/terrain/terrain_rows.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/terrain/terrain_pass.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/highway.h>

#include "render/ground/country-inl.h"
#include "render/ground/cover-inl.h"
#include "render/ground/ground_pass-inl.h"
#include "render/ground/ripples-inl.h"

#ifndef NEPHOS_TERRAIN_SURFACES
#define NEPHOS_TERRAIN_SURFACES
namespace nephos {

// What all pixels share beside the pass over level ground.
struct TerrainPass {
    GroundPass ground;
    std::vector<NoiseOctave> relief, patches, strata;
    float relief_m = 0;  // standard deviation of the heights below the map's grid
    float rock_slope = 1, snow_line_m = 0;
    shader::vec4 rock{};
    float cloud_base_m = 0, per_cloud = 1;  // world; 1 / thickness
    bool covered = false;                   // water or snow lies somewhere
    float bounce[3] = {};                   // light that level ground around a place sends back
};

}  // namespace nephos
#endif

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// A vector of pixels on the terrain.
struct TerrainSpot {
    Floats3 ray, point, normal;
    Floats distance, z_m, pixel_m, steepness, sun, sky, shelter, gathers, pond_m;
};

HWY_INLINE TerrainSpot spot_at(const TerrainRow& row, std::size_t x) {
    const Lanes d;
    const auto load = [&](const std::vector<float>& of) { return hn::LoadU(d, &of[x]); };
    TerrainSpot spot;
    spot.distance = load(row.distance_m);
    const Floats near = hn::IfThenElse(hn::Lt(spot.distance, set(kNowhere)), spot.distance, set(1.0f));
    spot.ray = {load(row.ray_x), load(row.ray_y), load(row.ray_z)};
    spot.point = times(near, spot.ray);
    spot.distance = near;
    spot.z_m = load(row.z_m);
    spot.pixel_m = load(row.pixel_m);
    spot.sun = load(row.sun);
    spot.sky = load(row.sky);
    spot.shelter = load(row.shelter);
    spot.gathers = load(row.gathers);
    spot.pond_m = load(row.pond_m);
    return spot;
}

// Sets the normal: the map's slopes, and those of noise below its grid as far as a pixel resolves them.
HWY_INLINE void tilt(const TerrainPass& pass, Floats slope_x, Floats slope_y, TerrainSpot& spot) {
    const Floats one = set(1.0f);
    const Floats steep = hn::Sqrt(hn::MulAdd(slope_x, slope_x, hn::Mul(slope_y, slope_y)));
    spot.steepness = steep;
    const Floats step = hn::Max(spot.pixel_m, set(0.02f));
    const auto height = [&](const Floats3& at) { return resolved_noise(pass.relief, at, spot.pixel_m).value; };
    const Floats here = height(spot.point);
    const Floats east = height({hn::Add(spot.point.x, step), spot.point.y, spot.point.z}),
                 north = height({spot.point.x, hn::Add(spot.point.y, step), spot.point.z});
    // Steep ground is rough.
    const Floats rough = hn::Mul(set(pass.relief_m), hn::Min(hn::MulAdd(set(1.6f), steep, set(0.25f)), set(1.6f)));
    const Floats x = hn::MulAdd(rough, hn::Div(hn::Sub(east, here), step), slope_x),
                 y = hn::MulAdd(rough, hn::Div(hn::Sub(north, here), step), slope_y);
    const Floats per = hn::Div(one, hn::Sqrt(hn::MulAdd(x, x, hn::MulAdd(y, y, one))));
    spot.normal = {hn::Neg(hn::Mul(x, per)), hn::Neg(hn::Mul(y, per)), per};
}

// Albedo of dry ground: soil and plants, rock, snow that lies all year.
HWY_INLINE Floats3 dry_albedo(const TerrainPass& pass, const TerrainSpot& spot) {
    const Lanes d;
    const Floats zero = hn::Zero(d), one = set(1.0f);
    Floats3 albedo = set3(pass.ground.dry);
    const Floats patches = resolved_noise(pass.patches, spot.point, spot.pixel_m).value;
    if (pass.ground.country.enabled) {
        const Footprint print{spot.pixel_m, zero, zero, spot.pixel_m, spot.pixel_m};
        albedo = each_times(albedo, country_albedo(pass.ground.country, spot.point, print));
    } else {
        albedo = times(hn::Max(hn::MulAdd(set(0.12f), patches, one), set(0.5f)), albedo);
    }
    const Floats uneven = hn::MulAdd(set(0.13f), patches, spot.steepness);
    const Floats rocky = smooth_step(set(0.72f * pass.rock_slope), set(1.18f * pass.rock_slope), uneven);
    // Beds of rock: noise that changes with height.
    const Floats3 beds{hn::MulAdd(set(0.22f), spot.point.x, spot.z_m), hn::Mul(set(0.05f), spot.point.y), zero};
    const Floats tone = hn::MulAdd(set(0.14f), resolved_noise(pass.strata, beds, spot.pixel_m).value,
                                   hn::MulAdd(set(0.08f), patches, one));
    albedo = mix(albedo, times(hn::Max(tone, set(0.4f)), set3(pass.rock)), {rocky, rocky, rocky});
    if (!(pass.snow_line_m < kNowhere)) return albedo;
    constexpr float kPerMetre = 1.0f / 220.0f;
    Floats more = hn::Mul(hn::Sub(spot.z_m, set(pass.snow_line_m)), set(kPerMetre));
    more = hn::MulAdd(set(1.7f), hn::Max(hn::Min(spot.shelter, set(0.5f)), set(-0.3f)), more);
    more = hn::MulAdd(set(0.45f), patches, more);
    // North of the mountain the sun melts less.
    more = hn::MulAdd(set(0.8f), spot.normal.y, more);
    const Floats clings = hn::Sub(one, smooth_step(set(0.85f), set(1.5f), uneven));
    const Floats white = hn::Mul(smooth_step(set(-0.35f), set(0.55f), more), clings);
    const std::array<double, 3>& snow = pass.ground.look->snow_albedo;
    return mix(albedo, {set(float(snow[0])), set(float(snow[1])), set(float(snow[2]))}, {white, white, white});
}

// Water and snow that fell. Films run from slopes into hollows; puddles and ponds are level, so that they mirror as level
// ground does; snow drifts into what is sheltered and slides from walls. Changes the normal where water is.
HWY_INLINE void lay_weather(const TerrainPass& pass, const Seen& seen, const Lying& lying, TerrainSpot& spot, Surface& surface) {
    const Lanes d;
    const Floats zero = hn::Zero(d), one = set(1.0f);
    const WetGroundOptions& look = *pass.ground.look;
    if (!hn::AllFalse(d, hn::Gt(lying.water_mm, zero))) {
        const Floats steep2 = hn::Mul(spot.steepness, spot.steepness);
        const Floats film = hn::Div(hn::Mul(lying.water_mm, spot.gathers), hn::MulAdd(set(9.0f), steep2, one));
        const ResolvedNoise hollows = resolved_noise(pass.ground.hollows, spot.point, spot.pixel_m);
        const Floats soaked = hn::Sub(one, hn::Exp(d, hn::Mul(film, set(float(-1 / look.soaking_mm)))));
        const Floats level = hn::Sub(one, smooth_step(set(0.04f), set(0.16f), spot.steepness));
        const Floats puddle = hn::Mul(level, covered(film, float(look.puddle_film_mm), hollows));
        // A hollow is full when half of level ground is under water.
        const Floats full = clamp01(hn::Mul(lying.water_mm, set(float(1 / look.puddle_film_mm))));
        const Floats pond = smooth_step(set(0.05f), set(0.6f), hn::Mul(spot.pond_m, full));
        const Floats water = hn::Max(puddle, pond);
        const Slopes slopes = ripples_at(pass.ground.ripples, spot.point, spot.pixel_m, lying.rain_mm_per_h);
        const Floats cosine = hn::Max(hn::MulAdd(slopes.x, spot.ray.x, hn::MulSub(slopes.y, spot.ray.y, spot.ray.z)), set(0.01f));
        const Floats mirrors = hn::Mul(water, water_reflectance(hn::Min(cosine, one), slopes.variance));
        const Floats3 wet = soaked_albedo(surface.albedo);
        const Floats dry = hn::Mul(hn::Sub(one, water), hn::Sub(one, soaked));
        const Floats below = hn::Sub(hn::Sub(one, dry), mirrors);
        surface.albedo = times_add(dry, surface.albedo, times(below, wet));
        spot.normal = mix(spot.normal, {zero, zero, one}, {water, water, water});
        if (pass.ground.mirror != nullptr && !hn::AllFalse(d, hn::Gt(mirrors, set(1.0e-4f)))) {
            const Floats3 light = reflected(pass.ground, seen, mirrored_ray(spot.ray, slopes.x, slopes.y),
                                            hn::Mul(set(2.0f), hn::Sqrt(slopes.variance)));
            surface.reflected = times(hn::Mul(set(pass.ground.reflection), mirrors), light);
        }
    }
    if (hn::AllFalse(d, hn::Gt(lying.snow_mm, zero))) return;
    const ResolvedNoise tufts = resolved_noise(pass.ground.tufts, spot.point, spot.pixel_m);
    const Floats drifts = hn::Max(hn::MulAdd(set(3.0f), spot.shelter, one), set(0.15f));
    const Floats clings = hn::Sub(one, smooth_step(set(0.85f), set(1.5f), spot.steepness));
    const Floats white = hn::Mul(clings, covered(hn::Mul(lying.snow_mm, drifts), float(look.snow_cover_mm), tufts));
    const std::array<double, 3>& snow = look.snow_albedo;
    surface.albedo = mix(surface.albedo, {set(float(snow[0])), set(float(snow[1])), set(float(snow[2]))}, {white, white, white});
    surface.reflected = times(hn::Sub(one, white), surface.reflected);
}

// Light on the surface, as the radiance of a white one.
HWY_INLINE Floats3 light_on(const TerrainPass& pass, const TerrainSpot& spot) {
    const PictureFrame& frame = pass.ground.white;
    const Lanes d;
    const Floats zero = hn::Zero(d), one = set(1.0f);
    const ShadowTexels shadow{pass.ground.shadow, pass.ground.shadow_size};
    const Floats above = clamp01(hn::Mul(hn::Sub(spot.z_m, set(pass.cloud_base_m)), set(pass.per_cloud)));
    const auto clear = [&](Floats share) { return hn::MulAdd(above, hn::Sub(one, share), share); };
    const Floats facing = hn::Max(dot(spot.normal, set3(frame.to_sun)), zero);
    const Floats sun = hn::Mul(hn::Mul(facing, spot.sun), clear(sun_share(frame, shadow, spot.point)));
    Floats below_sun = zero, below_sky = one;
    if (frame.ground_light != nullptr) {
        const LightBelow below = light_below(*frame.ground_light, frame.ground_light_place, spot.point);
        below_sun = hn::Mul(hn::Sub(one, above), below.sun);
        below_sky = clear(below.sky);
    }
    const Floats upwards = hn::MulAdd(set(0.5f), spot.normal.z, set(0.5f)), open = hn::Mul(spot.sky, upwards);
    Floats3 light = times(sun, sunlight_at(frame, spot.point.z));
    light = times_add(hn::Mul(open, below_sky), set3(frame.ground), light);
    light = times_add(hn::Mul(open, below_sun), set3(frame.ground_sun), light);
    const Floats back = hn::Mul(hn::Sub(one, open), below_sky);
    light = add(light, {hn::Mul(back, set(pass.bounce[0])), hn::Mul(back, set(pass.bounce[1])),
                        hn::Mul(back, set(pass.bounce[2]))});
    if (!(frame.flash.w > 0)) return light;
    const Floats3 way = subtract(set3(frame.flash), spot.point);
    const Floats squared = dot(way, way);
    const Floats cosine = hn::Div(hn::Max(dot(way, spot.normal), zero), hn::Sqrt(hn::Max(squared, set(1.0e-6f))));
    return times_add(hn::Mul(flash_falloff(squared), cosine), set3(frame.ground_flash), light);
}

// Radiance at the eye without clouds in front, with the air.
HWY_INLINE Floats3 terrain_radiance(const TerrainPass& pass, const TerrainRow& row, std::size_t x) {
    const Lanes d;
    TerrainSpot spot = spot_at(row, x);
    tilt(pass, hn::LoadU(d, &row.slope_x[x]), hn::LoadU(d, &row.slope_y[x]), spot);
    const PictureFrame& frame = pass.ground.white;
    const Floats3 beta = air_transmittance(frame, spot.ray, spot.distance);
    const Floats3 veil = air_light(frame, spot.ray, spot.distance, beta);
    Surface surface{dry_albedo(pass, spot), {hn::Zero(d), hn::Zero(d), hn::Zero(d)}};
    if (pass.covered) {
        const Seen seen{spot.ray, spot.point, beta, veil, spot.pixel_m, surface.albedo};
        lay_weather(pass, seen, lying_at(pass.ground.cover, spot.point), spot, surface);
    }
    const Floats3 seen = each_times(surface.albedo, light_on(pass, spot));
    return add(add(each_times(beta, seen), surface.reflected), veil);
}

void draw_terrain_row(const TerrainPass& pass, const TerrainRow& row, int y, Picture& picture) {
    const Lanes d;
    const std::size_t lanes = hn::Lanes(d), width = std::size_t(picture.width);
    HWY_ALIGN float red[hn::MaxLanes(d)], green[hn::MaxLanes(d)], blue[hn::MaxLanes(d)];
    for (std::size_t x = 0; x < width; x += lanes) {
        if (hn::AllFalse(d, hn::Lt(hn::LoadU(d, &row.distance_m[x]), set(kNowhere)))) continue;
        const Floats3 radiance = terrain_radiance(pass, row, x);
        hn::Store(radiance.x, d, red);
        hn::Store(radiance.y, d, green);
        hn::Store(radiance.z, d, blue);
        for (std::size_t lane = 0; lane < std::min(lanes, width - x); ++lane) {
            if (!(row.distance_m[x + lane] < kNowhere)) continue;
            const std::size_t pixel = std::size_t(y) * width + x + lane;
            const float left = picture.transmittance[pixel];
            const float colour[] = {red[lane], green[lane], blue[lane]};
            for (std::size_t c = 0; c < 3; ++c) {
                picture.beauty[3 * pixel + c] += left * colour[c];
                picture.terrain_light[3 * pixel + c] = colour[c];
            }
        }
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(draw_terrain_row);

namespace {

constexpr std::size_t kPadding = 16;  // of a vector, at most
constexpr std::uint32_t kSeed = 0x74657272u;

TerrainPass pass_of(const TerrainGround& ground, const Picture& picture) {
    const RenderOptions& options = ground.options;
    const TerrainOptions& terrain = options.terrain;
    const Vec3& eye = options.camera.position_m;
    TerrainPass pass;
    pass.ground.look = &options.wet_ground;
    RenderOptions white = options;
    white.ground.albedo = {1, 1, 1};
    pass.ground.white = frame_data(white, camera_frame(options.camera), picture.shadow_frame, ground.flash,
                                   {0, 0, picture.width, picture.height}, ground.sky);
    pass.ground.white.endless = ground.endless;
    if (ground.light != nullptr) use_ground_light(*ground.light, eye, pass.ground.white);
    const Rgb& albedo = options.ground.albedo;
    const bool water = options.ground.pattern == GroundPattern::water;
    // The albedo of a sea is not that of its shores.
    pass.ground.dry = water ? shader::vec4{0.11f, 0.13f, 0.06f, 0}
                            : shader::vec4{float(albedo[0]), float(albedo[1]), float(albedo[2]), 0};
    pass.ground.country = country_of(options.ground, eye);
    const GroundCoverView& cover = ground.cover;
    const auto any = [](std::span<const float> values) { return std::ranges::any_of(values, [](float v) { return v > 0; }); };
    pass.covered = cover.outside.water_mm > 0 || cover.outside.snow_mm > 0 || any(cover.water_mm) || any(cover.snow_mm);
    if (pass.covered) {
        pass.ground.cover = {&cover, float((eye.x - cover.x_m) / cover.texel_x_m), float((eye.y - cover.y_m) / cover.texel_y_m),
                             float(1 / cover.texel_x_m), float(1 / cover.texel_y_m)};
        pass.ground.hollows = noise_octaves({150 * options.wet_ground.puddle_size_m, 0.45, 10, 1.0, 0x77657400u}, eye);
        pass.ground.tufts = noise_octaves({900, 0.42, 11, 1.0, 0x736e6f77u}, eye);
        pass.ground.ripples = ripple_grid(cover, ground.time_s, options.wet_ground.ripples, eye);
        pass.ground.mirror = ground.mirror;
        pass.ground.reflection = float(options.wet_ground.reflection);
    }
    pass.ground.shadow = ground.shadow;
    pass.ground.shadow_size = ground.shadow_size;
    const double cell = std::max(ground.map.step_x_m, ground.map.step_y_m);
    pass.relief = noise_octaves({2.2 * cell, 0.47, 9, 0.52, kSeed}, eye);
    pass.relief_m = float(0.045 * cell);
    pass.patches = noise_octaves({12 * cell, 0.47, 9, 0.72, kSeed + 100}, eye);
    pass.strata = noise_octaves({90, 0.45, 6, 0.75, kSeed + 200}, {0.22 * eye.x, 0.05 * eye.y, 0});
    pass.rock_slope = float(terrain.rock_slope_deg < 90 ? std::tan(terrain.rock_slope_deg * std::numbers::pi / 180) : 1e6);
    pass.rock = {float(terrain.rock_albedo[0]), float(terrain.rock_albedo[1]), float(terrain.rock_albedo[2]), 0};
    pass.snow_line_m = std::isfinite(terrain.snow_line_m) ? float(terrain.snow_line_m)
                       : terrain.snow_line_m > 0          ? kNoTerrain
                                                          : -kNoTerrain;
    pass.cloud_base_m = float(ground.cloud_base_m);
    pass.per_cloud = float(1 / std::max(ground.cloud_top_m - ground.cloud_base_m, 1.0));
    const float around[] = {pass.ground.dry.x, pass.ground.dry.y, pass.ground.dry.z};
    const PictureFrame& frame = pass.ground.white;
    const float lit[] = {frame.ground.x + 0.6f * frame.ground_sun.x, frame.ground.y + 0.6f * frame.ground_sun.y,
                         frame.ground.z + 0.6f * frame.ground_sun.z};
    for (std::size_t c = 0; c < 3; ++c) pass.bounce[c] = around[c] * lit[c];
    return pass;
}

}  // namespace

void draw_terrain(const TerrainGround& ground, Picture& picture) {
    const TerrainPass pass = pass_of(ground, picture);
    const CameraFrame frame = camera_frame(ground.options.camera);
    picture.terrain_m = ground.view.distance_m;
    picture.terrain_light.assign(3 * picture.pixels(), 0.0f);
    tbb::parallel_for(0, picture.height, [&](int y) {
        TerrainRow row(std::size_t(picture.width) + kPadding);
        if (find_row(ground, frame, double(earth_bend(ground.sky)), y, picture, row))
            HWY_DYNAMIC_DISPATCH(draw_terrain_row)(pass, row, y, picture);
    });
}

}  // namespace nephos
#endif
