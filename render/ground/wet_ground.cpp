// SPDX-License-Identifier: Apache-2.0
#include "render/ground/wet_ground.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "render/frame/frame_data.h"
#include "render/ground/ground_pass.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/ground/wet_ground.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/highway.h>

#include "render/ground/country-inl.h"
#include "render/ground/cover-inl.h"
#include "render/ground/ground_look-inl.h"
#include "render/ground/ground_pass-inl.h"
#include "render/ground/ripples-inl.h"
#include "render/ground/water-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// Computes the surface of wet soil and puddles.
HWY_INLINE Surface wet_surface(const GroundPass& pass, const Seen& seen, const Lying& lying,
                               const ResolvedNoise& hollows) {
    const WetGroundOptions& look = *pass.look;
    const Lanes d;
    const Floats one = set(1.0f);
    const Floats puddle = covered(lying.water_mm, float(look.puddle_film_mm), hollows);
    // Hollows stay damp longer than what stands out.
    const Floats damp_mm = hn::Mul(lying.water_mm, hn::Exp(d, hn::Mul(set(-0.7f), hollows.value)));
    const Floats soaked = hn::Sub(one, hn::Exp(d, hn::Mul(damp_mm, set(float(-1 / look.soaking_mm)))));
    const Slopes slopes = ripples_at(pass.ripples, seen.point, seen.pixel_m, lying.rain_mm_per_h);
    const Floats cosine = hn::Neg(seen.ray.z);
    const Floats tilted =
        hn::Max(hn::Add(cosine, hn::MulAdd(slopes.x, seen.ray.x, hn::Mul(slopes.y, seen.ray.y))), set(0.01f));
    constexpr float kSoilSlopes = 0.09f;  // variance
    const Floats of_water = water_reflectance(hn::Min(tilted, one), slopes.variance),
                 of_soil = hn::Mul(hn::Mul(set(float(look.sheen)), soaked),
                                   water_reflectance(cosine, set(kSoilSlopes)));
    const Floats dry_part = hn::Mul(hn::Sub(one, puddle), hn::Sub(one, soaked));
    const Floats soaked_part = hn::Mul(hn::Sub(one, puddle), hn::Sub(soaked, of_soil));
    const Floats under_water = hn::Mul(puddle, hn::Sub(one, of_water));
    Surface surface;
    const Floats3 soaked_soil = pass.country.enabled ? soaked_albedo(seen.dry) : soaked_albedo(pass.dry);
    surface.albedo =
        times_add(dry_part, seen.dry, times(hn::Add(soaked_part, under_water), soaked_soil));
    surface.reflected = {hn::Zero(d), hn::Zero(d), hn::Zero(d)};
    if (pass.mirror == nullptr) return surface;
    const Floats strength = set(pass.reflection);
    const auto reflects = [&](Floats fraction, Floats slope_x, Floats slope_y, Floats blur) {
        if (hn::AllFalse(d, hn::Gt(fraction, hn::Zero(d)))) return;
        const Floats3 light = reflected(pass, seen, mirrored_ray(seen.ray, slope_x, slope_y), blur);
        surface.reflected = times_add(hn::Mul(strength, fraction), light, surface.reflected);
    };
    reflects(hn::Mul(puddle, of_water), slopes.x, slopes.y, hn::Mul(set(2.0f), hn::Sqrt(slopes.variance)));
    reflects(hn::Mul(hn::Sub(one, puddle), of_soil), hn::Zero(d), hn::Zero(d), set(0.6f));
    return surface;
}

// Below snow; its grain shows as a little light and shade.
HWY_INLINE void lay_snow(const GroundPass& pass, const Seen& seen, const Lying& lying, Surface& surface) {
    const Lanes d;
    if (hn::AllFalse(d, hn::Gt(lying.snow_mm, hn::Zero(d)))) return;
    const WetGroundOptions& look = *pass.look;
    const ResolvedNoise tufts = resolved_noise(pass.tufts, seen.point, seen.pixel_m);
    const Floats white = covered(lying.snow_mm, float(look.snow_cover_mm), tufts), one = set(1.0f);
    const Floats bright = hn::Max(hn::Min(hn::MulAdd(set(-0.02f), tufts.value, one), set(1.05f)), set(0.9f));
    const auto snow = [&](std::size_t c) {
        return hn::Min(hn::Mul(set(float(look.snow_albedo[c])), bright), one);
    };
    surface.albedo = mix(surface.albedo, {snow(0), snow(1), snow(2)}, {white, white, white});
    surface.reflected = times(hn::Sub(one, white), surface.reflected);
}

// Returns the difference of radiance to dry ground, without the clouds in front.
HWY_INLINE Floats3 changed(const GroundPass& pass, const Floats3& direction) {
    const Lanes d;
    const Floats squared = dot(direction, direction);
    Seen seen;
    seen.ray = times(hn::Div(set(1.0f), hn::Sqrt(squared)), direction);
    const Floats distance = ground_distance(pass.white, seen.ray.z);
    const auto meets = hn::Lt(distance, set(kNowhere));
    const Floats near = hn::IfThenElse(meets, distance, set(1.0f));
    seen.point = times(near, seen.ray);
    const Lying lying = lying_at(pass.cover, seen.point);
    const Floats least = pass.water.enabled ? set(kNowhere) : hn::Zero(d);  // nothing lies on water
    const auto covers = hn::And(meets, hn::Gt(hn::Max(lying.water_mm, lying.snow_mm), least));
    const auto some = pass.country.enabled || pass.water.enabled ? meets : covers;
    if (hn::AllFalse(d, some)) return {hn::Zero(d), hn::Zero(d), hn::Zero(d)};
    seen.beta = air_transmittance(pass.white, seen.ray, near);
    const Floats slant = hn::Sqrt(hn::Max(hn::Neg(seen.ray.z), set(1.0e-6f)));
    seen.pixel_m = hn::Div(hn::Mul(near, set(1.0f / pass.white.up.w)), slant);
    seen.dry = set3(pass.dry);
    if (pass.country.enabled)
        seen.dry = each_times(seen.dry, country_albedo(pass.country, seen.point,
                                                       footprint(seen.ray, near, pass.white.up.w)));
    Surface surface{seen.dry, {hn::Zero(d), hn::Zero(d), hn::Zero(d)}};
    const ShadowTexels shadow{pass.shadow, pass.shadow_size};
    if (pass.water.enabled) {
        if (pass.mirror != nullptr) seen.veil = air_light(pass.white, seen.ray, near, seen.beta);
        surface = water_surface(pass, seen, near, sun_share(pass.white, shadow, seen.point), lying.rain_mm_per_h);
    } else if (!hn::AllFalse(d, covers)) {
        if (pass.mirror != nullptr) seen.veil = air_light(pass.white, seen.ray, near, seen.beta);
        const ResolvedNoise hollows = resolved_noise(pass.hollows, seen.point, seen.pixel_m);
        surface = wet_surface(pass, seen, lying, hollows);
        lay_snow(pass, seen, lying, surface);
    }
    const Floats3 light = each_times(seen.beta, ground_light(pass.white, shadow, seen.point));
    const Floats3 more = add(each_times(light, subtract(surface.albedo, set3(pass.dry))), surface.reflected);
    return {hn::IfThenElseZero(some, more.x), hn::IfThenElseZero(some, more.y),
            hn::IfThenElseZero(some, more.z)};
}

void draw_row(const GroundPass& pass, int y, Picture& picture) {
    const Lanes d;
    const std::size_t lanes = hn::Lanes(d), width = std::size_t(picture.width);
    HWY_ALIGN float red[hn::MaxLanes(d)], green[hn::MaxLanes(d)], blue[hn::MaxLanes(d)];
    for (std::size_t x = 0; x < width; x += lanes) {
        const std::size_t first = std::size_t(y) * width + x;
        const float* const left = &picture.transmittance[first];
        const float* const terrain = picture.terrain_m.empty() ? nullptr : &picture.terrain_m[first];
        if (std::all_of(left, left + std::min(lanes, width - x), [](float part) { return part == 0; })) continue;
        const Floats across = hn::Add(hn::Iota(d, float(x)), set(0.5f));
        const Floats3 more = changed(pass, pixel_direction(pass.white, across, set(float(y) + 0.5f)));
        hn::Store(more.x, d, red);
        hn::Store(more.y, d, green);
        hn::Store(more.z, d, blue);
        for (std::size_t lane = 0; lane < std::min(lanes, width - x); ++lane) {
            if (terrain != nullptr && terrain[lane] < kNowhere) continue;  // it hides the plane
            float* beauty = &picture.beauty[3 * (first + lane)];
            beauty[0] = std::max(0.0f, beauty[0] + left[lane] * red[lane]);
            beauty[1] = std::max(0.0f, beauty[1] + left[lane] * green[lane]);
            beauty[2] = std::max(0.0f, beauty[2] + left[lane] * blue[lane]);
        }
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(draw_row);

namespace {

CoverTexels texels_of(const GroundCoverView& map, const Vec3& eye_m) {
    return {&map, float((eye_m.x - map.x_m) / map.texel_x_m), float((eye_m.y - map.y_m) / map.texel_y_m),
            float(1 / map.texel_x_m), float(1 / map.texel_y_m)};
}

bool any(std::span<const float> values) {
    return std::ranges::any_of(values, [](float value) { return value > 0; });
}

bool any_water(const GroundCoverView& cover) { return cover.outside.water_mm > 0 || any(cover.water_mm); }
bool any_snow(const GroundCoverView& cover) { return cover.outside.snow_mm > 0 || any(cover.snow_mm); }

// Returns true when a corner of the image, and hence any ray, points below the horizon of the plane.
bool ground_in_view(const RenderOptions& options) {
    const Camera& camera = options.camera;
    const CameraFrame frame = camera_frame(camera);
    if (camera.position_m.z <= options.ground.height_m) return false;
    double lowest = 1;
    for (const double x : {0.0, 0.5, 1.0})
        for (const double y : {0.0, 1.0})
            lowest = std::min(lowest, pixel_ray(frame, camera, x * camera.width, y * camera.height).z);
    return lowest < 0;
}

}  // namespace

double water_reflectance(double cosine, double slope_variance) {
    const double slope = std::sqrt(slope_variance);
    const double grazing = std::pow(1 - cosine, 5 * std::exp(-2.69 * slope));
    const double hidden = 1 + 22.7 * slope * std::sqrt(slope);
    return kWaterNormalReflectance + (1 - kWaterNormalReflectance) * grazing / hidden;
}

double soaked_back_reflectance() {
    constexpr double kIndex = 1.333, kDiffuseReflectance = 0.066;
    return 1 - (1 - kDiffuseReflectance) / (kIndex * kIndex);
}

double soaked_albedo(double dry_albedo) {
    const double back = soaked_back_reflectance();
    return (1 - back) * dry_albedo / (1 - back * dry_albedo);
}

bool shows_pattern(const RenderOptions& options) {
    return options.ground.pattern != GroundPattern::plain && ground_in_view(options);
}

bool shows_wet_ground(const RenderOptions& options, const GroundCoverView& cover) {
    return (any_water(cover) || any_snow(cover)) && ground_in_view(options);
}

const GroundCoverView& cover_of(const Splats& splats) {
    static const GroundCoverView kDry;
    return splats.ground_cover ? *splats.ground_cover : kDry;
}

bool shows_reflections(const RenderOptions& options, const GroundCoverView& cover) {
    const bool water = options.ground.pattern == GroundPattern::water || any_water(cover);
    return options.wet_ground.reflection > 0 && water && ground_in_view(options);
}

Rgb mean_albedo(const RenderOptions& options, const GroundCoverView& cover) {
    const WetGroundOptions& look = options.wet_ground;
    const auto white = [&](double snow_mm) {  // as covered() in ground_look-inl.h, where nothing is resolved
        if (!(snow_mm > 0)) return 0.0;
        return 1 / (1 + std::exp(-1.702 * std::log(snow_mm / look.snow_cover_mm) / double(kFilmSpread)));
    };
    double sum = 0;
    for (const float snow_mm : cover.snow_mm) sum += white(double(snow_mm));
    const double part = cover.snow_mm.empty() ? white(cover.outside.snow_mm) : sum / double(cover.snow_mm.size());
    Rgb albedo;
    for (std::size_t c = 0; c < 3; ++c)
        albedo[c] = std::lerp(options.ground.albedo[c], look.snow_albedo[c], part);
    return albedo;
}

void check(const GroundCoverView& cover) {
    const auto require = [](bool good, const char* what) {
        if (!good) throw Error(ErrorCode::usage, std::string("ground cover: ") + what);
    };
    const bool none = cover.columns == 0 && cover.rows == 0;
    require(none || (cover.columns >= 2 && cover.rows >= 2), "expected at least 2 x 2 texels, or none");
    const std::size_t texels = std::size_t(cover.columns) * std::size_t(cover.rows);
    require(cover.water_mm.size() == texels && cover.snow_mm.size() == texels &&
                cover.rain_mm_per_h.size() == texels,
            "expected as many values as texels");
    require(cover.texel_x_m > 0 && cover.texel_y_m > 0, "expected texels above 0 m");
    const auto bad = [](double value) { return !(value >= 0 && std::isfinite(value)); };
    for (const std::span<const float> values : {cover.water_mm, cover.snow_mm, cover.rain_mm_per_h})
        require(std::ranges::none_of(values, bad), "expected water, snow and rain of 0 mm or more");
    require(!bad(cover.outside.water_mm) && !bad(cover.outside.snow_mm) && !bad(cover.outside_rain_mm_per_h),
            "expected water, snow and rain of 0 mm or more outside");
}

GroundPass ground_pass(const WetGround& ground, const ShadowFrame& shadow_frame) {
    const RenderOptions& options = ground.options;
    const Vec3& eye = options.camera.position_m;
    GroundPass pass;
    pass.look = &options.wet_ground;
    RenderOptions white = options;
    white.ground.albedo = {1, 1, 1};
    pass.white = frame_data(white, camera_frame(options.camera), shadow_frame, ground.flash,
                            {0, 0, options.camera.width, options.camera.height}, ground.sky);
    pass.white.endless = ground.endless;
    if (ground.light != nullptr) use_ground_light(*ground.light, eye, pass.white);
    const Rgb& albedo = options.ground.albedo;
    pass.dry = {float(albedo[0]), float(albedo[1]), float(albedo[2]), 0};
    pass.country = country_of(options.ground, eye);
    pass.water = water_of(options, eye, ground.time_s);
    pass.shadow = ground.shadow;
    pass.shadow_size = ground.shadow_size;
    pass.cover = texels_of(ground.cover, eye);
    const double puddle_m = options.wet_ground.puddle_size_m;
    pass.hollows = noise_octaves({150 * puddle_m, 0.45, 10, 1.0, 0x77657400u}, eye);
    pass.tufts = noise_octaves({900, 0.42, 11, 1.0, 0x736e6f77u}, eye);
    pass.ripples = ripple_grid(ground.cover, ground.time_s, options.wet_ground.ripples, eye);
    pass.lying = any_water(ground.cover) || any_snow(ground.cover) || !pass.ripples.slopes.x.empty();
    pass.mirror = ground.mirror;
    pass.reflection = float(options.wet_ground.reflection);
    return pass;
}

void draw_wet_ground(const WetGround& ground, Picture& picture) {
    const GroundPass pass = ground_pass(ground, picture.shadow_frame);
    tbb::parallel_for(0, picture.height, [&](int y) { HWY_DYNAMIC_DISPATCH(draw_row)(pass, y, picture); });
}

}  // namespace nephos
#endif
