// SPDX-License-Identifier: Apache-2.0

// Reflectance of wet ground, water and snow, for SIMD vectors of pixels; see wet_ground.h.

#if defined(NEPHOS_RENDER_GROUND_LOOK_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_GROUND_LOOK_INL_H_
#undef NEPHOS_RENDER_GROUND_LOOK_INL_H_
#else
#define NEPHOS_RENDER_GROUND_LOOK_INL_H_
#endif

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/ground/ground_noise-inl.h"
#include "render/ground/mirror_view.h"
#include "render/ground/wet_ground.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// water_reflectance() of wet_ground.h.
HWY_INLINE Floats water_reflectance(Floats cosine, Floats slope_variance) {
    const Lanes d;
    const Floats slope = hn::Sqrt(slope_variance);
    const Floats power = hn::Mul(set(5.0f), hn::Exp(d, hn::Mul(set(-2.69f), slope)));
    const Floats rest = hn::Max(hn::Sub(set(1.0f), cosine), set(1.0e-6f));
    const Floats grazing = hn::Exp(d, hn::Mul(power, hn::Log(d, rest)));
    const Floats hidden = hn::MulAdd(set(22.7f), hn::Mul(slope, hn::Sqrt(slope)), set(1.0f));
    return hn::MulAdd(set(1.0f - kWaterNormalReflectance), hn::Div(grazing, hidden),
                      set(kWaterNormalReflectance));
}

// soaked_albedo() of wet_ground.h without the fraction of light that gets in and out.
HWY_INLINE Floats3 soaked_albedo(const shader::vec4& dry) {
    const auto of = [](float albedo) { return set(float(nephos::soaked_albedo(double(albedo)))); };
    return {of(dry.x), of(dry.y), of(dry.z)};
}

HWY_INLINE Floats3 soaked_albedo(const Floats3& dry) {
    const float back = float(nephos::soaked_back_reflectance());
    const auto of = [back](Floats albedo) {
        return hn::Div(hn::Mul(set(1 - back), albedo), hn::NegMulAdd(set(back), albedo, set(1.0f)));
    };
    return {of(dry.x), of(dry.y), of(dry.z)};
}

// Fraction of the ground that lies below a film (see wet_ground.h), where noise is the height of
// the hollows and tufts in standard deviations.
HWY_INLINE Floats covered(Floats film_mm, float half_mm, const ResolvedNoise& noise) {
    constexpr float kSharpness = 0.1f;  // of edges: a tenth of a standard deviation
    const Floats film = hn::Max(film_mm, set(1.0e-6f));
    const Floats level =
        hn::Mul(hn::Log(Lanes(), hn::Mul(film, set(1.0f / half_mm))), set(1.0f / kFilmSpread));
    const Floats deviation = hn::Sqrt(hn::Add(noise.variance, set(kSharpness * kSharpness)));
    // Clamped to the range of exp(): a film of nanometres is thousands of deviations away.
    const Floats x = hn::Max(hn::Div(hn::Sub(level, noise.value), deviation), set(-50.0f));
    // The normal distribution's integral, within 0.01.
    const Floats fraction =
        hn::Div(set(1.0f), hn::Add(set(1.0f), hn::Exp(Lanes(), hn::Mul(set(-1.702f), x))));
    return hn::IfThenElseZero(hn::Gt(film_mm, hn::Zero(Lanes())), fraction);
}

struct Mirrored {
    Floats3 light;
    Floats transmittance;
};

// Samples one level of the mirrored view bilinearly; u and v are 0..1.
HWY_INLINE Mirrored mirrored_level(const MirrorView& view, hn::Vec<Ints> first, hn::Vec<Ints> width,
                                   hn::Vec<Ints> height, Floats u, Floats v) {
    const Lanes d;
    const Ints di;
    const auto one = hn::Set(di, 1), zero = hn::Zero(di);
    const Floats x = hn::MulSub(u, hn::ConvertTo(d, width), set(0.5f)),
                 y = hn::MulSub(v, hn::ConvertTo(d, height), set(0.5f));
    const Floats x0 = hn::Floor(x), y0 = hn::Floor(y);
    const Floats fraction_x = hn::Sub(x, x0), fraction_y = hn::Sub(y, y0);
    const auto inside = [&](hn::Vec<Ints> at, hn::Vec<Ints> size) {
        return hn::Min(hn::Max(at, zero), hn::Sub(size, one));
    };
    const auto column = hn::ConvertTo(di, x0), row = hn::ConvertTo(di, y0);
    const auto west = inside(column, width), east = inside(hn::Add(column, one), width);
    const auto low = hn::Add(first, hn::Mul(inside(row, height), width)),
               high = hn::Add(first, hn::Mul(inside(hn::Add(row, one), height), width));
    const auto texel = [](hn::Vec<Ints> at) { return hn::ShiftLeft<2>(at); };
    const auto sw = texel(hn::Add(low, west)), se = texel(hn::Add(low, east)),
               nw = texel(hn::Add(high, west)), ne = texel(hn::Add(high, east));
    const auto channel = [&](int c) {
        const float* from = view.texels.data() + c;
        return lerp(lerp(hn::GatherIndex(d, from, sw), hn::GatherIndex(d, from, se), fraction_x),
                    lerp(hn::GatherIndex(d, from, nw), hn::GatherIndex(d, from, ne), fraction_x), fraction_y);
    };
    return {{channel(0), channel(1), channel(2)}, channel(3)};
}

// Samples the mirrored view along a reflected direction (upwards), blurred over a cone of `blur` radians.
HWY_INLINE Mirrored mirrored(const MirrorView& view, const Floats3& direction, Floats blur) {
    const Lanes d;
    const Ints di;
    const auto axis = [](const Vec3& v) {
        return Floats3{set(float(v.x)), set(float(v.y)), set(float(v.z))};
    };
    const Floats depth = hn::Max(dot(direction, axis(view.frame.forward)), set(0.02f));
    const Floats right = hn::Div(dot(direction, axis(view.frame.right)), depth),
                 up = hn::Div(dot(direction, axis(view.frame.up)), depth);
    const Floats u = clamp01(hn::MulAdd(right, set(float(0.5 / view.frame.half_width)), set(0.5f))),
                 v = clamp01(hn::MulAdd(up, set(float(-0.5 / view.frame.half_height)), set(0.5f)));
    const Floats texels = hn::Max(hn::Mul(blur, set(float(view.pixels_per_unit))), set(1.0f));
    const Floats last = set(float(view.levels.size() - 1));
    const Floats level = hn::Min(hn::Mul(hn::Log(d, texels), set(1.442695f)), last);
    const Floats fine = hn::Floor(level), coarse = hn::Min(hn::Add(fine, set(1.0f)), last);
    const auto at = [&](Floats number) {
        const auto index = hn::Mul(hn::ConvertTo(di, number), hn::Set(di, 3));
        const int* sizes = &view.levels.front().first;  // first, width, height
        return mirrored_level(view, hn::GatherIndex(di, sizes, index), hn::GatherIndex(di, sizes + 1, index),
                              hn::GatherIndex(di, sizes + 2, index), u, v);
    };
    const Mirrored near = at(fine);
    const Floats fraction = hn::Sub(level, fine);
    if (hn::AllTrue(d, hn::Eq(fraction, hn::Zero(d)))) return near;
    const Mirrored far = at(coarse);
    return {mix(near.light, far.light, {fraction, fraction, fraction}),
            lerp(near.transmittance, far.transmittance, fraction)};
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
