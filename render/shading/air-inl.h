// SPDX-License-Identifier: Apache-2.0

// render/shared/air.h for vectors of pixels: clear air along rays, and the tables of the sky.

#if defined(NEPHOS_RENDER_AIR_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_AIR_INL_H_
#undef NEPHOS_RENDER_AIR_INL_H_
#else
#define NEPHOS_RENDER_AIR_INL_H_
#endif

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/frame/frame_data.h"
#include "render/shading/floats3-inl.h"
#include "render/shading/formulas-inl.h"
#include "render/shared/shared.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// A layer of the sky's tables between four texels; places are 0..1.
HWY_INLINE Floats3 sky_layer(const PictureFrame& frame, Floats across, Floats upwards, std::size_t layer) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    constexpr int kColumns = int(shader::kSkyColumns), kRows = int(shader::kSkyRows);
    const Floats x = hn::Mul(across, set(float(kColumns - 1))), y = hn::Mul(upwards, set(float(kRows - 1)));
    const Floats x0 = hn::Min(hn::Floor(x), set(float(kColumns - 2))),
                 y0 = hn::Min(hn::Floor(y), set(float(kRows - 2)));
    const Floats fraction_x = hn::Sub(x, x0), fraction_y = hn::Sub(y, y0);
    const auto index = hn::ShiftLeft<2>(
        hn::Add(hn::Mul(hn::ConvertTo(di, y0), hn::Set(di, kColumns)), hn::ConvertTo(di, x0)));
    const float* texels = frame.sky + 4 * layer * std::size_t(kColumns * kRows);
    const auto channel = [&](const float* from) {
        const auto row = [&](const float* first) {
            const Floats a = hn::GatherIndex(d, first, index), b = hn::GatherIndex(d, first + 4, index);
            return hn::MulAdd(fraction_x, hn::Sub(b, a), a);
        };
        const Floats a = row(from), b = row(from + 4 * kColumns);
        return hn::MulAdd(fraction_y, hn::Sub(b, a), a);
    };
    return {channel(texels), channel(texels + 1), channel(texels + 2)};
}

HWY_INLINE Floats3 sunlight_at(const PictureFrame& frame, Floats height) {
    if (frame.sky == nullptr) return set3(frame.sunlight);
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    constexpr int kColumns = int(shader::kSkyColumns), kTexels = kColumns * int(shader::kSkyRows);
    const Floats altitude = hn::Mul(hn::Add(set(frame.air.x), height), set(1.0f / shader::kSunlightTop));
    const Floats x = hn::Mul(hn::Max(hn::Min(altitude, set(1.0f)), hn::Zero(d)), set(float(kColumns - 1)));
    const Floats below = hn::Min(hn::Floor(x), set(float(kColumns - 2))), fraction = hn::Sub(x, below);
    const auto index = hn::ShiftLeft<2>(hn::ConvertTo(di, below));
    const float* texels = frame.sky + 4 * 2 * kTexels;  // the first row of the third layer
    const auto channel = [&](const float* first) {
        const Floats a = hn::GatherIndex(d, first, index), b = hn::GatherIndex(d, first + 4, index);
        return hn::MulAdd(fraction, hn::Sub(b, a), a);
    };
    return {channel(texels), channel(texels + 1), channel(texels + 2)};
}

// Sunlight at heights above the eye that differ little, as those of the pixels of a vector in one shell:
// between the two nodes of the table that are nearest to the first of them.
HWY_INLINE Floats3 sunlight_nearby(const PictureFrame& frame, Floats heights) {
    if (frame.sky == nullptr) return set3(frame.sunlight);
    constexpr auto kColumns = std::size_t(shader::kSkyColumns), kTexels = kColumns * shader::kSkyRows;
    const Floats altitude = hn::Add(set(frame.air.x), heights);
    const Floats place = hn::Mul(altitude, set(float(kColumns - 1) / shader::kSunlightTop));
    const Floats x = hn::Min(hn::Max(place, hn::Zero(Lanes())), set(float(kColumns - 1)));
    const auto below = std::min(std::size_t(hn::GetLane(x)), kColumns - 2);
    const Floats fraction = hn::Sub(x, set(float(below)));
    const float* const texel = frame.sky + 4 * (2 * kTexels + below);
    const auto channel = [&](std::size_t c) {
        return hn::MulAdd(fraction, set(texel[c + 4] - texel[c]), set(texel[c]));
    };
    return {channel(0), channel(1), channel(2)};
}

namespace formulas {

using shader::kAirAzimuth;
using shader::kAirLayer;
using shader::kAirRows;
using shader::kShaftsReach;
using shader::kSkyRows;
using Real3 = Floats3;
HWY_INLINE Floats3 operator*(Floats a, const Floats3& b) { return times(a, b); }
HWY_INLINE Floats3 operator*(const Floats3& a, const Floats3& b) { return each_times(a, b); }
HWY_INLINE Floats3 operator/(const Floats3& a, const Floats3& b) {
    return {hn::Div(a.x, b.x), hn::Div(a.y, b.y), hn::Div(a.z, b.z)};
}
HWY_INLINE Floats3 operator+(const Floats3& a, const Floats3& b) { return add(a, b); }
HWY_INLINE Floats3 operator-(float a, const Floats3& b) { return subtract({set(a), set(a), set(a)}, b); }
HWY_INLINE Floats3 operator-(const Floats3& a) { return {hn::Neg(a.x), hn::Neg(a.y), hn::Neg(a.z)}; }
HWY_INLINE Floats3 mul_add(Floats s, const Floats3& a, const Floats3& b) { return times_add(s, a, b); }
HWY_INLINE Floats3 min(const Floats3& a, const Floats3& b) {
    return {hn::Min(a.x, b.x), hn::Min(a.y, b.y), hn::Min(a.z, b.z)};
}
HWY_INLINE Floats3 max(const Floats3& a, Floats b) { return {hn::Max(a.x, b), hn::Max(a.y, b), hn::Max(a.z, b)}; }
HWY_INLINE Floats3 mix(const Floats3& a, const Floats3& b, Floats fraction) {
    return HWY_NAMESPACE::mix(a, b, {fraction, fraction, fraction});
}
HWY_INLINE Floats exp(Floats a) { return hn::Exp(Lanes(), a); }
HWY_INLINE Floats3 exp(const Floats3& a) { return {exp(a.x), exp(a.y), exp(a.z)}; }
HWY_INLINE Floats3 rgb(const shader::vec4& four) { return set3(four); }
HWY_INLINE Floats3 xyz(const shader::vec4& four) { return set3(four); }

// The air of a frame.
struct FrameAir {
    const PictureFrame& frame;
    const bool kPhysicalSky;
    explicit FrameAir(const PictureFrame& of) : frame(of), kPhysicalSky(of.sky != nullptr) {}

    HWY_INLINE Floats3 sky_layer(Floats across, Floats upwards, unsigned layer) {
        return HWY_NAMESPACE::sky_layer(frame, across, upwards, layer);
    }
    HWY_INLINE Floats3 light_of_air(Floats column, Floats row, const Floats3& around, Floats phase) {
        const auto layers = [&](unsigned first) {
            const auto layer = [&](unsigned n) { return sky_layer(column, row, kAirLayer + first + n); };
            return times_add(around.z, layer(2), times_add(around.y, layer(1), times(around.x, layer(0))));
        };
        return times_add(phase, layers(4), layers(1));
    }
#pragma push_macro("NEPHOS_FUNCTION")
#undef NEPHOS_FUNCTION
#define NEPHOS_FUNCTION HWY_INLINE
#define Real(value) set(value)
#include "render/shared/air.h"
#undef Real
#pragma pop_macro("NEPHOS_FUNCTION")
};

}  // namespace formulas

using formulas::FrameAir;
using SunlitAir = FrameAir::SunlitAir;

HWY_INLINE Floats3 air_transmittance(const PictureFrame& frame, const Floats3& ray, Floats distance_m) {
    return FrameAir(frame).air_transmittance(ray, distance_m);
}
// The same to what fast_exp() is good for.
HWY_INLINE Floats3 clear_air(const PictureFrame& frame, const Floats3& ray, Floats distance_m) {
    const Floats3 depth = FrameAir(frame).air_depth(ray, distance_m);
    return {fast_exp(hn::Neg(depth.x)), fast_exp(hn::Neg(depth.y)), fast_exp(hn::Neg(depth.z))};
}
HWY_INLINE Floats3 air_source(const PictureFrame& frame, const Floats3& ray, Floats distance_m) {
    return FrameAir(frame).air_source(ray, distance_m);
}
HWY_INLINE Floats3 air_light(const PictureFrame& frame, const Floats3& ray, Floats distance_m, const Floats3& beta) {
    return FrameAir(frame).air_light(ray, distance_m, beta);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
