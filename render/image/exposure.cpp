// SPDX-License-Identifier: Apache-2.0
#include "render/image/exposure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace nephos {
namespace {

// Bins of the logarithm to base 2 of the luminance.
constexpr int kBinsPerStop = 32, kLowest_ev = -40, kHighest_ev = 24;
constexpr std::size_t kBins = std::size_t(kBinsPerStop) * (kHighest_ev - kLowest_ev);

constexpr double kLow = 0.50, kHigh = 0.98;  // percentiles that are measured
constexpr double kGoal = 0.42;               // radiance; the brighter half of a noon sky with clouds has about that
constexpr double kCompensation = 0.8;        // of the difference
constexpr double kLeast_ev = -6, kMost_ev = 12;

struct Histogram {
    std::array<std::uint64_t, kBins> counts{};
    std::uint64_t sum = 0;  // of them; pixels without light are left out
};

Histogram histogram_of(const Picture& picture) {
    Histogram histogram;
    const std::size_t pixels = picture.beauty.size() / 3;
    for (std::size_t i = 0; i < pixels; ++i) {
        const float* rgb = &picture.beauty[3 * i];
        const float luminance = 0.2126f * rgb[0] + 0.7152f * rgb[1] + 0.0722f * rgb[2];
        if (!(luminance > 0.0f) || !std::isfinite(luminance)) continue;
        const double bin = (std::log2(double(luminance)) - kLowest_ev) * kBinsPerStop;
        ++histogram.counts[std::size_t(std::clamp(bin, 0.0, double(kBins - 1)))];
        ++histogram.sum;
    }
    return histogram;
}

}  // namespace

double metered_ev(const Picture& picture) {
    const Histogram histogram = histogram_of(picture);
    if (histogram.sum == 0) return 0;
    const double from = kLow * double(histogram.sum), to = kHigh * double(histogram.sum);
    double below = 0, weight = 0, mean = 0;
    for (std::size_t bin = 0; bin < kBins; ++bin) {
        const double above = below + double(histogram.counts[bin]);
        const double here = std::max(0.0, std::min(above, to) - std::max(below, from));
        weight += here;
        mean += here * ((double(bin) + 0.5) / kBinsPerStop + kLowest_ev);
        below = above;
    }
    return std::clamp(kCompensation * (std::log2(kGoal) - mean / weight), kLeast_ev, kMost_ev);
}

double exposure_ev(const Picture& picture, const Camera& camera) {
    if (camera.exposure == Exposure::manual) return camera.exposure_ev;
    return camera.exposure_ev + metered_ev(picture);
}

double adapted_ev(double before_ev, double target_ev, double elapsed_s, double adaptation_s) {
    if (!(adaptation_s > 0)) return target_ev;
    return target_ev + (before_ev - target_ev) * std::exp(-elapsed_s / adaptation_s);
}

}  // namespace nephos
