// SPDX-License-Identifier: Apache-2.0
#include "render/veil/slab_path.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

namespace nephos {
namespace {

// Where the parabola of a ray's height lies below a height.
std::optional<RayPart> below(double rise, double curve, double height_m) {
    constexpr double kInfinite = std::numeric_limits<double>::infinity();
    if (curve < 1e-15) {
        if (std::abs(rise) < 1e-12)
            return height_m > 0 ? std::optional<RayPart>({-kInfinite, kInfinite}) : std::nullopt;
        const double at = height_m / rise;
        return rise > 0 ? RayPart{-kInfinite, at} : RayPart{at, kInfinite};
    }
    const double square = rise * rise + 4 * curve * height_m;
    if (square <= 0) return {};
    const double q = -0.5 * (rise + std::copysign(std::sqrt(square), rise));  // no cancellation
    double a = q / curve, b = q != 0 ? -height_m / q : 0.0;
    if (a > b) std::swap(a, b);
    return RayPart{a, b};
}

}  // namespace

std::array<RayPart, 2> parts_in_slab(double rise, double bend, double base_m, double top_m, double limit_m) {
    const double curve = bend * (1 - rise * rise);
    const std::optional<RayPart> under_top = below(rise, curve, top_m),
                                 under_base = below(rise, curve, base_m);
    if (!under_top) return {};
    const auto clipped = [&](double begin, double end) {
        return RayPart{std::max(begin, 0.0), std::min(end, limit_m)};
    };
    if (!under_base) return {clipped(under_top->begin, under_top->end), RayPart{}};
    const RayPart near = clipped(under_top->begin, under_base->begin),
                  far = clipped(under_base->end, under_top->end);
    if (!near.any()) return {far, RayPart{}};
    return {near, far};
}

}  // namespace nephos
