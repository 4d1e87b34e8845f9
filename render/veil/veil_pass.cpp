// SPDX-License-Identifier: Apache-2.0
#include "render/veil/veil_pass.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <tbb/parallel_for.h>

#include "core/math.h"
#include "render/veil/sheet_light.h"
#include "render/veil/slab_path.h"
#include "render/veil/veil_air.h"
#include "render/veil/veil_samples.h"

namespace nephos {
namespace {

constexpr double kLeastSunCosine = 0.02;  // of the way out of the sheet towards the sun

Rgb rgb(const shader::vec4& v) { return {double(v.x), double(v.y), double(v.z)}; }

Sheet sheet_of(const VeilPass& pass, const DrawnVeil& veil) {
    Sheet sheet;
    sheet.veil = &veil;
    sheet.frame = &pass.frame;
    sheet.base_m = veil.slab->base_m() - pass.eye_m.z;
    sheet.top_m = veil.slab->top_m() - pass.eye_m.z;
    const shader::vec4& sun = pass.frame.to_sun;
    sheet.to_sun = {double(sun.x), double(sun.y), double(sun.z)};
    sheet.sun_cosine = std::clamp(sheet.to_sun.z, kLeastSunCosine, 1.0);
    sheet.bend = double(pass.frame.earth.z);
    sheet.per_pixel = 1 / double(pass.frame.up.w);
    if (const double above = std::max(0.0, -sheet.top_m); above > 0)  // to its horizon
        sheet.farthest_m += sheet.bend > 0 ? std::sqrt(above / sheet.bend) : 100 * above;
    constexpr int kHeights = 64;
    sheet.mean_factor = 0;
    for (int i = 0; i < kHeights; ++i)
        sheet.mean_factor +=
            sheet.height_factor(sheet.base_m + (i + 0.5) / kHeights * sheet.thickness_m()) / kHeights;
    sheet.sun = sunlight_at_height(pass.frame, 0.5 * (sheet.base_m + sheet.top_m));
    sheet.sky = rgb(pass.frame.ambient_top);
    for (std::size_t c = 0; c < 3; ++c) {
        sheet.ground_albedo += pass.ground_albedo[c] / 3;
        sheet.ground[c] = rgb(pass.frame.ground)[c] + rgb(pass.frame.ground_sun)[c];
    }
    return sheet;
}

// A row of a picture while a veil is drawn into it.
struct Row {
    const VeilPass& pass;
    const Sheet& sheet;
    RowRays rays;
    Picture& picture;
    std::size_t first, width;

    Ray ray(std::size_t x) const { return {double(rays.x[x]), double(rays.y[x]), double(rays.z[x])}; }
    bool has_ground(std::size_t x) const { return rays.ground_m[x] < float(sheet.farthest_m); }

    // What lies behind all clouds: sky, level ground, terrain as it was drawn.
    RowColours background() const {
        RowColours colours = row_background(pass.frame, rays, pass.shadow, pass.shadow_size);
        if (picture.terrain_m.empty()) return colours;
        for (std::size_t x = 0; x < width; ++x) {
            if (!(picture.terrain_m[first + x] < 1.0e30f)) continue;
            for (std::size_t c = 0; c < 3; ++c) colours[c][x] = picture.terrain_light[3 * (first + x) + c];
        }
        return colours;
    }

    // Darkens the ground by what the sheet keeps of the light.
    void shade_ground() {
        SlabPoints columns;
        std::vector<std::size_t> pixels;
        const double middle = 0.5 * (sheet.base_m + sheet.top_m);
        const double across = std::hypot(sheet.to_sun.x, sheet.to_sun.y);
        for (std::size_t x = 0; x < width; ++x) {
            if (!has_ground(x) || picture.transmittance[first + x] <= 0) continue;
            const double t = double(rays.ground_m[x]);
            const Ray way = ray(x);
            const double rise = middle - way.height(t, sheet.bend);
            if (rise <= 0) continue;
            const double out = std::min(rise / sheet.sun_cosine, 2 * kMostSunPath_m),
                         level = std::sqrt(std::max(0.0, 1 - sheet.sun_cosine * sheet.sun_cosine));
            const double per = across > 0 ? out * level / across : 0;
            columns.add(way.x * t + per * sheet.to_sun.x, way.y * t + per * sheet.to_sun.y, middle,
                        std::max(0.25 * sheet.thickness_m(), sheet.per_pixel * t));
            pixels.push_back(x);
        }
        if (pixels.empty()) return;
        columns.evaluate(*sheet.veil->slab, pass.eye_m);
        const RowAir air = row_air(pass.frame, rays, rays.ground_m);
        const RowColours behind = background();
        const Rgb sunlit = rgb(pass.frame.ground_sun), skylit = rgb(pass.frame.ground);
        for (std::size_t n = 0; n < pixels.size(); ++n) {
            const SheetLight light(sheet.reduced_depth(double(columns.density[n])), sheet.sun_cosine,
                                   sheet.ground_albedo);
            const std::size_t x = pixels[n];
            const float left = picture.transmittance[first + x];
            for (std::size_t c = 0; c < 3; ++c) {
                const double open = sunlit[c] + skylit[c],
                             below = sunlit[c] * light.below_by_sun() / sheet.sun_cosine +
                                     skylit[c] * light.below_by_sky();
                float& beauty = picture.beauty[3 * (first + x) + c];
                // Where no cloud is before it, the ground as it was drawn; else the plain one.
                const float ground = left * (left * (beauty - air.light[c][x]) +
                                             (1 - left) * (behind[c][x] - air.light[c][x]));
                if (open > 0) beauty += std::max(0.0f, ground) * float(below / open - 1);
            }
        }
    }

    void composite(const std::vector<SeenVeil>& seen) {
        std::vector<float> distance(rays.x.size(), 1.0f);
        bool behind_cloud = false, any = false;
        const auto is_behind = [&](std::size_t x) {
            return seen[x].distance_m() > double(picture.depth_m[first + x]);
        };
        for (std::size_t x = 0; x < width; ++x) {
            if (seen[x].transmittance >= 1) continue;
            any = true;
            distance[x] = float(seen[x].distance_m());
            behind_cloud = behind_cloud || is_behind(x);
        }
        if (!any) return;
        const RowAir air = row_air(pass.frame, rays, distance);
        RowColours sky;
        if (behind_cloud) sky = background();
        for (std::size_t x = 0; x < width; ++x) {
            if (seen[x].transmittance >= 1) continue;
            float& left = picture.transmittance[first + x];
            float& depth = picture.depth_m[first + x];
            const auto through = float(seen[x].transmittance);
            const bool behind = is_behind(x);
            for (std::size_t c = 0; c < 3; ++c) {
                float& beauty = picture.beauty[3 * (first + x) + c];
                const float own = air.beta[c][x] * float(seen[x].light[c]) + (1 - through) * air.light[c][x];
                if (!behind) {
                    beauty = through * beauty + own;
                    continue;
                }
                // The sky may have a sun that is 60,000 times as bright as white: rounding of it must not be darker than black.
                beauty = std::max(beauty + left * (own - (1 - through) * sky[c][x]), 0.0f);
            }
            const float opacity = 1 - left, more = 1 - through;
            const float mine = behind ? left * more : more, others = behind ? opacity : through * opacity;
            left *= through;
            if (mine + others >= kLeastOpacity)
                depth = (mine * distance[x] + (others > 0 && std::isfinite(depth) ? others * depth : 0)) /
                        (mine + (std::isfinite(depth) ? others : 0));
        }
    }
};

void draw_row(const VeilPass& pass, const Sheet& sheet, std::size_t y, Picture& picture) {
    const auto width = std::size_t(picture.width);
    Row row{pass, sheet, row_rays(pass.frame, y, width), picture, y * width, width};
    if (!picture.terrain_m.empty())
        for (std::size_t x = 0; x < width; ++x)
            row.rays.ground_m[x] = std::min(row.rays.ground_m[x], picture.terrain_m[row.first + x]);
    row.shade_ground();
    std::vector<SeenVeil> seen(width);
    SampleGroup samples(sheet, pass.eye_m, seen);
    for (std::size_t x = 0; x < width; ++x) {
        const Ray ray = row.ray(x);
        const double limit = std::min(double(row.rays.ground_m[x]), sheet.farthest_m);
        const auto parts = parts_in_slab(ray.z, sheet.bend, sheet.base_m, sheet.top_m, limit);
        const bool hidden = picture.transmittance[row.first + x] <= 0 &&
                            double(picture.depth_m[row.first + x]) < parts.front().begin;
        if (hidden) continue;
        for (const RayPart& part : parts)
            if (part.any()) samples.add(x, ray, part);
    }
    samples.flush();
    row.composite(seen);
}

}  // namespace

void draw_veils(const VeilPass& pass, Picture& picture) {
    std::vector<Sheet> sheets;
    for (const DrawnVeil& veil : pass.veils) sheets.push_back(sheet_of(pass, veil));
    const auto away = [](const Sheet& s) { return std::max({0.0, s.base_m, -s.top_m}); };
    std::ranges::stable_sort(sheets, [&](const Sheet& a, const Sheet& b) { return away(a) > away(b); });
    for (const Sheet& sheet : sheets)
        tbb::parallel_for(std::size_t{0}, std::size_t(picture.height),
                          [&](std::size_t y) { draw_row(pass, sheet, y, picture); });
}

}  // namespace nephos
