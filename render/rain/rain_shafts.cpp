// SPDX-License-Identifier: Apache-2.0
#include "render/rain/rain_shafts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include <tbb/parallel_for.h>

#include "core/random.h"
#include "core/vec.h"
#include "render/frame/frame_data.h"
#include "render/rain/drop_sizes.h"
#include "render/rain/rain_shafts_pass.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/rain/rain_shafts.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/highway.h>

#include "render/rain/rain_shafts-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

void draw_shaft_row(const ShaftPass& p, std::size_t y, Picture& picture) {
    const Lanes d;
    const std::size_t lanes = hn::Lanes(d), first = y * p.width;
    MetCurtains met(p.curtains.size());
    const bool terrain = !picture.terrain_m.empty();
    std::size_t x = 0;
    for (; x + lanes <= p.width; x += lanes)
        draw_pixels(p, met, x, y,
                    {&picture.beauty[3 * (first + x)], &picture.depth_m[first + x],
                     &picture.transmittance[first + x], terrain ? &picture.terrain_m[first + x] : nullptr});
    const std::size_t rest = p.width - x;
    if (rest == 0) return;
    std::array<float, 3 * hn::MaxLanes(Lanes())> beauty{}, depth_m{}, transmittance{}, terrain_m{};
    std::copy_n(&picture.beauty[3 * (first + x)], 3 * rest, beauty.begin());
    std::copy_n(&picture.depth_m[first + x], rest, depth_m.begin());
    std::copy_n(&picture.transmittance[first + x], rest, transmittance.begin());
    if (terrain) std::copy_n(&picture.terrain_m[first + x], rest, terrain_m.begin());
    draw_pixels(p, met, x, y,
                {beauty.data(), depth_m.data(), transmittance.data(), terrain ? terrain_m.data() : nullptr});
    std::copy_n(beauty.begin(), 3 * rest, &picture.beauty[3 * (first + x)]);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(draw_shaft_row);

namespace {

glm::vec3 floats(const Vec3& v) { return {float(v.x), float(v.y), float(v.z)}; }
glm::vec3 floats(const Rgb& v) { return {float(v[0]), float(v[1]), float(v[2])}; }
bool any(const Rgb& v) { return v[0] + v[1] + v[2] > 0; }

// Returns the position of the eye in the texture modulo the period of the noise, for the precision of floats.
float within_noise(double cells) {
    return float(cells - kShaftNoiseSide * std::floor(cells / kShaftNoiseSide));
}

// Sets how the curtain shades itself from the sun. Half of what drops as large as these take from a beam is diffracted by less than
// the sun's radius (van de Hulst 1957, 8.1) and arrives all the same.
void set_sun(const RainCurtain& c, const Vec3& to_sun, SeenCurtain& out) {
    const double x = to_sun.x - c.lean_x * to_sun.z, y = to_sun.y - c.lean_y * to_sun.z;
    out.sun_x = float((c.axis_x * x + c.axis_y * y) / c.semi_a_m);
    out.sun_y = float((c.axis_x * y - c.axis_y * x) / c.semi_b_m);
    out.sun_per_m = 0.5f * out.per_m * float(mean_water(c));
}

SeenCurtain seen_curtain(const RainCurtain& c, const PrecipitationOptions& p, const Vec3& eye,
                         double time_s) {
    SeenCurtain out;
    const double height = c.base_m - c.ground_m, eye_z = eye.z - c.ground_m;
    const double x = eye.x - c.x_m - c.lean_x * eye_z, y = eye.y - c.y_m - c.lean_y * eye_z;
    out.ax = float(c.axis_x / c.semi_a_m);
    out.ay = float(c.axis_y / c.semi_a_m);
    out.bx = float(-c.axis_y / c.semi_b_m);
    out.by = float(c.axis_x / c.semi_b_m);
    out.eye_x = float((c.axis_x * x + c.axis_y * y) / c.semi_a_m);
    out.eye_y = float((c.axis_x * y - c.axis_y * x) / c.semi_b_m);
    out.eye_z = float(eye_z);
    out.lean_x = float(c.lean_x);
    out.lean_y = float(c.lean_y);
    out.height_m = float(height);
    out.per_height = float(1 / height);
    const double up = 0.5 * height;  // the circle holds the curtain at all heights
    out.centre_x = float(c.x_m + c.lean_x * up - eye.x);
    out.centre_y = float(c.y_m + c.lean_y * up - eye.y);
    out.reach_m = float(std::max(c.semi_a_m, c.semi_b_m) + up * std::hypot(c.lean_x, c.lean_y));
    out.per_m = float(p.shafts * rain_extinction_per_m(p.kind, p.intensity_scale * c.rate_mm_per_h));
    const double grain_m = shaft_grain_m(c);
    out.grain_x = within_noise(x / grain_m);
    out.grain_y = within_noise(y / grain_m);
    out.per_grain = float(1 / grain_m);
    if (c.cloud) {
        out.cloud = c.cloud.get();
        out.per_texel = float(1 / c.cloud->texel_m);
        out.cloud_x = float((eye.x + c.lean_x * (c.base_m - eye.z) - c.cloud->x_m) / c.cloud->texel_m - 0.5);
        out.cloud_y = float((eye.y + c.lean_y * (c.base_m - eye.z) - c.cloud->y_m) / c.cloud->texel_m - 0.5);
        out.ground_m = float(c.ground_m);
    }
    out.own = float(c.id % kShaftsOwn);
    out.fall = within_noise(kShaftFall_m_per_s * time_s / kShaftFallCell_m + double(c.id % kShaftsOwn));
    return out;
}

std::vector<std::uint32_t> corners(const std::vector<std::uint8_t>& noise) {
    constexpr std::size_t kLast = kShaftNoiseSide - 1;
    std::vector<std::uint32_t> cells(noise.size());
    const auto value = [&](std::size_t x, std::size_t y) {
        return std::uint32_t(noise[((y & kLast) << kShaftNoiseBits) + (x & kLast)]);
    };
    for (std::size_t i = 0; i < cells.size(); ++i) {
        const std::size_t x = i & kLast, y = i >> kShaftNoiseBits;
        cells[i] = value(x, y) | value(x + 1, y) << 8 | value(x, y + 1) << 16 | value(x + 1, y + 1) << 24;
    }
    return cells;
}

void set_light(ShaftPass& pass, const Picture& picture, const PrecipitationLight& light,
               const PictureAir& air, const Vec3& eye) {
    pass.by_sky = floats(light.by_sky);
    pass.by_sunlit_ground = floats(light.by_sunlit_ground);
    pass.by_scattered_sun = floats(light.by_scattered_sun);
    if (light.ground != nullptr && !light.ground->words.empty()) {
        pass.ground = light.ground;
        pass.ground_place = ground_light_place(*light.ground, eye);
    }
    pass.sun = floats(light.sun);
    pass.to_sun = floats(light.to_sun);
    pass.flash = floats(light.flash);
    pass.flash_m = floats(light.flash_m - eye);
    pass.has_sun = any(light.sun);
    if (pass.has_sun && light.kind == PrecipitationKind::rain) pass.bow = &rainbow();
    pass.has_flash = any(light.flash);
    pass.forward_g = float(forward_g(light.kind));
    for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t n = 0; n < PictureAir::kHorizons; ++n) pass.horizon[c][n] = float(air.horizon[n][c]);
    pass.air_per_m = floats(air.extinction_per_m);
    if (picture.shadow.empty()) return;
    const ShadowFrame& f = picture.shadow_frame;
    const Vec3 u = (1 / dot(f.u_axis_m, f.u_axis_m)) * f.u_axis_m,
               v = (1 / dot(f.v_axis_m, f.v_axis_m)) * f.v_axis_m;
    pass.shadow = picture.shadow.data();
    pass.shadow_size = picture.shadow_size;
    pass.to_u = floats(u);
    pass.to_v = floats(v);
    pass.shadow_u = float(dot(eye - f.origin_m, u));
    pass.shadow_v = float(dot(eye - f.origin_m, v));
}

}  // namespace

double rain_extinction_per_m(PrecipitationKind kind, double rate_mm_per_h) {
    return rate_mm_per_h > 0 ? 2 * shadow_per_m(size_law(kind, rate_mm_per_h)) : 0;
}

double left_of_rain(double height, double evaporation) {
    if (evaporation <= 0) return 1;
    const double s = std::clamp((height - evaporation) / std::max(1 - evaporation, 1e-3), 0.0, 1.0);
    return s * (2 - s);
}

double sun_profile(double softness) { return std::min(1.0, softness * (1.5 - 0.45 * softness)); }

double mean_water(const RainCurtain& c) {
    constexpr int kAlong = 16;
    if (!c.cloud) return 1;
    double sum = 0;
    int places = 0;
    for (int j = 0; j < kAlong; ++j) {
        for (int i = 0; i < kAlong; ++i) {
            const double u = (2 * i + 1.0) / kAlong - 1, v = (2 * j + 1.0) / kAlong - 1;
            if (u * u + v * v >= 1) continue;
            const Ellipse top = ellipse_at(c, c.base_m);
            const double a = u * top.semi_a_m, b = v * top.semi_b_m;
            sum += c.cloud->at(top.x_m + a * top.axis_x - b * top.axis_y, top.y_m + a * top.axis_y + b * top.axis_x).water;
            ++places;
        }
    }
    return sum / places;
}

double shaft_grain_m(const RainCurtain& c) {
    return std::clamp(0.3 * std::min(c.semi_a_m, c.semi_b_m), 20.0, 400.0);
}

std::vector<std::uint8_t> shaft_noise(std::uint64_t seed) {
    std::vector<std::uint8_t> values(std::size_t(kShaftNoiseSide) * std::size_t(kShaftNoiseSide));
    for (std::size_t i = 0; i < values.size(); i += 4) {
        const PhiloxWords words =
            philox(seed, item_counter(Domain::particles, 1, std::uint32_t(i / 4), 0, 0));
        for (std::size_t w = 0; w < 4; ++w) values[i + w] = std::uint8_t(words[w] >> 24);
    }
    return values;
}

ShaftPass shaft_pass(const Picture& picture, const RenderOptions& options, const CameraFrame& camera,
                     std::span<const RainCurtain> curtains, const PrecipitationLight& light, double time_s) {
    const PrecipitationOptions& p = options.precipitation;
    ShaftPass pass;
    for (const RainCurtain& c : curtains) {
        if (!falls(c)) continue;
        pass.curtains.push_back(seen_curtain(c, p, camera.position_m, time_s));
        if (any(light.sun)) set_sun(c, light.to_sun, pass.curtains.back());
    }
    pass.forward = floats(camera.forward);
    pass.right = floats(camera.half_width * camera.right);
    pass.up = floats(camera.half_height * camera.up);
    pass.width = std::size_t(picture.width);
    pass.column = 2 / float(options.camera.width);
    pass.row = 2 / float(options.camera.height);
    pass.softness = p.edge > 0 ? float(std::max(p.edge, kShaftSoftest)) : 0.0f;
    pass.sun_profile = float(sun_profile(double(pass.softness)));
    pass.fray = float(kShaftFray * p.shaft_texture);
    pass.contrast = float(p.shaft_texture);
    pass.evaporation = float(p.evaporation);
    pass.clear_m = p.particles > 0 ? float(p.depth_m) : 0.0f;
    set_light(pass, picture, light, air_of(picture, options), camera.position_m);
    return pass;
}

std::vector<std::uint32_t> shaft_noise_cells(std::uint64_t seed) { return corners(shaft_noise(seed)); }

void draw_shafts(Picture& picture, const RenderOptions& options, const CameraFrame& camera,
                 std::span<const RainCurtain> curtains, const PrecipitationLight& light, double time_s,
                 std::uint64_t seed) {
    if (options.precipitation.shafts <= 0) return;
    ShaftPass pass = shaft_pass(picture, options, camera, curtains, light, time_s);
    pass.veiled_shadow = shadow_with_veils(picture, options.ground.height_m);
    if (!pass.veiled_shadow.empty()) pass.shadow = pass.veiled_shadow.data();
    if (pass.curtains.empty()) return;
    pass.noise = shaft_noise_cells(seed);
    tbb::parallel_for(std::size_t(0), std::size_t(picture.height), [&](std::size_t y) {
        HWY_DYNAMIC_DISPATCH(draw_shaft_row)(pass, y, picture);
    });
}

}  // namespace nephos
#endif
