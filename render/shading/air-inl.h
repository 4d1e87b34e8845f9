// SPDX-License-Identifier: Apache-2.0

// render/shading/air.glsl for vectors of pixels: the tables of the sky, and clear air along rays.

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

// exp(-rgb distance)
HWY_INLINE Floats3 decay(const shader::vec4& per_m, Floats distance_m) {
    const Lanes d;
    return {hn::Exp(d, hn::Mul(set(-per_m.x), distance_m)), hn::Exp(d, hn::Mul(set(-per_m.y), distance_m)),
            hn::Exp(d, hn::Mul(set(-per_m.z), distance_m))};
}

// render/shading/air.glsl. A layer of the sky's tables between four texels; places are 0..1.
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

// Returns the cosine of the azimuth between rays and the sun.
HWY_INLINE Floats beside_sun(const PictureFrame& frame, const Floats3& ray) {
    const Floats one = set(1.0f);
    const Floats level = hn::MulAdd(ray.x, ray.x, hn::Mul(ray.y, ray.y));
    const float sun_level = frame.to_sun.x * frame.to_sun.x + frame.to_sun.y * frame.to_sun.y;
    const Floats beside = hn::Div(hn::MulAdd(ray.x, set(frame.to_sun.x), hn::Mul(ray.y, set(frame.to_sun.y))),
                                  hn::Sqrt(hn::Max(hn::Mul(level, set(sun_level)), set(1.0e-12f))));
    return hn::Max(hn::Min(beside, one), hn::Neg(one));
}

HWY_INLINE Floats3 sky_scattered(const PictureFrame& frame, const Floats3& ray) {
    const Floats across = sky_across(beside_sun(frame, ray)),
                 upwards = air_row(hn::Max(ray.z, set(frame.earth.x)), frame.earth.x);
    const Floats phase = particle_phase(dot(set3(frame.to_sun), ray), frame.air.y);
    return times_add(phase, sky_layer(frame, across, upwards, 1), sky_layer(frame, across, upwards, 0));
}

// A place in the table of air between four texels.
struct AirPlace {
    hn::Vec<hn::RebindToSigned<Lanes>> index;
    Floats across, upwards;  // fractions
};

HWY_INLINE AirPlace air_place(const PictureFrame& frame, const Floats3& ray, Floats distance) {
    const hn::RebindToSigned<Lanes> di;
    constexpr int kColumns = int(shader::kSkyColumns), kRows = int(shader::kAirRows);
    const float horizon = frame.earth.x;
    const Floats x =
                     hn::Mul(air_distance(distance, ray.z, horizon, frame.earth.y), set(float(kColumns - 1))),
                 y = hn::Mul(air_row(ray.z, horizon), set(float(kRows - 1)));
    const Floats x0 = hn::Min(hn::Floor(x), set(float(kColumns - 2))),
                 y0 = hn::Min(hn::Floor(y), set(float(kRows - 2)));
    const Floats first = hn::IfThenElseZero(hn::Ge(ray.z, set(horizon)), set(float(kRows)));
    const auto row = hn::ConvertTo(di, hn::Add(y0, first));
    return {hn::ShiftLeft<2>(hn::Add(hn::Mul(row, hn::Set(di, kColumns)), hn::ConvertTo(di, x0))),
            hn::Sub(x, x0), hn::Sub(y, y0)};
}

// `layer`: from shader::kAirLayer on.
HWY_INLINE Floats3 air_layer_at(const PictureFrame& frame, const AirPlace& place, std::size_t layer) {
    const Lanes d;
    constexpr std::size_t kColumns = shader::kSkyColumns, kTexels = kColumns * shader::kSkyRows;
    const float* const texels = frame.sky + 4 * layer * kTexels;
    const auto channel = [&](const float* from) {
        const auto row = [&](const float* first) {
            const Floats a = hn::GatherIndex(d, first, place.index),
                         b = hn::GatherIndex(d, first + 4, place.index);
            return hn::MulAdd(place.across, hn::Sub(b, a), a);
        };
        const Floats a = row(from), b = row(from + 4 * kColumns);
        return hn::MulAdd(place.upwards, hn::Sub(b, a), a);
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

HWY_INLINE Floats3 air_transmittance(const PictureFrame& frame, const Floats3& ray, Floats distance_m) {
    if (frame.sky == nullptr) return decay(frame.air_extinction, distance_m);
    const Lanes d;
    const Floats3 extinction =
        air_layer_at(frame, air_place(frame, ray, distance_m), std::size_t(shader::kAirLayer));
    const Floats3 depth = times(distance_m, extinction);
    return {hn::Exp(d, hn::Neg(depth.x)), hn::Exp(d, hn::Neg(depth.y)), hn::Exp(d, hn::Neg(depth.z))};
}

HWY_INLINE Floats3 air_source(const PictureFrame& frame, const Floats3& ray, Floats distance_m) {
    if (frame.sky == nullptr) return set3(frame.horizon);
    const AirPlace place = air_place(frame, ray, distance_m);
    const Floats cosine = beside_sun(frame, ray), square = hn::Mul(cosine, cosine), half = set(0.5f);
    const Floats towards = hn::Mul(half, hn::Add(square, cosine)), beside = hn::Sub(set(1.0f), square),
                 away = hn::Mul(half, hn::Sub(square, cosine));
    const auto around = [&](std::size_t first) {
        const auto layer = [&](std::size_t number) {
            return air_layer_at(frame, place, std::size_t(shader::kAirLayer) + number);
        };
        return times_add(away, layer(first + 2),
                         times_add(beside, layer(first + 1), times(towards, layer(first))));
    };
    const Floats3 scattered = around(1), haze = around(4);
    return times_add(particle_phase(dot(set3(frame.to_sun), ray), frame.air.y), haze, scattered);
}

HWY_INLINE Floats3 air_light(const PictureFrame& frame, const Floats3& ray, Floats distance_m,
                             const Floats3& beta) {
    const Floats one = set(1.0f);
    return each_times({hn::Sub(one, beta.x), hn::Sub(one, beta.y), hn::Sub(one, beta.z)},
                      air_source(frame, ray, distance_m));
}

HWY_INLINE Floats3 gradient_sky(const PictureFrame& frame, Floats height) {
    constexpr float kFalloff = 4.0f;
    const float least = std::exp(-kFalloff);
    const Floats haze = hn::Mul(hn::Sub(hn::Exp(Lanes(), hn::Mul(set(-kFalloff), height)), set(least)),
                                set(1.0f / (1.0f - least)));
    return mix(set3(frame.zenith), set3(frame.horizon), {haze, haze, haze});
}

struct SunlitAir {
    Floats3 source, most;
    Floats molecules, particles;
};

HWY_INLINE Floats3 least(const Floats3& a, const Floats3& b) {
    return {hn::Min(a.x, b.x), hn::Min(a.y, b.y), hn::Min(a.z, b.z)};
}

HWY_INLINE SunlitAir sunlit_air(const PictureFrame& frame, const Floats3& ray) {
    const Floats zero = hn::Zero(Lanes()), cosine = dot(set3(frame.to_sun), ray);
    const Floats3 source = air_source(frame, ray, set(shader::kShaftsReach));
    if (frame.sky != nullptr)
        return {source, source, hn::Mul(set(shader::kPi), molecule_phase(cosine)),
                hn::Mul(set(shader::kPi * frame.air.z), particle_phase(cosine, frame.air.y))};
    const Floats phase = particle_phase(cosine, frame.zenith.w);
    const Floats direct = hn::Mul(set(frame.horizon.w * 4.0f * shader::kPi), phase);
    const Floats fraction = hn::Div(direct, hn::Add(direct, set(1.0f - frame.horizon.w + 1.0e-6f)));
    const Floats3 above = gradient_sky(frame, hn::Max(ray.z, zero));
    return {source, times(fraction, least(source, above)), zero, zero};
}

HWY_INLINE Floats3 sunlit_at(const PictureFrame& frame, const SunlitAir& air, Floats height,
                             const Floats3& sunlight) {
    if (frame.sky == nullptr) return air.most;
    const Lanes d;
    const Floats altitude = hn::Max(hn::Add(set(frame.air.x), height), hn::Zero(d));
    const auto density = [&](float per_height) { return fast_exp(hn::Mul(altitude, set(-per_height))); };
    const Floats3 molecules = times(density(frame.rayleigh.w), set3(frame.rayleigh)),
                  particles = times(density(frame.haze.w), set3(frame.haze));
    const Floats3 scattered = times_add(air.molecules, molecules, times(air.particles, particles));
    const Floats3 extinct = add(molecules, particles);
    const auto source = [&](Floats light, Floats part, Floats whole) {
        return hn::Div(hn::Mul(light, part), hn::Max(whole, set(1.0e-12f)));
    };
    return least({source(sunlight.x, scattered.x, extinct.x), source(sunlight.y, scattered.y, extinct.y),
                  source(sunlight.z, scattered.z, extinct.z)},
                 air.most);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
