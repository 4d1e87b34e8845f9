// SPDX-License-Identifier: Apache-2.0

// shaders/shells.glsl for vectors of pixels: the shells of air around the eye (air_shells.h, docs/air.md).

#if defined(NEPHOS_RENDER_SHELLS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_SHELLS_INL_H_
#undef NEPHOS_RENDER_SHELLS_INL_H_
#else
#define NEPHOS_RENDER_SHELLS_INL_H_
#endif

#include <algorithm>
#include <cstdint>

#include <hwy/highway.h>

#include "render/air_shells.h"
#include "render/background-inl.h"
#include "render/column-inl.h"
#include "render/scattering-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// What a part of the air does to the light behind it: light = light * transmittance + light of the layer.
struct AirLayer {
    Floats3 light;
    Floats transmittance;
};

HWY_INLINE Floats along_row(const shader::vec4& row, const Floats3& point) {
    return hn::Add(dot(set3(row), point), set(row.w));
}

// Share of the sunlight that the clouds leave at points relative to the eye: D's gamma. The shade of a cloud
// begins at its top and is complete at its base.
HWY_INLINE Floats sunlight_left(const AirShells& air, const Floats3& point) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    using Words = hn::Vec<decltype(di)>;
    const shader::Shells& data = air.data;
    const auto place = [&](const shader::vec4& row, float largest) {
        return hn::Min(hn::Max(along_row(row, point), hn::Zero(d)), set(largest));
    };
    const Floats u = place(data.shade_u, data.shade.x), v = place(data.shade_v, data.shade.y);
    const auto column = hn::ConvertTo(di, u), row = hn::ConvertTo(di, v);
    const Floats share_u = hn::Sub(u, hn::ConvertTo(d, column)), share_v = hn::Sub(v, hn::ConvertTo(d, row));
    const auto columns = std::int32_t(data.settings.z), plane = std::int32_t(data.settings.w);
    const auto index = hn::Add(hn::Mul(row, hn::Set(di, columns)), column);
    const auto* words = reinterpret_cast<const std::int32_t*>(air.shade.data());
    const auto between = [](Floats a, Floats b, Floats share) { return hn::MulAdd(share, hn::Sub(b, a), a); };
    const auto half = [&](Words word, bool high) {
        const auto bits =
            high ? hn::BitCast(di, hn::ShiftRight<16>(hn::BitCast(hn::RebindToUnsigned<Lanes>(), word)))
                 : hn::And(word, hn::Set(di, 0xFFFF));
        return hn::Mul(hn::ConvertTo(d, bits), set(1.0f / 65535.0f));
    };
    const Words upper = hn::GatherIndex(di, words, index),
                lower = hn::GatherIndex(di, words + columns, index);
    const Floats left = between(half(upper, false), half(lower, false), share_v),
                 right = between(half(upper, true), half(lower, true), share_v);
    const Floats gamma = between(left, right, share_u), one = set(1.0f);
    const Floats along = along_row(data.shade_along, point);
    if (hn::AllTrue(d, hn::Ge(along, one))) return gamma;  // below all clouds
    const auto byte = [&](Words word, int shift) {
        const auto bits = hn::And(hn::ShiftRightSame(word, shift), hn::Set(di, 0xFF));
        return hn::Mul(hn::ConvertTo(d, bits), set(1.0f / 255.0f));
    };
    const Words above = hn::GatherIndex(di, words + plane, index),
                below = hn::GatherIndex(di, words + plane + columns, index);
    const auto mean = [&](int shift) {
        return between(between(byte(above, shift), byte(below, shift), share_v),
                       between(byte(above, shift + 16), byte(below, shift + 16), share_v), share_u);
    };
    const Floats begin = mean(0), length = hn::Max(hn::Sub(mean(8), begin), set(1.0f / 255.0f));
    const Floats part = hn::Min(hn::Max(hn::Div(hn::Sub(along, begin), length), hn::Zero(d)), one);
    return hn::NegMulAdd(part, hn::Sub(one, gamma), one);
}

HWY_INLINE Floats fraction(Floats value) { return hn::Sub(value, hn::Floor(value)); }

// Noise of fog at points relative to the eye, 0..1.
HWY_INLINE Floats fog_noise(const AirShells& air, const Floats3& point, const shader::vec4& eye) {
    const Lanes d;
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
        reinterpret_cast<const std::int32_t*>(air.shade.data()) + 2 * std::ptrdiff_t(air.data.settings.w);
    const auto at = [&](auto of) {
        return hn::GatherIndex(di, words, hn::Add(hn::Mul(of, hn::Set(di, kEdge * kEdge)), plane));
    };
    const auto low = at(level), high = at(above);
    const auto byte = [&](auto word, int shift) {
        const auto bits = hn::And(hn::ShiftRightSame(word, shift), hn::Set(di, 0xFF));
        return hn::Mul(hn::ConvertTo(d, bits), set(1.0f / 255.0f));
    };
    const auto between = [](Floats a, Floats b, Floats share) { return hn::MulAdd(share, hn::Sub(b, a), a); };
    const Floats share_x = fraction(x), share_y = fraction(y), share_z = fraction(z);
    const auto corner = [&](int shift) { return between(byte(low, shift), byte(high, shift), share_z); };
    return between(between(corner(0), corner(16), share_y), between(corner(8), corner(24), share_y), share_x);
}

HWY_INLINE Floats fog_column(Floats height_of_begin, Floats slope, Floats distance, float per_height) {
    const Lanes d;
    const Floats one = set(1.0f), zero = hn::Zero(d);
    const Floats low = hn::MulAdd(hn::Min(slope, zero), distance, height_of_begin);
    const Floats x = hn::Mul(hn::Mul(hn::Abs(slope), distance), set(per_height));
    const Floats near = hn::NegMulAdd(x, hn::NegMulAdd(x, set(1.0f / 6.0f), set(0.5f)), one);
    const auto is_near = hn::Lt(x, set(1.0e-2f));
    const Floats far = hn::Div(hn::Sub(one, hn::Exp(d, hn::Neg(x))), hn::IfThenElse(is_near, one, x));
    const Floats at_low = hn::Exp(d, hn::Min(hn::Mul(low, set(-per_height)), set(60.0f)));
    return hn::Mul(hn::Mul(at_low, distance), hn::IfThenElse(is_near, near, far));
}

HWY_INLINE Floats fog_depth(const AirShells& air, const Floats3& ray, Floats begin, Floats end, Floats at) {
    const Lanes d;
    const shader::Shells& data = air.data;
    const Floats distance = hn::Sub(end, begin), one = set(1.0f);
    const Floats column = fog_column(hn::MulAdd(ray.z, begin, set(data.fog.z)), ray.z, distance, data.fog.y);
    const Floats mean = hn::Mul(set(data.fog.x), column);
    if (hn::AllTrue(d, hn::Lt(mean, set(1.0e-5f)))) return mean;
    const Floats patches = hn::Max(hn::Mul(set(data.fog_coarse.w), distance), set(1.0e-6f));
    const Floats varies = hn::Mul(set(data.fog.w), hn::Min(one, hn::Div(set(0.125f), patches)));
    const Floats3 point = times(at, ray);
    const Floats noise = hn::Add(fog_noise(air, point, data.fog_coarse),
                                 fog_noise(air, {point.y, point.z, point.x}, data.fog_fine));
    return hn::Mul(mean, hn::Max(hn::MulAdd(varies, hn::Sub(noise, one), one), hn::Zero(d)));
}

HWY_INLINE Floats within_shell(const AirShells& air, Floats begin, Floats end, Floats share) {
    return hn::MulAdd(hn::IfThenElseZero(hn::Lt(begin, set(air.data.shade.w)), share), hn::Sub(end, begin),
                      begin);
}

HWY_INLINE Floats3 fog_radiance(const PictureFrame& frame, const Floats3& ray, Floats at, Floats lit) {
    const Lanes d;
    const shader::Shells& data = frame.shells->data;
    const Floats height = hn::MulAdd(ray.z, at, set(data.fog.z));
    const Floats dense = hn::Exp(d, hn::Min(hn::Mul(height, set(-data.fog.y)), set(60.0f)));
    const Floats above = hn::Mul(set(data.fog.x / data.fog.y), dense);
    const Floats sun_depth = hn::Mul(above, set(1.0f / std::max(frame.to_sun.z, 0.05f)));
    const Floats once = scattered_once(frame, dot(set3(frame.to_sun), ray));
    const Floats sun = hn::Mul(
        lit, hn::MulAdd(hn::Exp(d, hn::Neg(sun_depth)), once, scattered_often(frame, ray, sun_depth)));
    const Floats open = hn::Exp(d, hn::Mul(set(-0.5f), above));
    const Floats3 ambient = mix(set3(frame.ambient_base), set3(frame.ambient_top), {open, open, open});
    const Floats3 arriving = times_add(sun, sunlight_at(frame, hn::Mul(ray.z, at)), ambient);
    const Floats3 beta = air_transmittance(frame, ray, at);
    return add(each_times(beta, times(set(frame.ambient_top.w), arriving)), air_light(frame, ray, beta));
}

// `transmittance_lost`: of the air between the two distances.
HWY_INLINE AirLayer air_layer(const PictureFrame& frame, const SunlitAir& sunlit, const Floats3& ray,
                              const Floats3& transmittance_lost, Floats begin, Floats end, Floats at) {
    const Lanes d;
    const AirShells& air = *frame.shells;
    const Floats one = set(1.0f), lit = sunlight_left(air, times(at, ray));
    const Floats strength =
        hn::IfThenElseZero(hn::Lt(begin, set(air.data.shade.w)), set(air.data.settings.y));
    Floats3 light = times(hn::Mul(strength, hn::Sub(lit, one)),
                          each_times(transmittance_lost, sunlit_at(frame, sunlit, ray, at)));
    if (!air.has_fog()) return {light, one};
    const Floats depth = fog_depth(air, ray, begin, end, at), transmittance = hn::Exp(d, hn::Neg(depth));
    if (hn::AllTrue(d, hn::Lt(depth, set(1.0e-6f)))) return {light, transmittance};
    light = times(hn::MulAdd(set(0.5f), transmittance, set(0.5f)), light);
    const Floats3 of_fog = fog_radiance(frame, ray, within_shell(air, begin, end, set(0.5f)), lit);
    return {times_add(hn::Sub(one, transmittance), of_fog, light), transmittance};
}

// Where rays come out of the ground that the eye is below, as those of a mirror image do.
HWY_INLINE Floats air_begin(const PictureFrame& frame, const Floats3& ray) {
    if (!(frame.ground.w > 0)) return hn::Zero(Lanes());
    return hn::Div(set(frame.ground.w), hn::Max(ray.z, set(1.0e-6f)));
}

// The part of the shells of splats that lies in front of their centres; beyond the last shell, they begin at
// `distance` itself.
HWY_INLINE AirLayer layer_in_front(const PictureFrame& frame, const Floats3& ray, Floats shell_begins,
                                   Floats distance) {
    const Floats begin = hn::Min(hn::Max(shell_begins, air_begin(frame, ray)), distance);
    const Floats3 lost =
        subtract(air_transmittance(frame, ray, begin), air_transmittance(frame, ray, distance));
    return air_layer(frame, sunlit_air(frame, ray), ray, lost, begin, distance,
                     within_shell(*frame.shells, begin, distance, set(0.5f)));
}

// Distances along rays between which clouds can shade the air.
struct ShadePart {
    float begin, end;
};

HWY_INLINE ShadePart shade_part(const AirShells& air, const Floats3& ray) {
    const Lanes d;
    const shader::Shells& data = air.data;
    Floats begin = hn::Zero(d), end = set(kNowhere);
    const auto clip = [&](const shader::vec4& row, float low, float high) {
        const Floats slope = dot(set3(row), ray);
        const Floats steep = hn::IfThenElse(hn::Lt(hn::Abs(slope), set(1.0e-12f)), set(1.0e-12f), slope);
        const Floats a = hn::Div(set(low - row.w), steep), b = hn::Div(set(high - row.w), steep);
        begin = hn::Max(begin, hn::Min(a, b));
        end = hn::Min(end, hn::Max(a, b));
    };
    clip(data.shade_u, 0, data.shade.x);
    clip(data.shade_v, 0, data.shade.y);
    clip(data.shade_along, data.shade.z, 1.0e12f);
    const auto some = hn::Lt(begin, end);
    if (hn::AllFalse(d, some)) return {kNowhere, 0};
    return {hn::GetLane(hn::MinOfLanes(d, hn::IfThenElse(some, begin, set(kNowhere)))),
            hn::GetLane(hn::MaxOfLanes(d, hn::IfThenElseZero(some, end)))};
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
