// SPDX-License-Identifier: Apache-2.0

// ripple_grid.h for vectors of points.

#if defined(NEPHOS_RENDER_RIPPLES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_RIPPLES_INL_H_
#undef NEPHOS_RENDER_RIPPLES_INL_H_
#else
#define NEPHOS_RENDER_RIPPLES_INL_H_
#endif

#include <hwy/highway.h>

#include "render/ground/ground_noise-inl.h"
#include "render/ground/ripple_grid.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// Slopes of water, and the variance of those that are too small to be seen.
struct Slopes {
    Floats x, y, variance;
};

// Samples the square's slopes bilinearly, with an offset by a hash.
HWY_INLINE Slopes slopes_in_square(const RippleSlopes& slopes, Floats x, Floats y, Hash hash) {
    const Lanes d;
    const Ints di;
    const HashLanes dw;
    const Floats x0 = hn::Floor(x), y0 = hn::Floor(y);
    const Floats fraction_x = hn::Sub(x, x0), fraction_y = hn::Sub(y, y0);
    const auto mask = hn::Set(di, kRippleTexels - 1), one = hn::Set(di, 1);
    const auto moved = [&](Floats at, Hash by) {
        return hn::Add(hn::ConvertTo(di, at), hn::BitCast(di, hn::And(by, hn::Set(dw, 0xffu))));
    };
    const auto column = moved(x0, hash), row = moved(y0, hn::ShiftRight<8>(hash));
    const auto west = hn::And(column, mask), east = hn::And(hn::Add(column, one), mask);
    const auto line = [&](hn::Vec<Ints> at) {
        return hn::Mul(hn::And(at, mask), hn::Set(di, kRippleTexels));
    };
    const auto south = line(row), north = line(hn::Add(row, one));
    const auto value = [&](const std::vector<float>& of) {
        const auto at = [&](hn::Vec<Ints> a, hn::Vec<Ints> b) {
            return hn::GatherIndex(d, of.data(), hn::Add(a, b));
        };
        return lerp(lerp(at(south, west), at(south, east), fraction_x),
                    lerp(at(north, west), at(north, east), fraction_x), fraction_y);
    };
    return {value(slopes.x), value(slopes.y), hn::Zero(d)};
}

// Returns the slopes at points relative to the eye, by the size of a pixel and the rain there.
HWY_INLINE Slopes ripples_at(const RippleGrid& grid, const Floats3& point, Floats pixel_m, Floats rain) {
    const Lanes d;
    const Floats zero = hn::Zero(d), one = set(1.0f);
    if (grid.slopes.x.empty()) return {zero, zero, zero};
    // Slopes of twice as many drops are sqrt(2) as large.
    const Floats height =
        hn::Mul(set(grid.strength), hn::Sqrt(hn::Min(hn::Mul(rain, set(1 / grid.most_mm_per_h)), one)));
    const Floats seen = hn::Sub(one, smooth_step(set(0.016f), set(0.07f), pixel_m));
    const Floats variance = hn::Mul(hn::Mul(height, height), set(float(grid.slopes.variance)));
    const Floats unseen = hn::Mul(variance, hn::NegMulAdd(seen, seen, one));
    if (hn::AllFalse(d, hn::Gt(hn::Mul(seen, height), zero))) return {zero, zero, unseen};
    constexpr float kPerMetre = float(1 / kRippleHexagon_m), kTexels = float(kRippleTexels / kRippleSize_m);
    const Floats limit = set(1.0e4f);  // farther points are not seen
    const Floats px = hn::Max(hn::Min(point.x, limit), hn::Neg(limit)),
                 py = hn::Max(hn::Min(point.y, limit), hn::Neg(limit));
    const Floats x = hn::MulAdd(hn::MulAdd(set(-0.57735027f), py, px), set(kPerMetre), set(grid.from_x)),
                 y = hn::MulAdd(py, set(1.15470054f * kPerMetre), set(grid.from_y));
    const Floats x0 = hn::Floor(x), y0 = hn::Floor(y), fx = hn::Sub(x, x0), fy = hn::Sub(y, y0);
    const auto upper = hn::Gt(hn::Add(fx, fy), one);  // of the two triangles of a rhombus
    const Floats first = hn::IfThenElse(upper, hn::Sub(hn::Add(fx, fy), one), hn::Sub(one, hn::Add(fx, fy))),
                 east = hn::IfThenElse(upper, hn::Sub(one, fy), fx),
                 north = hn::IfThenElse(upper, hn::Sub(one, fx), fy);
    const Floats tx = hn::MulAdd(px, set(kTexels), set(grid.texel_x)),
                 ty = hn::MulAdd(py, set(kTexels), set(grid.texel_y));
    const Hash column = cell_of(x0, grid.corner_x), row = cell_of(y0, grid.corner_y);
    const HashLanes dw;
    const Hash next = hn::Set(dw, 1u);
    const Hash both = hn::IfThenElseZero(hn::RebindMask(dw, upper), next);
    Slopes sum{zero, zero, zero};
    Floats squares = zero;
    const auto add_corner = [&](Floats weight, Hash cx, Hash cy) {
        const Floats w = hn::Mul(weight, weight);
        const Slopes own = slopes_in_square(grid.slopes, tx, ty,
                                            mixed(hn::Add(mixed(hn::Add(column, cx)), hn::Add(row, cy))));
        sum.x = hn::MulAdd(w, own.x, sum.x);
        sum.y = hn::MulAdd(w, own.y, sum.y);
        squares = hn::MulAdd(w, w, squares);
    };
    add_corner(first, both, both);
    add_corner(east, next, hn::Zero(dw));
    add_corner(north, hn::Zero(dw), next);
    const Floats scale = hn::Div(hn::Mul(height, seen), hn::Sqrt(squares));
    return {hn::Mul(scale, sum.x), hn::Mul(scale, sum.y), unseen};
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
