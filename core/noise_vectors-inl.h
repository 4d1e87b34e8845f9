// SPDX-License-Identifier: Apache-2.0
// Gradient noise in SIMD vectors of any width, for core/noise.h and density/veil.h (not
// installed). Included once for each target of Highway. Sums and products are never fused, so that every
// lane has the bits of the scalar formula.

#if defined(NEPHOS_DENSITY_NOISE_VECTORS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_DENSITY_NOISE_VECTORS_INL_H_
#undef NEPHOS_DENSITY_NOISE_VECTORS_INL_H_
#else
#define NEPHOS_DENSITY_NOISE_VECTORS_INL_H_
#endif

#include <cstdint>

#include <hwy/highway.h>

#include "core/vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using NoiseFloats = hn::ScalableTag<float>;
using NoiseWords = hn::Repartition<std::uint32_t, NoiseFloats>;
using NoiseInts = hn::Repartition<std::int32_t, NoiseFloats>;
using Floats = hn::Vec<NoiseFloats>;
using Words = hn::Vec<NoiseWords>;

// One axis of a point: hashes of the lattice points below and above, the distances from both, and the weight
// s of the upper one.
struct AxisPoint {
    Words low, high;
    Floats from_low, from_high, blend;
};

// Returns n modulo period, for integer-valued floats within +-2^22.
HWY_INLINE Floats wrapped(Floats n, float period) {
    const NoiseFloats d;
    const auto p = hn::Set(d, period);
    n = hn::Sub(n, hn::Mul(hn::Floor(hn::Mul(n, hn::Set(d, 1 / period))), p));
    n = hn::IfThenElse(hn::Lt(n, hn::Zero(d)), hn::Add(n, p), n);  // the product was rounded
    return hn::IfThenElse(hn::Ge(n, p), hn::Sub(n, p), n);
}

// Fills in the distances and the weight of a coordinate; `floor` is that of the coordinate.
HWY_INLINE void set_fraction(AxisPoint& axis, Floats at, Floats floor) {
    const NoiseFloats d;
    axis.from_low = hn::Sub(at, floor);
    axis.from_high = hn::Sub(axis.from_low, hn::Set(d, 1.0f));
    // ((6 f - 15) f + 10) f^3
    const Floats f = axis.from_low;
    const Floats inner = hn::Sub(hn::Mul(hn::Set(d, 6.0f), f), hn::Set(d, 15.0f));
    axis.blend = hn::Mul(hn::Add(hn::Mul(inner, f), hn::Set(d, 10.0f)), hn::Mul(hn::Mul(f, f), f));
}

// Locates the coordinate `at`, relative to lattice cell `cell`, on one axis; a period of 0 is none.
template <bool kPeriodic>
HWY_INLINE AxisPoint axis_point(Floats at, std::uint32_t cell, std::uint32_t seed, float period) {
    const NoiseFloats d;
    const NoiseWords dw;
    const NoiseInts di;
    const Floats floor = hn::Floor(at);
    AxisPoint axis;
    set_fraction(axis, at, floor);
    Floats low = floor, high = hn::Add(floor, hn::Set(d, 1.0f));
    if (kPeriodic && period > 0) {
        low = wrapped(low, period);
        high = wrapped(high, period);
    }
    const Words first = hn::Set(dw, cell * kAxisStep + seed), step = hn::Set(dw, kAxisStep);
    const auto hash = [&](Floats n) HWY_ATTR {
        return mixed(hn::Add(first, hn::Mul(hn::BitCast(dw, hn::ConvertTo(di, n)), step)));
    };
    axis.low = hash(low);
    axis.high = hash(high);
    return axis;
}

// Returns g(l) . (p - l) with components of g in the odd integers -1023 .. 1023.
HWY_INLINE Floats gradient_dot(Words hash, Floats x, Floats y, Floats z) {
    const NoiseFloats d;
    const NoiseInts di;
    const NoiseWords dw;
    const Words h = mixed(hash), mask = hn::Set(dw, 1023);
    const auto component = [&](Words bits) HWY_ATTR {
        const auto number = hn::BitCast(di, hn::And(bits, mask));
        return hn::Sub(hn::ConvertTo(d, hn::Add(number, number)), hn::Set(d, 1023.0f));
    };
    const Floats gx = component(h), gy = component(hn::ShiftRight<10>(h));
    const Floats gz = component(hn::ShiftRight<20>(h));
    return hn::Add(hn::Add(hn::Mul(gx, x), hn::Mul(gy, y)), hn::Mul(gz, z));
}

HWY_INLINE Floats between(Floats a, Floats b, Floats blend) {
    return hn::Add(a, hn::Mul(hn::Sub(b, a), blend));
}

// Sums of the hashes of x and y of the four columns of lattice points around a point.
struct ColumnHashes {
    Words low_low, high_low, low_high, high_high;  // x, then y
};

HWY_INLINE ColumnHashes column_hashes(const AxisPoint& x, const AxisPoint& y) {
    return {hn::Add(x.low, y.low), hn::Add(x.high, y.low), hn::Add(x.low, y.high), hn::Add(x.high, y.high)};
}

// Of x and y the hashes are not used, but those of the columns.
HWY_INLINE Floats noise(const ColumnHashes& columns, const AxisPoint& x, const AxisPoint& y, const AxisPoint& z) {
    const NoiseFloats d;
    const auto row = [&](Words low_hash, Words high_hash, Floats fy, Floats fz) HWY_ATTR {
        const Floats low = gradient_dot(low_hash, x.from_low, fy, fz);
        const Floats high = gradient_dot(high_hash, x.from_high, fy, fz);
        return between(low, high, x.blend);
    };
    const auto level = [&](Words hz, Floats fz) HWY_ATTR {
        return between(row(hn::Add(hz, columns.low_low), hn::Add(hz, columns.high_low), y.from_low, fz),
                       row(hn::Add(hz, columns.low_high), hn::Add(hz, columns.high_high), y.from_high, fz), y.blend);
    };
    const Floats sum = between(level(z.low, z.from_low), level(z.high, z.from_high), z.blend);
    return hn::Mul(sum, hn::Set(d, kNoiseScale));
}

HWY_INLINE Floats noise(const AxisPoint& x, const AxisPoint& y, const AxisPoint& z) {
    return noise(column_hashes(x, y), x, y, z);
}

}  // namespace HWY_NAMESPACE
}  // namespace nephos
HWY_AFTER_NAMESPACE();

#endif
