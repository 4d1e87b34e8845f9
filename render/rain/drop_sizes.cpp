// SPDX-License-Identifier: Apache-2.0
#include "render/rain/drop_sizes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace nephos {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kHeaviest_mm_per_h[2] = {100, 10};  // of rain and snow, whose slopes are drawn from
constexpr double kLightest_mm_per_h = 0.01;  // the slope of lighter rain is that of this: all drops are small

double slope_of(PrecipitationKind kind, double rate) {
    rate = std::max(rate, kLightest_mm_per_h);
    return kind == PrecipitationKind::rain ? 4.1 * std::pow(rate, -0.21) : 2.55 * std::pow(rate, -0.48);
}

double drawn_slope(PrecipitationKind kind) { return slope_of(kind, kHeaviest_mm_per_h[int(kind)]); }

// Integrates exp(-slope D) f(D) over all diameters by Simpson's rule.
template <class F>
double integral(double slope, F&& f) {
    constexpr int kIntervals = 400;
    constexpr double kStep = (kLargest_mm - kSmallest_mm) / kIntervals;
    double sum = 0;
    for (int i = 0; i <= kIntervals; ++i) {
        const double d = kSmallest_mm + i * kStep;
        const double weight = i == 0 || i == kIntervals ? 1 : i % 2 == 1 ? 4 : 2;
        sum += weight * std::exp(-slope * d) * f(d);
    }
    return sum * kStep / 3;
}

// Returns the flux of one particle per m^3 of a size, mm/h: 1 mm^3/m^3 m/s = 3.6e-3 mm/h.
double flux_of(PrecipitationKind kind, double d) {
    return 3.6e-3 * kPi / 6 * d * d * d * fall_speed_m_per_s(kind, d);
}

}  // namespace

SizeLaw size_law(PrecipitationKind kind, double rate_mm_per_h) {
    SizeLaw law{kind, 0, slope_of(kind, rate_mm_per_h)};
    if (rate_mm_per_h > 0)
        law.n0 = rate_mm_per_h / integral(law.slope, [&](double d) { return flux_of(kind, d); });
    return law;
}

double fall_speed_m_per_s(PrecipitationKind kind, double diameter_mm) {
    if (kind == PrecipitationKind::snow)
        return std::clamp(0.8 * std::pow(width_mm(kind, diameter_mm), 0.16), 0.5, 2.0);
    return std::clamp(9.65 - 10.3 * std::exp(-0.6 * diameter_mm), 0.72, 9.23);
}

double axis_ratio(double diameter_mm) {
    return diameter_mm <= 0.5 ? 1.0 : std::min(1.0, 1.03 - 0.062 * diameter_mm);
}

double width_mm(PrecipitationKind kind, double diameter_mm) {
    if (kind == PrecipitationKind::snow)
        return std::pow(kPi / 6 * diameter_mm * diameter_mm * diameter_mm / 0.073, 1 / 1.4);
    return diameter_mm / std::cbrt(axis_ratio(diameter_mm));
}

double shadow_mm2(PrecipitationKind kind, double diameter_mm) {
    constexpr double kFlakeCover = 0.3;
    const double width = width_mm(kind, diameter_mm);
    const double cover = kind == PrecipitationKind::snow ? kFlakeCover : axis_ratio(diameter_mm);
    return kPi / 4 * width * width * cover;
}

double shadow_per_m(const SizeLaw& law) {
    return law.n0 * 1e-6 * integral(law.slope, [&](double d) { return shadow_mm2(law.kind, d); });
}

double drawn_diameter_mm(PrecipitationKind kind, double u) {
    const double slope = drawn_slope(kind);
    const double least = std::exp(-slope * (kLargest_mm - kSmallest_mm));
    return std::min(kLargest_mm, kSmallest_mm - std::log1p(-u * (1 - least)) / slope);
}

double real_per_drawn(const SizeLaw& law, double diameter_mm) {
    const double slope = drawn_slope(law.kind);
    const double all = (std::exp(-slope * kSmallest_mm) - std::exp(-slope * kLargest_mm)) / slope;
    return law.n0 * all * std::exp((slope - law.slope) * diameter_mm);
}

}  // namespace nephos
