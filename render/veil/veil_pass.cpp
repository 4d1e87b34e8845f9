// SPDX-License-Identifier: Apache-2.0
#include "render/veil/veil_pass.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <tbb/parallel_for.h>

#include "core/math.h"
#include "render/options/halo_phase.h"
#include "render/options/phase_function.h"
#include "render/veil/sheet_light.h"
#include "render/veil/slab_path.h"
#include "render/veil/veil_air.h"

namespace nephos {
namespace {

constexpr double kFarthest_m = 400'000;   // a veil at 12 km sets below the horizon before, seen from below
constexpr double kLeastSunCosine = 0.02;  // of the way out of the sheet towards the sun
constexpr double kMostSunPath_m = 20'000;
constexpr double kStepPerFinest = 0.5, kStepPixels = 1.5;  // of samples along a ray
// A sample stands for this part of the step to the next one: what is finer is not resolved along the ray.
constexpr float kFootprintPerStep = 0.6f;
constexpr int kFewestSamples = 4;
constexpr std::size_t kGroup = 2048;  // samples that are evaluated together

Rgb rgb(const shader::vec4& v) { return {double(v.x), double(v.y), double(v.z)}; }

// Fraction of the light that meets prisms of ice and leaves through two of their sides in this way.
constexpr double kHaloPerPrism = 0.12;

const HaloPhase& halo_phase() {
    static const HaloPhase phase;
    return phase;
}

// A veil as the rays of a picture meet it.
struct Sheet {
    const DrawnVeil* veil = nullptr;
    double base_m = 0, top_m = 0;  // above the eye
    Vec3 to_sun{};
    double sun_cosine = 1;  // >= kLeastSunCosine
    double bend = 0;        // earth_bend()
    double per_pixel = 0;   // footprint of a pixel at distance 1
    double ground_albedo = 0;
    double mean_factor = 1;  // of height_factor()
    double farthest_m = kFarthest_m;
    Rgb sun{}, sky{}, ground{};  // light of a white surface in the sun, below the sky, of the ground
    double thickness_m() const { return top_m - base_m; }
    // From a height out of the top, towards the sun.
    double sun_path_m(double height_m) const {
        return std::min((top_m - height_m) / sun_cosine, kMostSunPath_m);
    }
    // S's g: of the density at a height.
    double height_factor(double height_m) const {
        const double at = (height_m - 0.5 * (base_m + top_m)) / thickness_m();
        return std::max(0.0, veil->view.height_slope * at + veil->view.height_offset);
    }
    // The optical depth of a column of a density, reduced by the asymmetry.
    double reduced_depth(double density) const {
        const double edges = 0.8;  // what the soft ends leave of a column, about
        return (1 - veil->view.g) * veil->extinction_per_m * density * mean_factor * edges * thickness_m();
    }
};

// Points for VeilSlab::densities().
struct SlabPoints {
    std::vector<float> x, y, z, footprint, density;
    void clear() {
        for (auto* of : {&x, &y, &z, &footprint}) of->clear();
    }
    std::size_t size() const { return x.size(); }
    void add(double px, double py, double pz, double footprint_m) {
        x.push_back(float(px));
        y.push_back(float(py));
        z.push_back(float(pz));
        footprint.push_back(float(footprint_m));
    }
    void evaluate(const VeilSlab& slab, const Vec3& eye_m) {
        if (x.empty()) return;
        const std::size_t lanes = VeilSlab::kPointLanes, padded = (x.size() + lanes - 1) / lanes * lanes;
        for (auto* of : {&x, &y, &z, &footprint}) of->resize(padded, of->back());
        density.resize(padded);
        slab.densities({eye_m, x.data(), y.data(), z.data(), footprint.data(), padded}, density.data());
    }
};

// What a pixel sees of a veil.
struct SeenVeil {
    Rgb light{};  // radiance, weighted by what it covers
    double transmittance = 1, weighted_m = 0;
    double distance_m() const { return transmittance < 1 ? weighted_m / (1 - transmittance) : 0; }
};

struct Ray {
    double x = 0, y = 0, z = 0;
    double height(double t, double bend) const { return t * (z + bend * (1 - z * z) * t); }
};

// A run of samples of one pixel.
struct Samples {
    std::size_t pixel = 0, first = 0;
    int count = 0;
    double begin_m = 0, step_m = 0, last_m = 0;  // last_m: what the last sample stands for, at most step_m
    Ray ray;
    double stands_for_m(int i) const { return i + 1 < count ? step_m : last_m; }
    double distance_m(int i) const { return begin_m + i * step_m + 0.5 * stands_for_m(i); }
};

// Evaluates the samples of several pixels together.
class SampleGroup {
  public:
    SampleGroup(const Sheet& sheet, const Vec3& eye_m, std::vector<SeenVeil>& seen)
        : sheet_(sheet), eye_m_(eye_m), seen_(seen) {}

    void add(std::size_t pixel, const Ray& ray, const RayPart& part) {
        const VeilView& view = sheet_.veil->view;
        const double length = part.end - part.begin, middle = 0.5 * (part.begin + part.end);
        const double wanted =
            std::max(kStepPerFinest * sheet_.veil->slab->finest_m(), kStepPixels * sheet_.per_pixel * middle);
        // Steps change evenly from pixel to pixel, and what remains of the ray has a sample that counts less: with equal
        // steps their number would jump, which draws contours.
        const double step = std::clamp(wanted, length / view.samples, length / kFewestSamples);
        const int count = std::max(1, int(std::ceil(length / step - 1e-9)));
        runs_.push_back({pixel, points_.size(), count, part.begin, step, length - (count - 1) * step, ray});
        for (int i = 0; i < count; ++i) {
            const double t = runs_.back().distance_m(i);
            points_.add(ray.x * t, ray.y * t, ray.height(t, sheet_.bend),
                        std::max(sheet_.per_pixel * t, double(kFootprintPerStep) * step));
        }
        // The column in the middle, as light that is scattered often sees it.
        columns_.add(ray.x * middle, ray.y * middle, 0.5 * (sheet_.base_m + sheet_.top_m),
                     std::max(sheet_.thickness_m(), sheet_.per_pixel * middle));
        if (points_.size() >= kGroup) flush();
    }

    void flush() {
        const VeilSlab& slab = *sheet_.veil->slab;
        points_.evaluate(slab, eye_m_);
        columns_.evaluate(slab, eye_m_);
        towards_sun();
        std::size_t next_sun = 0;
        for (std::size_t r = 0; r < runs_.size(); ++r)
            shade(runs_[r], double(columns_.density[r]), next_sun, seen_[runs_[r].pixel]);
        points_.clear();
        columns_.clear();
        sun_.clear();
        runs_.clear();
    }

  private:
    // The second sample of each that holds cloud.
    void towards_sun() {
        const VeilView& view = sheet_.veil->view;
        for (const Samples& run : runs_) {
            for (int i = 0; i < run.count; ++i) {
                const std::size_t n = run.first + std::size_t(i);
                if (points_.density[n] <= 0) continue;
                const double way = view.light == VeilLighting::two_samples
                                       ? view.two_samples.sun_step_m
                                       : 0.5 * sheet_.sun_path_m(double(points_.z[n]));
                const double level = std::sqrt(std::max(0.0, 1 - sheet_.sun_cosine * sheet_.sun_cosine));
                const double across = std::hypot(sheet_.to_sun.x, sheet_.to_sun.y);
                const double per = across > 0 ? way * level / across : 0;
                sun_.add(double(points_.x[n]) + per * sheet_.to_sun.x,
                         double(points_.y[n]) + per * sheet_.to_sun.y,
                         double(points_.z[n]) + way * sheet_.sun_cosine,
                         double(points_.footprint[n]) + 0.1 * way);
            }
        }
        sun_.evaluate(*sheet_.veil->slab, eye_m_);
    }

    void shade(const Samples& run, double column, std::size_t& next_sun, SeenVeil& seen) const {
        const VeilView& view = sheet_.veil->view;
        const double cosine =
            run.ray.x * sheet_.to_sun.x + run.ray.y * sheet_.to_sun.y + run.ray.z * sheet_.to_sun.z;
        const double depth = sheet_.reduced_depth(column);
        const bool by_samples = view.light == VeilLighting::two_samples;
        const SheetLight often(depth, sheet_.sun_cosine, sheet_.ground_albedo);
        const double in_halo = kHaloPerPrism * view.halo;
        const std::array<double, 3> ring =
            in_halo > 0 && !by_samples ? halo_phase().at(cosine) : std::array<double, 3>{};
        const double once = (1 - in_halo) * std::numbers::pi * henyey_greenstein(cosine, view.g),
                     twice = std::numbers::pi * henyey_greenstein(cosine, view.g * view.g);
        for (int i = 0; i < run.count; ++i) {
            const std::size_t n = run.first + std::size_t(i);
            if (points_.density[n] <= 0) continue;
            const double z = double(points_.z[n]),
                         density = sheet_.height_factor(z) * double(points_.density[n]);
            const double sun_z = double(sun_.z[next_sun]),
                         towards = sheet_.height_factor(sun_z) * double(sun_.density[next_sun]);
            ++next_sun;
            const double optical = sheet_.veil->extinction_per_m * density * run.stands_for_m(i);
            const double covers =
                seen.transmittance * (by_samples ? std::min(optical, 1.0) : 1 - std::exp(-optical));
            Rgb light;
            if (by_samples) {
                light = two_sample_light(view.two_samples, cosine, density, towards, z);
            } else {
                const double to_sun =
                    sheet_.veil->extinction_per_m * sheet_.sun_path_m(z) * (density + 4 * towards) / 6;
                const double left = std::exp(-to_sun), ahead = std::exp(-(1 - view.g) * to_sun);
                const double above = depth * std::clamp((sheet_.top_m - z) / sheet_.thickness_m(), 0.0, 1.0);
                const double of_sun =
                    once * left + twice * (ahead - left) + std::max(0.0, often.by_sun(above));
                const double of_sky = std::max(0.0, often.by_sky(above)),
                             of_ring = in_halo * std::numbers::pi * left;
                for (std::size_t c = 0; c < 3; ++c)
                    light[c] = (of_sun + of_ring * ring[c]) * sheet_.sun[c] + of_sky * sheet_.sky[c];
            }
            for (std::size_t c = 0; c < 3; ++c) seen.light[c] += covers * light[c];
            seen.weighted_m += covers * run.distance_m(i);
            seen.transmittance -= covers;
        }
    }

    // S's light; `cosine`: of the angle between the ray and the direction to the sun.
    Rgb two_sample_light(const TwoSampleLight& s, double cosine, double here, double towards,
                         double z) const {
        const double gr = std::clamp((z - sheet_.base_m) / sheet_.thickness_m(), 0.0, 1.0);
        const double df = std::clamp(
            std::pow(std::max(0.0, s.shade_gain * (here - towards) + s.shade_offset), s.shade_power), 0.0,
            1.0);
        // v = -ray; h . v = sqrt((1 + l . v) / 2).
        const double half = std::sqrt(std::clamp(0.5 * (1 - cosine), 0.0, 1.0));
        const double glow = s.glow_gain * std::pow(1 - half, s.glow_power),
                     bounce = std::pow(1 - gr, s.bounce_power);
        Rgb light;
        for (std::size_t c = 0; c < 3; ++c) {
            const double around = sheet_.sky[c] + (sheet_.sun[c] - sheet_.sky[c]) * gr;
            light[c] = around + (sheet_.sun[c] * glow - around) * df + sheet_.ground[c] * bounce;
        }
        return light;
    }

    const Sheet& sheet_;
    Vec3 eye_m_;
    std::vector<SeenVeil>& seen_;
    std::vector<Samples> runs_;
    SlabPoints points_, columns_, sun_;
};

Sheet sheet_of(const VeilPass& pass, const DrawnVeil& veil) {
    Sheet sheet;
    sheet.veil = &veil;
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
                beauty = behind ? beauty + left * (own - (1 - through) * sky[c][x]) : through * beauty + own;
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
