// SPDX-License-Identifier: Apache-2.0
#include "render/veil/veil_samples.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>

#include "render/frame/frame_data.h"
#include "render/options/halo_phase.h"
#include "render/options/phase_function.h"

namespace nephos {
namespace {

constexpr double kStepPerFinest = 0.5;  // of samples along a ray
// Steps in pixels: longer ones of physical light show threads with a moire; S's light depends on their length.
constexpr double kStepPixels = 0.75, kStepPixelsOfTwoSamples = 1.5;
// A sample stands for this part of the step to the next one: what is finer is not resolved along the ray.
constexpr double kFootprintPerStep = 0.6;
constexpr int kFewestSamples = 4;
constexpr double kPartDepth = 0.5;  // optical, of a part of a step, where the density is 1
constexpr int kMostParts = 6;       // of a step
constexpr int kStepsAtOnce = 4;     // of a run
constexpr std::size_t kRuns = 1024;
// A ray ends at this many times the transmittance behind which nothing is seen: beside the sun what remains is less than a step
// of a picture of 8 bits.
constexpr double kOpaqueFactor = 8;

// Fraction of the light that meets prisms of ice and leaves through two of their sides in this way.
constexpr double kHaloPerPrism = 0.12;

const HaloPhase& halo_phase() {
    static const HaloPhase phase;
    return phase;
}

}  // namespace

SampleGroup::SampleGroup(const Sheet& sheet, const Vec3& eye_m, std::vector<SeenVeil>& seen)
    : sheet_(sheet), eye_m_(eye_m), seen_(seen), towards_sun_(0, 0, sheet.sun_cosine) {
    const double level = std::sqrt(std::max(0.0, 1 - sheet.sun_cosine * sheet.sun_cosine)),
                 across = std::hypot(sheet.to_sun.x, sheet.to_sun.y);
    if (across <= 0) return;
    towards_sun_.x = level / across * sheet.to_sun.x;
    towards_sun_.y = level / across * sheet.to_sun.y;
}

void SampleGroup::add(std::size_t pixel, const Ray& ray, const RayPart& part) {
    const DrawnVeil& veil = *sheet_.veil;
    const double length = part.end - part.begin, middle = 0.5 * (part.begin + part.end);
    const double pixels = veil.view.light == VeilLighting::two_samples ? kStepPixelsOfTwoSamples : kStepPixels;
    const double wanted = std::max(kStepPerFinest * veil.slab->finest_m(), pixels * sheet_.per_pixel * middle);
    const bool follows = !runs_.empty() && runs_.back().pixel == pixel;
    if (!follows && runs_.size() >= kRuns) flush();
    Run& run = runs_.emplace_back();
    run.pixel = pixel;
    run.ray = ray;
    run.follows = follows;
    run.begin_m = part.begin;
    // Steps change evenly from pixel to pixel, and what remains of the ray has a sample that counts less: with equal
    // steps their number would jump, which draws contours.
    run.step_m = std::clamp(wanted, length / veil.view.samples, length / kFewestSamples);
    run.count = std::max(1, int(std::ceil(length / run.step_m - 1e-9)));
    run.last_m = length - (run.count - 1) * run.step_m;
    // Nor does the footprint of parts jump with their number.
    const double thin = kPartDepth / (veil.extinction_per_m * sheet_.most_factor());
    run.part_m = std::clamp(std::max(wanted, thin), run.step_m / kMostParts, run.step_m);
    run.parts = int(std::ceil(run.step_m / run.part_m - 1e-9));
    run.first = densities_.size();
    densities_.resize(densities_.size() + std::size_t(run.count));
    // The column in the middle, as light that is scattered often sees it.
    columns_.add(ray.x * middle, ray.y * middle, 0.5 * (sheet_.base_m + sheet_.top_m),
                 std::max(sheet_.thickness_m(), sheet_.per_pixel * middle));
}

void SampleGroup::flush() {
    columns_.evaluate(*sheet_.veil->slab, eye_m_);
    for (std::size_t r = 0; r < runs_.size(); ++r) prepare_light(runs_[r], double(columns_.density[r]));
    while (look_ahead()) {
        add_parts();
        cover();
        light();
    }
    columns_.clear();
    densities_.clear();
    runs_.clear();
}

void SampleGroup::prepare_light(Run& run, double column) const {
    const VeilView& view = sheet_.veil->view;
    run.cosine = run.ray.x * sheet_.to_sun.x + run.ray.y * sheet_.to_sun.y + run.ray.z * sheet_.to_sun.z;
    const double chord = glm::distance(Vec3(run.ray.x, run.ray.y, run.ray.z), sheet_.to_sun);
    run.opaque = kOpaqueFactor * double(opaque_beside_sun(*sheet_.frame, float(chord)));
    if (view.light == VeilLighting::two_samples) {
        // v = -ray; h . v = sqrt((1 + l . v) / 2).
        const double half = std::sqrt(std::clamp(0.5 * (1 - run.cosine), 0.0, 1.0));
        run.glow = view.two_samples.glow_gain * std::pow(1 - half, view.two_samples.glow_power);
        return;
    }
    run.depth = sheet_.reduced_depth(column);
    run.often = SheetLight(run.depth, sheet_.sun_cosine, sheet_.ground_albedo);
    run.in_halo = kHaloPerPrism * view.halo;
    if (run.in_halo > 0) run.ring = halo_phase().at(run.cosine);
    run.once = (1 - run.in_halo) * std::numbers::pi * henyey_greenstein(run.cosine, view.g);
    run.twice = std::numbers::pi * henyey_greenstein(run.cosine, view.g * view.g);
}

// Finds the density of the next steps of each ray that goes on. Returns false when all have ended.
bool SampleGroup::look_ahead() {
    points_.clear();
    for (std::size_t r = 0; r < runs_.size(); ++r) {
        Run& run = runs_[r];
        if (run.ended()) continue;
        if (seen_[run.pixel].transmittance <= run.opaque) {
            run.done = run.count;
            continue;
        }
        if (run.follows && !runs_[r - 1].ended()) continue;
        const int end = std::min(run.known + kStepsAtOnce, run.count);
        for (int i = run.known; i < end; ++i) {
            const double t = run.begin_m + i * run.step_m + 0.5 * run.length_m(i);
            points_.add(run.ray.x * t, run.ray.y * t, run.ray.height(t, sheet_.bend),
                        std::max(sheet_.per_pixel * t, kFootprintPerStep * run.step_m));
        }
        run.known = end;
    }
    if (points_.size() == 0) return false;
    points_.evaluate(*sheet_.veil->slab, eye_m_);
    std::size_t next = 0;
    for (std::size_t r = 0; r < runs_.size(); ++r) {
        Run& run = runs_[r];
        for (int& i = run.looked; i < run.known; ++i) densities_[run.first + std::size_t(i)] = points_.density[next++];
    }
    return true;
}

// Divides the steps that have cloud in them or beside them.
void SampleGroup::add_parts() {
    points_.clear();
    parts_.clear();
    for (std::size_t r = 0; r < runs_.size(); ++r) {
        Run& run = runs_[r];
        const auto density = [&](int i) {
            return i >= 0 && i < run.count ? densities_[run.first + std::size_t(i)] : 0.0f;
        };
        const int ready = run.known == run.count ? run.count : std::max(run.done, run.known - 1);
        for (; run.done < ready; ++run.done) {
            const int i = run.done;
            const double length = run.length_m(i), begin = run.begin_m + i * run.step_m;
            if (run.parts == 1) {
                if (density(i) > 0) add_part(r, begin + 0.5 * length, length, run.step_m, density(i));
                continue;
            }
            if (std::max({density(i - 1), density(i), density(i + 1)}) <= 0) continue;
            const int parts = std::max(1, int(std::ceil(length / run.part_m - 1e-9)));
            for (int p = 0; p < parts; ++p) {
                const Part& part = add_part(r, begin + length * (p + 0.5) / parts, length / parts, run.part_m, -1);
                points_.add(part.x, part.y, part.z, part.footprint_m);
            }
        }
    }
    points_.evaluate(*sheet_.veil->slab, eye_m_);
    std::size_t next = 0;
    for (Part& part : parts_)
        if (part.density < 0) part.density = double(points_.density[next++]);
}

SampleGroup::Part& SampleGroup::add_part(std::size_t r, double t, double length_m, double resolved_m, float density) {
    const Ray& ray = runs_[r].ray;
    return parts_.emplace_back(Part{.run = r,
                                    .distance_m = t,
                                    .length_m = length_m,
                                    .x = ray.x * t,
                                    .y = ray.y * t,
                                    .z = ray.height(t, sheet_.bend),
                                    .footprint_m = std::max(sheet_.per_pixel * t, kFootprintPerStep * resolved_m),
                                    .density = double(density)});
}

// Composites what parts cover, and adds the second sample of each that is seen.
void SampleGroup::cover() {
    const VeilView& view = sheet_.veil->view;
    lit_.clear();
    sun_.clear();
    for (const Part& part : parts_) {
        SeenVeil& seen = seen_[runs_[part.run].pixel];
        if (part.density <= 0 || seen.transmittance <= runs_[part.run].opaque) continue;
        const double density = sheet_.height_factor(part.z) * part.density,
                     optical = sheet_.veil->extinction_per_m * density * part.length_m;
        const double covers = seen.transmittance * (view.light == VeilLighting::two_samples
                                                        ? std::min(optical, 1.0)
                                                        : 1 - std::exp(-optical));
        seen.transmittance -= covers;
        seen.weighted_m += covers * part.distance_m;
        lit_.push_back({part.run, part.z, density, covers});
        add_towards_sun(part);
    }
}

void SampleGroup::add_towards_sun(const Part& part) {
    const VeilView& view = sheet_.veil->view;
    const double way = view.light == VeilLighting::two_samples ? view.two_samples.sun_step_m
                                                               : 0.5 * sheet_.sun_path_m(part.z);
    sun_.add(part.x + way * towards_sun_.x, part.y + way * towards_sun_.y, part.z + way * towards_sun_.z,
             part.footprint_m + 0.1 * way);
}

void SampleGroup::light() {
    sun_.evaluate(*sheet_.veil->slab, eye_m_);
    for (std::size_t n = 0; n < lit_.size(); ++n) {
        const Lit& lit = lit_[n];
        const Run& run = runs_[lit.run];
        const double towards = sheet_.height_factor(double(sun_.z[n])) * double(sun_.density[n]);
        const Rgb light = sheet_.veil->view.light == VeilLighting::two_samples
                              ? two_sample_light(run, lit.density, towards, lit.z)
                              : physical_light(run, lit.density, towards, lit.z);
        for (std::size_t c = 0; c < 3; ++c) seen_[run.pixel].light[c] += lit.covers * light[c];
    }
}

Rgb SampleGroup::physical_light(const Run& run, double here, double towards, double z) const {
    const double to_sun = sheet_.veil->extinction_per_m * sheet_.sun_path_m(z) * (here + 4 * towards) / 6;
    const double left = std::exp(-to_sun), ahead = std::exp(-(1 - sheet_.veil->view.g) * to_sun);
    const double above = run.depth * std::clamp((sheet_.top_m - z) / sheet_.thickness_m(), 0.0, 1.0);
    const double of_sun =
        run.once * left + run.twice * (ahead - left) + std::max(0.0, run.often.by_sun(above));
    const double of_sky = std::max(0.0, run.often.by_sky(above)), of_ring = run.in_halo * std::numbers::pi * left;
    Rgb light;
    for (std::size_t c = 0; c < 3; ++c)
        light[c] = (of_sun + of_ring * run.ring[c]) * sheet_.sun[c] + of_sky * sheet_.sky[c];
    return light;
}

// S's light.
Rgb SampleGroup::two_sample_light(const Run& run, double here, double towards, double z) const {
    const TwoSampleLight& s = sheet_.veil->view.two_samples;
    const double gr = std::clamp((z - sheet_.base_m) / sheet_.thickness_m(), 0.0, 1.0);
    const double df = std::clamp(
        std::pow(std::max(0.0, s.shade_gain * (here - towards) + s.shade_offset), s.shade_power), 0.0,
        1.0);
    const double bounce = std::pow(1 - gr, s.bounce_power);
    Rgb light;
    for (std::size_t c = 0; c < 3; ++c) {
        const double around = sheet_.sky[c] + (sheet_.sun[c] - sheet_.sky[c]) * gr;
        light[c] = around + (sheet_.sun[c] * run.glow - around) * df + sheet_.ground[c] * bounce;
    }
    return light;
}

}  // namespace nephos
