// SPDX-License-Identifier: Apache-2.0
#include "density/veil_slab.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/math.h"
#include "density/veil_lattice.h"
#include "density/veil_plan.h"

namespace nephos {
namespace {

static_assert(VeilSlab::kPointLanes == kVeilLanes);

constexpr std::size_t kBatch = 512;  // points, a multiple of kVeilLanes
constexpr double kLeastRefinement = 0.8;  // of wavelengths, from an octave to a finer one
constexpr float kLeastDensity = 0x1p-10f;
constexpr float kStepVariance = 1.0f / 20;  // of the bell whose integral is smoothstep(), per squared width

double shortest(const VeilOctave& octave) {
    return std::min({octave.wavelength_m.x, octave.wavelength_m.y, octave.wavelength_m.z});
}

// Whether an octave of a veil that repeats has a lattice; of one that does not, always.
bool fits_the_tile(const VeilOctave& octave, const VeilOptions& options) {
    if (!(options.period_m.x > 0)) return true;
    const Rotation fibres = rotation_of_degrees(options.direction_deg);
    return veil_lattice({octave.wavelength_m.x, octave.wavelength_m.y}, fibres, options.period_m).wide > 0;
}

// The image of an offset that is nearest to the base: the integers of a lattice that repeats do not reach far.
float nearest(float offset_m, double period_m) {
    return period_m > 0 ? float(std::remainder(double(offset_m), period_m)) : offset_m;
}

// Says how an octave follows from the one before: by the powers of the options, or as the last octave of a list follows from
// the last but one if it is finer, in no direction coarser, and weighs less.
struct Progression {
    Vec3 wavelength{1, 1, 1};
    double displacement = 1, weight = 1;
};

Progression progression_of(const VeilOptions& options) {
    const Progression powers{Vec3(1 / options.lacunarity), 1 / options.lacunarity, options.persistence};
    if (options.octaves.size() < 2) return powers;
    const VeilOctave &last = options.octaves.back(), &before = options.octaves[options.octaves.size() - 2];
    const Vec3 ratio = last.wavelength_m / before.wavelength_m;
    const double finer = std::min({ratio.x, ratio.y, ratio.z}), coarser = std::max({ratio.x, ratio.y, ratio.z});
    const double weight = last.weight / before.weight;
    if (!(finer <= kLeastRefinement && coarser <= 1 && weight > 0 && weight < 1)) return powers;
    return {ratio, finer, weight};
}

// The options with finer octaves after theirs, as many as fit.
VeilOptions refined(const VeilOptions& options, int finer_octaves) {
    VeilOptions finer = options;
    finer.octaves = veil_octaves(options);
    const Progression next = progression_of(options);
    for (int n = 0; n < finer_octaves; ++n) {
        VeilOctave octave = finer.octaves.back();
        octave.wavelength_m = octave.wavelength_m * next.wavelength;
        octave.displacement_m = octave.displacement_m * next.displacement;
        octave.velocity_m_per_s = 0.8 * octave.velocity_m_per_s;
        octave.weight *= next.weight;
        if (!fits_the_tile(octave, options)) break;
        finer.octaves.push_back(octave);
    }
    return finer;
}

// Notes what remains of each octave where it is not resolved.
void measure_octaves(VeilPlan& plan, const std::vector<VeilOctave>& octaves) {
    for (std::size_t k = 0; k < plan.octaves.size(); ++k) {
        VeilPlan alone = plan;
        alone.octaves = {plan.octaves[k]};
        alone.octaves.front().weight = 1;
        alone.octaves.front().most_after = 0;
        double sum = 0, squares = 0;
        const std::vector<float> values = veil_samples(alone);
        for (const float value : values) {
            sum += value;
            squares += double(value) * value;
        }
        const double mean = sum / double(values.size());
        plan.octaves[k].mean = float(mean);
        plan.octaves[k].variance = float(std::max(0.0, squares / double(values.size()) - mean * mean));
        plan.octaves[k].shortest_m = float(shortest(octaves[k]));
    }
}

float pattern_of(float low, float high, float sum, float variance) {
    const float width = high - low, middle = 0.5f * (low + high);
    const float half = 0.5f * std::sqrt(width * width + variance / kStepVariance);
    const float t = std::clamp((sum - middle + half) / (2 * half), 0.0f, 1.0f);
    return t * t * (3 - 2 * t);
}

}  // namespace

VeilSlab::VeilSlab(const VeilOptions& options, const Wind& wind, double time_s, int finer_octaves,
                   const std::optional<VeilSides>& sides)
    : options_(options), sides_(sides) {
    if (finer_octaves < 0 || finer_octaves > kMostFinerOctaves)
        throw Error(ErrorCode::usage, "`finer_octaves` of a veil is " + std::to_string(finer_octaves) +
                                          ", expected 0 to " + std::to_string(kMostFinerOctaves));
    if (!std::isfinite(time_s) || std::abs(time_s) > 1e9)
        throw Error(ErrorCode::usage, "the time of a veil is beyond 1e9 s");
    const VeilOptions finer = refined(options, finer_octaves);
    auto plan = std::make_unique<VeilPlan>(veil_plan(finer, time_s));
    measure_octaves(*plan, finer.octaves);
    plan_ = std::move(plan);
    carried_m_ = wind_displacement_m(wind, options.top_m, time_s);
    finest_m_ = shortest(finer.octaves.front());
    for (const VeilOctave& octave : finer.octaves) finest_m_ = std::min(finest_m_, shortest(octave));
}

VeilSlab::~VeilSlab() = default;

void VeilSlab::densities(const Points& points, float* out) const {
    const Rotation fibres = rotation_of_degrees(options_.direction_deg),
                   yaw = rotation_of_degrees(options_.area.yaw_deg);
    const auto cos = float(fibres.cos), sin = float(fibres.sin);
    const double east = points.base_m.x - carried_m_.x, north = points.base_m.y - carried_m_.y;
    const auto base_z = float(points.base_m.z - options_.base_m);  // of the points' base above the slab's
    const double depth = options_.top_m - options_.base_m;
    const bool limited = std::isfinite(options_.area.semi_a_m) || std::isfinite(options_.area.semi_b_m);
    const VeilArea& area = options_.area;
    const Vec2& period = options_.period_m;
    const double area_x = area.x_m + (area.carried ? carried_m_.x : 0),
                 area_y = area.y_m + (area.carried ? carried_m_.y : 0);

    // The fraction of the density that heights, area and sides leave of a point.
    const auto weight_of = [&](std::size_t n) {
        const double up = double(base_z) + double(points.z[n]);
        double weight = fade_in(up, options_.soft_base_m) * fade_in(depth - up, options_.soft_top_m);
        if (weight <= 0) return 0.0f;
        const double x = points.base_m.x + double(points.x[n]), y = points.base_m.y + double(points.y[n]);
        if (limited) {
            double from_x = x - area_x, from_y = y - area_y;
            if (options_.period_m.x > 0) {  // from the nearest image of the centre
                from_x = std::remainder(from_x, options_.period_m.x);
                from_y = std::remainder(from_y, options_.period_m.y);
            }
            const double a = (from_x * yaw.cos + from_y * yaw.sin) / area.semi_a_m,
                         b = (from_y * yaw.cos - from_x * yaw.sin) / area.semi_b_m;
            weight *= fade_in(1 - std::sqrt(a * a + b * b), area.softness);
        }
        if (sides_) {
            weight *= fade_in(std::min(x - sides_->low_m.x, sides_->high_m.x - x), sides_->margin_m) *
                      fade_in(std::min(y - sides_->low_m.y, sides_->high_m.y - y), sides_->margin_m);
        }
        return float(weight);
    };

    std::array<float, kBatch> along, across, up, weight, sum, variance;
    for (std::size_t first = 0; first < points.count; first += kBatch) {
        const std::size_t count = std::min(kBatch, points.count - first);
        bool any = false;
        for (std::size_t n = 0; n < count; ++n) {
            weight[n] = weight_of(first + n);
            any = any || weight[n] >= kLeastDensity;
            const float x = nearest(points.x[first + n], period.x),
                        y = nearest(points.y[first + n], period.y);
            up[n] = base_z + points.z[first + n];
            const float fallen = std::max(0.0f, 1 - up[n] / float(depth));
            along[n] = x * cos + y * sin + float(options_.fallstreak_m) * fallen * fallen;
            across[n] = y * cos - x * sin;
        }
        if (!any) {
            std::fill_n(out + first, count, 0.0f);
            continue;
        }
        const VeilPoints at{
            {east * fibres.cos + north * fibres.sin, north * fibres.cos - east * fibres.sin, 0},
            {along.data(), across.data(), up.data()},
            count};
        resolved_veil_sums(*plan_, at, points.footprint_m + first, sum.data(), variance.data());
        const auto sheet = float(options_.sheet);
        for (std::size_t n = 0; n < count; ++n) {
            const float pattern = pattern_of(plan_->low, plan_->high, sum[n], variance[n]);
            const float density = (sheet + (1 - sheet) * pattern) * weight[n];
            out[first + n] = density < kLeastDensity ? 0.0f : density;
        }
    }
}

}  // namespace nephos
