// SPDX-License-Identifier: Apache-2.0
#include "density/veil_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "core/math.h"
#include "core/noise_hash.h"

namespace nephos {
namespace {

constexpr int kSampleGroups = 64, kSamplesInGroup = 256;

// The thresholds: quantiles 1 - coverage and 1 - coverage (1 - softness) of q.
void set_thresholds(VeilPlan& plan, const VeilOptions& options) {
    std::vector<float> values = veil_samples(plan);
    std::ranges::sort(values);
    const auto quantile = [&](double fraction) {
        const double last = double(values.size() - 1);
        return values[std::size_t(std::clamp(fraction, 0.0, 1.0) * last)];
    };
    plan.low = quantile(1 - options.coverage);
    plan.high = quantile(1 - options.coverage * (1 - options.softness));
    // A step of some width, so that there is something to divide by.
    const float least = std::max(1e-6f, 1e-6f * std::abs(plan.low));
    plan.high = std::max(plan.high, plan.low + least);
}

// The largest |value| and the largest value of an octave's N, |noise| being at most 1.
struct Reach {
    double low = 0, high = 0;
};

Reach reach_of(const VeilOctave& octave, bool ridged) {
    const double gain = std::abs(octave.gain);
    Reach reach{octave.offset - gain, octave.offset + gain};
    if (!ridged) return reach;
    const double nearest = std::max({0.0, reach.low - octave.crest, octave.crest - reach.high});
    const double farthest = std::max(std::abs(reach.low - octave.crest), std::abs(reach.high - octave.crest));
    return {octave.ridge - farthest, octave.ridge - nearest};
}

bool is_ridged(VeilForm form) { return form == VeilForm::cumulus || form == VeilForm::cirrus; }
bool is_displaced(VeilForm form) { return form == VeilForm::cirrus || form == VeilForm::cirrostratus; }

VeilOctavePlan octave_plan(const VeilOctave& octave, std::uint64_t seed, std::size_t k, double time_s) {
    VeilOctavePlan plan;
    const std::array wavelength{octave.wavelength_m.x, octave.wavelength_m.y, octave.wavelength_m.z};
    const std::array velocity{octave.velocity_m_per_s.x, octave.velocity_m_per_s.y,
                              octave.velocity_m_per_s.z};
    const std::uint32_t own =
        mix_bits(std::uint32_t(seed) + mix_bits(std::uint32_t(seed >> 32) + std::uint32_t(k) * kAxisStep));
    plan.seeds = axis_seeds(own);
    for (std::size_t axis = 0; axis < 3; ++axis) {
        plan.per_m[axis] = 1 / wavelength[axis];
        const double place = mix_bits(plan.seeds[axis] + 1) * 0x1p-16;
        plan.phase[axis] = place - velocity[axis] * time_s / wavelength[axis];
    }
    plan.displacement_m = {float(octave.displacement_m.x), float(octave.displacement_m.y),
                           float(octave.displacement_m.z)};
    plan.weight = float(octave.weight);
    plan.gain = float(octave.gain);
    plan.offset = float(octave.offset);
    plan.ridge = float(octave.ridge);
    plan.crest = float(octave.crest);
    return plan;
}

VeilPlan plan_of(const VeilOptions& options, double time_s) {
    VeilPlan plan;
    plan.repeats = options.period_m.x > 0;
    const Rotation fibres = rotation_of_degrees(options.direction_deg);
    plan.ridged = is_ridged(options.form);
    plan.displaced = is_displaced(options.form);
    const std::vector<VeilOctave> octaves = veil_octaves(options);
    double weights = 0;
    for (std::size_t k = 0; k < octaves.size(); ++k) {
        plan.octaves.push_back(octave_plan(octaves[k], options.seed, k, time_s));
        const Vec3& wavelength = octaves[k].wavelength_m;
        if (plan.repeats) {
            plan.octaves.back().lattice =
                veil_lattice({wavelength.x, wavelength.y}, fibres, options.period_m);
        }
        const Reach reach = reach_of(octaves[k], plan.ridged);
        weights += std::abs(octaves[k].weight) * std::max(std::abs(reach.low), std::abs(reach.high));
    }
    double most = 1e-4 * weights;  // what roundings may come to, amply
    for (std::size_t k = octaves.size(); k-- > 0;) {
        plan.octaves[k].most_after = float(most);
        const Reach reach = reach_of(octaves[k], plan.ridged);
        most += std::max(octaves[k].weight * reach.low, octaves[k].weight * reach.high);
    }
    return plan;
}

}  // namespace

// 64 places of the frame far apart with 256 points around each.
std::vector<float> veil_samples(const VeilPlan& plan) {
    std::array<double, 3> spread{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        double finest = 0;
        for (const VeilOctavePlan& octave : plan.octaves) finest = std::max(finest, octave.per_m[axis]);
        spread[axis] = std::min(32 / plan.octaves.front().per_m[axis], 0x1p15 / finest);
    }
    std::array<std::vector<float>, 3> from_base;
    for (auto& axis : from_base) axis.resize(kSamplesInGroup);
    std::vector<float> values(std::size_t(kSampleGroups * kSamplesInGroup));
    std::uint32_t draw = plan.octaves.front().seeds[0];
    const auto unit = [&] {
        draw += kAxisStep;
        return mix_bits(draw) * 0x1p-32;
    };
    for (int group = 0; group < kSampleGroups; ++group) {
        VeilPoints points;
        points.count = kSamplesInGroup;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            points.base_m[axis] = spread[axis] * 4096 * unit();
            for (float& at : from_base[axis]) at = float(spread[axis] * (2 * unit() - 1));
            points.from_base_m[axis] = from_base[axis].data();
        }
        veil_sums(plan, points, -std::numeric_limits<float>::infinity(),
                  &values[std::size_t(group * kSamplesInGroup)]);
    }
    return values;
}

VeilThresholds veil_thresholds(const VeilOptions& options) {
    VeilOptions endless = options;  // quantiles of the noise, not of one period of it
    endless.period_m = {0, 0};
    VeilPlan plan = plan_of(endless, 0);
    set_thresholds(plan, options);
    return {plan.low, plan.high};
}

VeilPlan veil_plan(const VeilOptions& options, double time_s) {
    VeilPlan plan = plan_of(options, time_s);
    const VeilThresholds thresholds = veil_thresholds(options);
    plan.low = thresholds.low;
    plan.high = thresholds.high;
    return plan;
}

double fade_in(double from_end, double width) {
    if (from_end <= 0) return 0;
    return width > 0 ? smoothstep(0, width, from_end) : 1;
}

}  // namespace nephos
