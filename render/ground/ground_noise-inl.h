// SPDX-License-Identifier: Apache-2.0

// ground_noise.h for vectors of points.

#if defined(NEPHOS_RENDER_GROUND_NOISE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_GROUND_NOISE_INL_H_
#undef NEPHOS_RENDER_GROUND_NOISE_INL_H_
#else
#define NEPHOS_RENDER_GROUND_NOISE_INL_H_
#endif

#include <cstdint>
#include <span>

#include <hwy/highway.h>

#include "core/vectors-inl.h"
#include "render/ground/ground_noise.h"
#include "render/shading/background-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

using Ints = hn::RebindToSigned<Lanes>;
using HashLanes = hn::RebindToUnsigned<Lanes>;
using Hash = hn::Vec<HashLanes>;

HWY_INLINE Floats clamp01(Floats x) { return hn::Max(hn::Min(x, set(1.0f)), hn::Zero(Lanes())); }
HWY_INLINE Floats smooth_step(Floats low, Floats high, Floats x) {
    return smooth_blend(clamp01(hn::Div(hn::Sub(x, low), hn::Sub(high, low))));
}
HWY_INLINE Floats lerp(Floats a, Floats b, Floats fraction) { return hn::MulAdd(fraction, hn::Sub(b, a), a); }

// Returns a cell's number modulo 2^32 from its floor; undefined for far points, which no octave resolves.
HWY_INLINE Hash cell_of(Floats floor, std::uint32_t first) {
    const Floats far = set(1.0e9f);
    const auto near = hn::ConvertTo(Ints(), hn::Min(hn::Max(floor, hn::Neg(far)), far));
    return hn::Add(hn::BitCast(HashLanes(), near), hn::Set(HashLanes(), first));
}

// Returns the dot product of a gradient, uniform in a square by the two halves of a hash, with the offset
// from its lattice point.
HWY_INLINE Floats slope_along(Hash hash, Floats x, Floats y) {
    const Ints di;
    const auto component = [&](Hash bits) {
        const auto number = hn::BitCast(di, hn::And(bits, hn::Set(HashLanes(), 0xffffu)));
        return hn::MulAdd(hn::ConvertTo(Lanes(), number), set(1.0f / 32768.0f), set(-1.0f));
    };
    return hn::MulAdd(component(hash), x, hn::Mul(component(hn::ShiftRight<16>(hash)), y));
}

// Gradient noise (Perlin 2002) of one wavelength, with variance 1.
HWY_INLINE Floats noise(const NoiseOctave& o, const Floats3& p) {
    const Floats x = hn::MulAdd(set(o.x_x), p.x, hn::MulAdd(set(o.x_y), p.y, set(o.from_x))),
                 y = hn::MulAdd(set(o.y_x), p.x, hn::MulAdd(set(o.y_y), p.y, set(o.from_y)));
    const Floats x0 = hn::Floor(x), y0 = hn::Floor(y), one = set(1.0f);
    const Floats fx = hn::Sub(x, x0), fy = hn::Sub(y, y0), gx = hn::Sub(fx, one), gy = hn::Sub(fy, one);
    const Hash column = cell_of(x0, o.cell_x), row = cell_of(y0, o.cell_y), next = hn::Set(HashLanes(), 1u);
    const Hash west = mixed(column), east = mixed(hn::Add(column, next)), north = hn::Add(row, next);
    const auto blend = [](Floats f) {
        const Floats inner = hn::MulAdd(hn::MulSub(set(6.0f), f, set(15.0f)), f, set(10.0f));
        return hn::Mul(inner, hn::Mul(f, hn::Mul(f, f)));
    };
    const Floats across = blend(fx);
    const Floats low = lerp(slope_along(mixed(hn::Add(west, row)), fx, fy),
                            slope_along(mixed(hn::Add(east, row)), gx, fy), across),
                 high = lerp(slope_along(mixed(hn::Add(west, north)), fx, gy),
                             slope_along(mixed(hn::Add(east, north)), gx, gy), across);
    constexpr float kPerDeviation = 5.677f;  // the noise as it is has a standard deviation of 0.176
    return hn::Mul(set(kPerDeviation), lerp(low, high, blend(fy)));
}

struct ResolvedNoise {
    Floats value;     // of the wavelengths that a pixel of this size resolves
    Floats variance;  // of the others
};

// `pixel_m`: size of a pixel at the points. A wavelength fades out between 5 and 2 pixels.
HWY_INLINE ResolvedNoise resolved_noise(std::span<const NoiseOctave> octaves, const Floats3& p,
                                        Floats pixel_m) {
    const Lanes d;
    ResolvedNoise sum{hn::Zero(d), set(1.0f)};
    for (const NoiseOctave& octave : octaves) {
        const Floats per_pixel = hn::Div(set(octave.wavelength_m), pixel_m);
        const Floats fraction = smooth_step(set(2.0f), set(5.0f), per_pixel);
        if (hn::AllTrue(d, hn::Eq(fraction, hn::Zero(d)))) break;  // the next ones are finer still
        const Floats weight = hn::Mul(set(octave.weight), fraction);
        sum.value = hn::MulAdd(weight, noise(octave, p), sum.value);
        sum.variance = hn::NegMulAdd(weight, weight, sum.variance);
    }
    sum.variance = hn::Max(sum.variance, hn::Zero(d));
    return sum;
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
