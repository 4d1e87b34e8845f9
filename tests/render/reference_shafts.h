// SPDX-License-Identifier: Apache-2.0
#pragma once

// Rain shafts one ray at a time, in doubles: what rain_shafts.h says, in the order in which it says it.

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "core/vec.h"
#include "render/rain/rain_shafts.h"

namespace nephos::reference {

inline double smooth(double s) { return s * s * (3 - 2 * s); }

struct Shafts {
    const Picture& picture;
    const RenderOptions& options;
    CameraFrame camera;
    std::span<const RainCurtain> curtains;
    PrecipitationLight light;
    double time_s = 0;
    std::vector<std::uint8_t> noise;
    std::vector<double> whole_per_m;  // of each curtain, without its form and texture
};

inline double noise_at(const Shafts& s, double x, double y) {
    const auto value = [&](double column, double row) {
        const auto at = [](double i) { return std::size_t(std::int64_t(i) & (kShaftNoiseSide - 1)); };
        return s.noise[at(row) * kShaftNoiseSide + at(column)] / 255.0;
    };
    const double x0 = std::floor(x), y0 = std::floor(y);
    const double low = std::lerp(value(x0, y0), value(x0 + 1, y0), smooth(x - x0)),
                 high = std::lerp(value(x0, y0 + 1), value(x0 + 1, y0 + 1), smooth(x - x0));
    return std::lerp(low, high, smooth(y - y0));
}

inline std::vector<double> whole_per_m(const PrecipitationOptions& p, std::span<const RainCurtain> curtains) {
    std::vector<double> all;
    for (const RainCurtain& c : curtains)
        all.push_back(p.shafts * rain_extinction_per_m(p.kind, p.intensity_scale * c.rate_mm_per_h));
    return all;
}

// Extinction of one curtain at a place, without its falls.
inline double extinction(const Shafts& s, const RainCurtain& c, double whole_per_m, const Vec3& place) {
    const PrecipitationOptions& p = s.options.precipitation;
    if (!(c.base_m > c.ground_m)) return 0;
    const double height_m = place.z - c.ground_m, h = height_m / (c.base_m - c.ground_m);
    const double r = std::sqrt(ellipse_value(ellipse_at(c, place.z), place.x, place.y));
    if (h < 0 || h > 1 || r >= 1) return 0;
    const double x = (place.x - c.x_m - c.lean_x * height_m) / shaft_grain_m(c),
                 y = (place.y - c.y_m - c.lean_y * height_m) / shaft_grain_m(c);
    const double own = double(c.id % kShaftsOwn);
    const double strands = 0.6 * noise_at(s, x + own, y) + 0.4 * noise_at(s, 4 * x, 4 * y + own);
    const double inside = 1 - r - kShaftFray * p.shaft_texture * strands * r;
    const double inner = p.edge > 0 ? smooth(std::clamp(inside / std::max(p.edge, kShaftSoftest), 0.0, 1.0))
                                    : double(inside > 0);
    const double contrast = p.shaft_texture;
    double falls = std::min(1.0, (1 - h) / double(kShaftTopFade)), height = h;
    if (c.cloud) {
        const CloudBases::Column above = cloud_above(c, place);
        const double to_base = above.base_m - c.ground_m;
        falls = above.water *
                std::clamp((to_base - height_m) / std::max(to_base, 1.0) / double(kShaftCloudFade), 0.0, 1.0);
        height = height_m / std::max(to_base, 1.0);
    }
    return whole_per_m * falls * left_of_rain(height, p.evaporation) * inner *
           std::exp(contrast * 4.5 * (strands - 0.5) - 0.25 * contrast * contrast);
}

// The factor of the denser falls.
inline double falls_at(const Shafts& s, const RainCurtain& c, const Vec3& place) {
    const double height_m = place.z - c.ground_m;
    const double x = (place.x - c.x_m - c.lean_x * height_m) / shaft_grain_m(c),
                 y = (place.y - c.y_m - c.lean_y * height_m) / shaft_grain_m(c);
    const double fallen = (height_m + kShaftFall_m_per_s * s.time_s) / double(kShaftFallCell_m);
    const double falls = noise_at(s, x + y, fallen + double(c.id % kShaftsOwn));
    return std::exp(s.options.precipitation.shaft_texture * 1.5 * (falls - 0.5));
}

struct Stretch {
    double begin = 0, end = 0;
};

// Where a ray runs in curtains that touch or overlap, the nearest first.
inline std::vector<Stretch> stretches(const Shafts& s, const Vec3& ray) {
    std::vector<Stretch> all;
    for (const RainCurtain& c : s.curtains) {
        if (!(c.base_m > c.ground_m) || !(c.rate_mm_per_h > 0)) continue;
        // The quadratic equation of the leaning cylinder, and the slab.
        const Vec3& eye = s.camera.position_m;
        const Ellipse at_eye = ellipse_at(c, eye.z);
        const double rx = ray.x - c.lean_x * ray.z, ry = ray.y - c.lean_y * ray.z;
        const double ux = (c.axis_x * rx + c.axis_y * ry) / c.semi_a_m,
                     uy = (c.axis_x * ry - c.axis_y * rx) / c.semi_b_m;
        const double ex = eye.x - at_eye.x_m, ey = eye.y - at_eye.y_m;
        const double vx = (c.axis_x * ex + c.axis_y * ey) / c.semi_a_m,
                     vy = (c.axis_x * ey - c.axis_y * ex) / c.semi_b_m;
        const double a = ux * ux + uy * uy, b = ux * vx + uy * vy, rest = vx * vx + vy * vy - 1;
        if (b * b - a * rest <= 0) continue;
        const double root = std::sqrt(b * b - a * rest);
        const double low = (c.ground_m - eye.z) / ray.z, high = (c.base_m - eye.z) / ray.z;
        const double begin = std::max({0.0, (-b - root) / a, std::min(low, high)}),
                     end = std::min((-b + root) / a, std::max(low, high));
        if (begin < end) all.push_back({begin, end});
    }
    std::ranges::sort(all, {}, &Stretch::begin);
    std::vector<Stretch> joined;
    for (const Stretch& one : all) {
        if (joined.empty() || one.begin > joined.back().end) {
            joined.push_back(one);
        } else {
            joined.back().end = std::max(joined.back().end, one.end);
        }
    }
    return joined;
}

// Optical depth of the ray to the sun in the curtain that it begins in, in steps, without what drops diffract.
inline double depth_to_sun(const Shafts& s, const RainCurtain& c, double whole_per_m, const Vec3& place) {
    constexpr int kSteps = 200;
    if (!(c.base_m > c.ground_m) || !(c.rate_mm_per_h > 0)) return 0;
    const double edge = s.options.precipitation.edge, softness = edge > 0 ? std::max(edge, kShaftSoftest) : 0,
                 profile = sun_profile(softness);
    const Vec3& to_sun = s.light.to_sun;
    const double far_m = (c.base_m - place.z) / std::max(to_sun.z, 1e-3);
    if (place.z < c.ground_m || ellipse_value(ellipse_at(c, place.z), place.x, place.y) >= 1) return 0;
    double depth = 0;
    for (int n = 0; n < kSteps; ++n) {
        const Vec3 at = place + (n + 0.5) / kSteps * far_m * to_sun;
        const double r2 = ellipse_value(ellipse_at(c, at.z), at.x, at.y);
        if (r2 < 1) depth += (1 - profile + profile * (1 - r2) * (1 - r2)) * far_m / kSteps;
    }
    return 0.5 * whole_per_m * mean_water(c) * depth;
}

// The light with what the curtains around a place leave of the sun.
inline PrecipitationLight light_at(const Shafts& s, const Vec3& place) {
    PrecipitationLight light = s.light;
    double deepest = 0;
    for (std::size_t n = 0; n < s.curtains.size(); ++n)
        deepest = std::max(deepest, depth_to_sun(s, s.curtains[n], s.whole_per_m[n], place));
    for (double& channel : light.sun) channel *= std::exp(-deepest);
    return light;
}

inline Rgb arriving(const Shafts& s, const Vec3& ray, double t) {
    const Vec3 place = s.camera.position_m + t * ray;
    const Rgb own = particle_radiance(light_at(s, place), ray, place, double(sunlight_at(s.picture, place)));
    const PictureAir air = air_of(s.picture, s.options);
    const Vec3 to_sun = s.light.to_sun;
    const double level = std::sqrt((ray.x * ray.x + ray.y * ray.y) * (to_sun.x * to_sun.x + to_sun.y * to_sun.y));
    const double cosine = (ray.x * to_sun.x + ray.y * to_sun.y) / std::max(level, 1e-6);
    const double at = std::sqrt(std::max(0.5 - 0.5 * cosine, 0.0)) * (air.horizon.size() - 1);
    const auto below = std::min(std::size_t(at), air.horizon.size() - 2);
    Rgb seen;
    for (std::size_t c = 0; c < 3; ++c) {
        const double horizon = std::lerp(air.horizon[below][c], air.horizon[below + 1][c], at - double(below));
        seen[c] = std::lerp(horizon, own[c], std::exp(-air.extinction_per_m[c] * t));
    }
    return seen;
}

struct Through {
    double transmittance = 1;
    Rgb radiance{};
};

inline void add(Through& run, double depth, const Rgb& light) {
    for (std::size_t c = 0; c < 3; ++c)
        run.radiance[c] += run.transmittance * (1 - std::exp(-depth)) * light[c];
    run.transmittance *= std::exp(-depth);
}

// Steps from the beginning to the end of a part of a ray.
inline void march(const Shafts& s, const Vec3& ray, double offset, const Stretch& part, Through& run) {
    if (!(part.begin < part.end)) return;
    const double clear_m = s.options.precipitation.particles > 0 ? s.options.precipitation.depth_m : 0;
    const double step = (part.end - part.begin) / kShaftSteps;
    const auto place = [&](double i) {
        return s.camera.position_m + (part.begin + (i + offset) * step) * ray;
    };
    for (int light = 0; light < kShaftSteps; light += kShaftStepsPerLight) {
        const double middle = light + kShaftStepsPerLight / 2;
        double depth = 0;
        for (int i = light; i < light + kShaftStepsPerLight; ++i) {
            double densest = 0;
            for (std::size_t n = 0; n < s.curtains.size(); ++n)
                densest = std::max(densest, extinction(s, s.curtains[n], s.whole_per_m[n], place(i)) *
                                                falls_at(s, s.curtains[n], place(middle)));
            const double t = part.begin + (i + offset) * step;
            if (clear_m > 0) densest *= smooth(std::clamp(2 * t / clear_m - 1, 0.0, 1.0));
            depth += densest * step;
        }
        add(run, depth, arriving(s, ray, part.begin + (middle + offset) * step));
    }
}

// By how much of a step the steps of a pixel are displaced: see shader::kShaftOffsetX.
inline double shaft_offset(std::uint32_t x, std::uint32_t y) {
    const std::uint32_t sum = x * shader::kShaftOffsetX + y * shader::kShaftOffsetY;
    return 0.25 + 0.5 * double((sum >> 8) * shader::kShaftOffsetMix >> 8) / (1 << 24);
}

// A pixel of the picture with the shafts over it.
inline Rgb pixel_with_shafts(const Shafts& s, int x, int y) {
    const Vec3 ray = pixel_ray(s.camera, s.options.camera, x + 0.5, y + 0.5);
    const std::size_t pixel = std::size_t(y) * std::size_t(s.picture.width) + std::size_t(x);
    const double offset = shaft_offset(std::uint32_t(x), std::uint32_t(y));
    Through before, behind;
    for (const Stretch& stretch : stretches(s, ray)) {
        const double parting = std::clamp(double(s.picture.depth_m[pixel]), stretch.begin, stretch.end);
        march(s, ray, offset, {stretch.begin, parting}, before);
        march(s, ray, offset, {parting, stretch.end}, behind);
    }
    Rgb seen;
    for (std::size_t c = 0; c < 3; ++c) {
        const double was = double(s.picture.beauty[3 * pixel + c]),
                     left = double(s.picture.transmittance[pixel]);
        const double through = was + left * ((behind.transmittance - 1) * was + behind.radiance[c]);
        seen[c] = before.transmittance * through + before.radiance[c];
    }
    return seen;
}

}  // namespace nephos::reference
