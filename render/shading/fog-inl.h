// SPDX-License-Identifier: Apache-2.0

// Fog of render/shading/shells.glsl for vectors of pixels: its optical depth, its middle along rays and its patches
// (render/frame/fog.h).

#if defined(NEPHOS_RENDER_FOG_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_FOG_INL_H_
#undef NEPHOS_RENDER_FOG_INL_H_
#else
#define NEPHOS_RENDER_FOG_INL_H_
#endif

#include <cstddef>
#include <cstdint>

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/frame/air_shells.h"
#include "render/shading/floats3-inl.h"
#include "render/shading/formulas-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

HWY_INLINE Floats byte_of(Words word, int shift) {
    const hn::RebindToSigned<Lanes> di;
    return hn::ConvertTo(Lanes(), hn::And(hn::ShiftRightSame(word, shift), hn::Set(di, 0xFF)));
}

// Interpolates the four bytes of words, 0..1, bilinearly; the upper half is the next row.
HWY_INLINE Floats between_bytes(Words word, Floats weight_u, Floats weight_v) {
    const auto mix = [](Floats a, Floats b, Floats weight) { return hn::MulAdd(weight, hn::Sub(b, a), a); };
    const Floats left = mix(byte_of(word, 0), byte_of(word, 16), weight_v),
                 right = mix(byte_of(word, 8), byte_of(word, 24), weight_v);
    return hn::Mul(mix(left, right, weight_u), set(1.0f / 255.0f));
}

HWY_INLINE Floats fraction(Floats value) { return hn::Sub(value, hn::Floor(value)); }

// Noise of fog at points relative to the eye, 0..1.
HWY_INLINE Floats fog_noise(const AirShells& air, const Floats3& point, const shader::vec4& eye) {
    const hn::RebindToSigned<Lanes> di;
    constexpr int kEdge = int(shader::kFogVoxels);
    const auto voxel = [&](float from, Floats along) {
        return hn::Mul(fraction(hn::MulAdd(set(eye.w), along, set(from))), set(float(kEdge)));
    };
    const Floats x = voxel(eye.x, point.x), y = voxel(eye.y, point.y), z = voxel(eye.z, point.z);
    const auto wrapped = [&](auto number) { return hn::And(number, hn::Set(di, kEdge - 1)); };
    const auto column = wrapped(hn::ConvertTo(di, x)), row = wrapped(hn::ConvertTo(di, y)),
               level = wrapped(hn::ConvertTo(di, z));
    const auto above = wrapped(hn::Add(level, hn::Set(di, 1)));
    const auto plane = hn::Add(hn::Mul(row, hn::Set(di, kEdge)), column);
    const auto* words =
        reinterpret_cast<const std::int32_t*>(air.shade.data()) + 3 * std::ptrdiff_t(air.data.settings.w);
    const auto at = [&](auto of) {
        return hn::GatherIndex(di, words, hn::Add(hn::Mul(of, hn::Set(di, kEdge * kEdge)), plane));
    };
    const Floats low = between_bytes(at(level), fraction(x), fraction(y)),
                 high = between_bytes(at(above), fraction(x), fraction(y));
    return hn::MulAdd(fraction(z), hn::Sub(high, low), low);
}

struct FogPart {
    Floats depth, low;
};

HWY_INLINE FogPart fog_part(const AirShells& air, const Floats3& ray, Floats begin, Floats end) {
    const shader::Shells& data = air.data;
    const Floats height = hn::MulAdd(ray.z, begin, set(data.fog.z));
    const Floats low_end = hn::IfThenElse(hn::Lt(ray.z, hn::Zero(Lanes())), end, begin);
    const Floats low = hn::MulAdd(ray.z, low_end, set(data.fog.z));
    const Floats dense = fast_exp(hn::Min(hn::Mul(low, set(-data.fog.y)), set(60.0f)));
    return {hn::Mul(set(data.fog.x), fog_column(height, ray.z, hn::Sub(end, begin), data.fog.y)),
            hn::Mul(set(data.fog.x), dense)};
}

// Returns the distance at which half of the opacity of fog is reached; `transmittance`: exp(-fog.depth).
HWY_INLINE Floats fog_middle(const AirShells& air, const FogPart& fog, Floats transmittance,
                             const Floats3& ray, Floats begin, Floats end) {
    const Lanes d;
    const Floats one = set(1.0f), zero = hn::Zero(d);
    const Floats taken = hn::Neg(hn::Log(d, hn::MulAdd(set(0.5f), transmittance, set(0.5f))));
    const auto down = hn::Lt(ray.z, zero);
    const Floats rest = hn::IfThenElse(down, hn::Sub(fog.depth, taken), taken);
    const Floats per_low = hn::Div(rest, hn::Max(fog.low, set(1.0e-30f)));
    const Floats falls = hn::Mul(hn::Abs(ray.z), set(air.data.fog.y)), x = hn::Mul(falls, per_low);
    const Floats near = hn::MulAdd(x, hn::MulAdd(x, set(1.0f / 3.0f), set(0.5f)), one);
    const Floats log = hn::Log(d, hn::Max(hn::Sub(one, x), set(1.0e-7f)));
    const Floats far = hn::Div(hn::Neg(log), hn::Max(falls, set(1.0e-30f)));
    const Floats way =
        hn::Min(hn::Max(hn::IfThenElse(hn::Lt(x, set(1.0e-2f)), hn::Mul(per_low, near), far), zero),
                hn::Sub(end, begin));
    return hn::IfThenElse(down, hn::Sub(end, way), hn::Add(begin, way));
}

HWY_INLINE Floats fog_patches(const AirShells& air, const Floats3& point, Floats begin, Floats end) {
    const Lanes d;
    const shader::Shells& data = air.data;
    const Floats one = set(1.0f), zero = hn::Zero(d);
    const Floats patches = hn::Max(hn::Mul(set(data.fog_coarse.w), hn::Sub(end, begin)), set(1.0e-6f));
    const Floats fades = hn::NegMulAdd(set(4.0f / data.shade.w), begin, set(4.0f));
    const Floats varies = hn::Mul(hn::Mul(set(data.fog.w), hn::Min(one, hn::Div(set(0.125f), patches))),
                                  hn::Min(hn::Max(fades, zero), one));
    if (hn::AllTrue(d, hn::Le(varies, zero))) return one;
    const Floats noise = hn::Add(fog_noise(air, point, data.fog_coarse),
                                 fog_noise(air, {point.y, point.z, point.x}, data.fog_fine));
    return hn::Max(hn::MulAdd(varies, hn::Sub(noise, one), one), zero);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
