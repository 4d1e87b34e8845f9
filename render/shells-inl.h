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

// The air of rays between two distances, of which the sunlight is looked up at a third. All the light of the
// air is in the picture already (air_light()); what clouds shade is taken away: radiance below zero.
// `transmittance_lost`: of the air between the two.
HWY_INLINE AirLayer air_layer(const PictureFrame& frame, const SunlitAir& sunlit, const Floats3& ray,
                              const Floats3& transmittance_lost, Floats at) {
    const AirShells& air = *frame.shells;
    const Floats lost = hn::Sub(sunlight_left(air, times(at, ray)), set(1.0f));
    const Floats3 light = each_times(transmittance_lost, sunlit_at(frame, sunlit, ray, at));
    return {times(hn::Mul(set(air.data.settings.y), lost), light), set(1.0f)};
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
    return air_layer(frame, sunlit_air(frame, ray), ray, lost, hn::Mul(set(0.5f), hn::Add(begin, distance)));
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
