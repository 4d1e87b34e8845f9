// SPDX-License-Identifier: Apache-2.0

// render/shading/ray.glsl, air.glsl and background.glsl for vectors of pixels.

#if defined(NEPHOS_RENDER_BACKGROUND_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_BACKGROUND_INL_H_
#undef NEPHOS_RENDER_BACKGROUND_INL_H_
#else
#define NEPHOS_RENDER_BACKGROUND_INL_H_
#endif

#include <cmath>
#include <cstdint>

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/frame/frame_data.h"
#include "render/shading/formulas-inl.h"
#include "render/shared/shared.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

struct Floats3 {
    Floats x, y, z;
};

HWY_INLINE Floats3 set3(const shader::vec4& v) { return {set(v.x), set(v.y), set(v.z)}; }
HWY_INLINE Floats3 add(const Floats3& a, const Floats3& b) {
    return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}
HWY_INLINE Floats3 subtract(const Floats3& a, const Floats3& b) {
    return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}
HWY_INLINE Floats3 times(Floats s, const Floats3& v) {
    return {hn::Mul(s, v.x), hn::Mul(s, v.y), hn::Mul(s, v.z)};
}
// s a + b
HWY_INLINE Floats3 times_add(Floats s, const Floats3& a, const Floats3& b) {
    return {hn::MulAdd(s, a.x, b.x), hn::MulAdd(s, a.y, b.y), hn::MulAdd(s, a.z, b.z)};
}
HWY_INLINE Floats3 each_times(const Floats3& a, const Floats3& b) {
    return {hn::Mul(a.x, b.x), hn::Mul(a.y, b.y), hn::Mul(a.z, b.z)};
}
HWY_INLINE Floats3 mix(const Floats3& a, const Floats3& b, const Floats3& share) {
    return {hn::MulAdd(share.x, hn::Sub(b.x, a.x), a.x), hn::MulAdd(share.y, hn::Sub(b.y, a.y), a.y),
            hn::MulAdd(share.z, hn::Sub(b.z, a.z), a.z)};
}
HWY_INLINE Floats dot(const Floats3& a, const Floats3& b) {
    return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}
HWY_INLINE Floats3 cross(const Floats3& a, const Floats3& b) {
    return {hn::MulSub(a.y, b.z, hn::Mul(a.z, b.y)), hn::MulSub(a.z, b.x, hn::Mul(a.x, b.z)),
            hn::MulSub(a.x, b.y, hn::Mul(a.y, b.x))};
}
// exp(-rgb distance)
HWY_INLINE Floats3 decay(const shader::vec4& per_m, Floats distance_m) {
    const Lanes d;
    return {hn::Exp(d, hn::Mul(set(-per_m.x), distance_m)), hn::Exp(d, hn::Mul(set(-per_m.y), distance_m)),
            hn::Exp(d, hn::Mul(set(-per_m.z), distance_m))};
}

// Direction of the ray through a point of the part of the picture; its part along the view axis is 1.
HWY_INLINE Floats3 pixel_direction(const PictureFrame& frame, Floats x, Floats y) {
    const Floats across =
                     hn::MulAdd(hn::Add(x, set(frame.picture.z)), set(2.0f / frame.picture.x), set(-1.0f)),
                 upward =
                     hn::NegMulAdd(hn::Add(y, set(frame.picture.w)), set(2.0f / frame.picture.y), set(1.0f));
    return times_add(upward, set3(frame.up), times_add(across, set3(frame.right), set3(frame.forward)));
}

inline constexpr float kNowhere = 1.0e30f;  // distance of the ground where a ray does not meet it

HWY_INLINE Floats ground_distance(const PictureFrame& frame, Floats ray_z) {
    const auto meets = hn::Lt(ray_z, set(frame.ground_sun.w > 0 ? 0.0f : -2.0f));
    const Floats distance = hn::Min(hn::Div(set(frame.ground.w), ray_z), set(kNowhere));
    return hn::IfThenElse(meets, distance, set(kNowhere));
}

// render/shading/air.glsl. A layer of the sky's tables between four texels; places are 0..1.
HWY_INLINE Floats3 sky_layer(const PictureFrame& frame, Floats across, Floats upwards, std::size_t layer) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    constexpr int kColumns = int(shader::kSkyColumns), kRows = int(shader::kSkyRows);
    const Floats x = hn::Mul(across, set(float(kColumns - 1))), y = hn::Mul(upwards, set(float(kRows - 1)));
    const Floats x0 = hn::Min(hn::Floor(x), set(float(kColumns - 2))),
                 y0 = hn::Min(hn::Floor(y), set(float(kRows - 2)));
    const Floats share_x = hn::Sub(x, x0), share_y = hn::Sub(y, y0);
    const auto index = hn::ShiftLeft<2>(
        hn::Add(hn::Mul(hn::ConvertTo(di, y0), hn::Set(di, kColumns)), hn::ConvertTo(di, x0)));
    const float* texels = frame.sky + 4 * layer * std::size_t(kColumns * kRows);
    const auto channel = [&](const float* from) {
        const auto row = [&](const float* first) {
            const Floats a = hn::GatherIndex(d, first, index), b = hn::GatherIndex(d, first + 4, index);
            return hn::MulAdd(share_x, hn::Sub(b, a), a);
        };
        const Floats a = row(from), b = row(from + 4 * kColumns);
        return hn::MulAdd(share_y, hn::Sub(b, a), a);
    };
    return {channel(texels), channel(texels + 1), channel(texels + 2)};
}

HWY_INLINE Floats3 sky_scattered(const PictureFrame& frame, const Floats3& ray) {
    const Floats one = set(1.0f);
    const Floats level = hn::MulAdd(ray.x, ray.x, hn::Mul(ray.y, ray.y));
    const float sun_level = frame.to_sun.x * frame.to_sun.x + frame.to_sun.y * frame.to_sun.y;
    const Floats beside = hn::Div(hn::MulAdd(ray.x, set(frame.to_sun.x), hn::Mul(ray.y, set(frame.to_sun.y))),
                                  hn::Sqrt(hn::Max(hn::Mul(level, set(sun_level)), set(1.0e-12f))));
    const Floats across = sky_across(hn::Max(hn::Min(beside, one), hn::Neg(one))),
                 upwards = sky_upwards(hn::Min(hn::Abs(ray.z), one));
    const Floats phase = particle_phase(dot(set3(frame.to_sun), ray), frame.air.y);
    return times_add(phase, sky_layer(frame, across, upwards, 1), sky_layer(frame, across, upwards, 0));
}

HWY_INLINE Floats3 sunlight_at(const PictureFrame& frame, Floats height) {
    if (frame.sky == nullptr) return set3(frame.sunlight);
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    constexpr int kColumns = int(shader::kSkyColumns), kTexels = kColumns * int(shader::kSkyRows);
    const Floats altitude = hn::Mul(hn::Add(set(frame.air.x), height), set(1.0f / shader::kSunlightTop));
    const Floats x = hn::Mul(hn::Max(hn::Min(altitude, set(1.0f)), hn::Zero(d)), set(float(kColumns - 1)));
    const Floats below = hn::Min(hn::Floor(x), set(float(kColumns - 2))), share = hn::Sub(x, below);
    const auto index = hn::ShiftLeft<2>(hn::ConvertTo(di, below));
    const float* texels = frame.sky + 4 * 2 * kTexels;  // the first row of the third layer
    const auto channel = [&](const float* first) {
        const Floats a = hn::GatherIndex(d, first, index), b = hn::GatherIndex(d, first + 4, index);
        return hn::MulAdd(share, hn::Sub(b, a), a);
    };
    return {channel(texels), channel(texels + 1), channel(texels + 2)};
}

HWY_INLINE Floats3 air_transmittance(const PictureFrame& frame, const Floats3& ray, Floats distance_m) {
    if (frame.sky == nullptr) return decay(frame.air_extinction, distance_m);
    const Lanes d;
    const Floats rayleigh = layer_column(frame.air.x, ray.z, distance_m, frame.rayleigh.w),
                 haze = layer_column(frame.air.x, ray.z, distance_m, frame.haze.w);
    const Floats3 depth = times_add(rayleigh, set3(frame.rayleigh), times(haze, set3(frame.haze)));
    return {hn::Exp(d, hn::Neg(depth.x)), hn::Exp(d, hn::Neg(depth.y)), hn::Exp(d, hn::Neg(depth.z))};
}

HWY_INLINE Floats3 endless_air(const PictureFrame& frame, const Floats3& ray) {
    if (frame.sky == nullptr) return set3(frame.horizon);
    const Lanes d;
    const Floats one = set(1.0f), slope = hn::Max(hn::Abs(ray.z), set(1.0e-5f));
    const auto column = [&](float per_height) {
        return hn::Div(set(std::exp(-frame.air.x * per_height) / per_height), slope);
    };
    const Floats3 depth = times_add(column(frame.rayleigh.w), set3(frame.rayleigh),
                                    times(column(frame.haze.w), set3(frame.haze)));
    const auto share = [&](Floats part, Floats whole) {
        return hn::Div(part, hn::Max(hn::Sub(one, hn::Exp(d, hn::Neg(whole))), set(1.0e-4f)));
    };
    const Floats3 sky = sky_scattered(frame, ray);
    return {share(sky.x, depth.x), share(sky.y, depth.y), share(sky.z, depth.z)};
}

HWY_INLINE Floats3 air_light(const PictureFrame& frame, const Floats3& ray, const Floats3& beta) {
    const Floats one = set(1.0f);
    return each_times({hn::Sub(one, beta.x), hn::Sub(one, beta.y), hn::Sub(one, beta.z)},
                      endless_air(frame, ray));
}

HWY_INLINE Floats3 gradient_sky(const PictureFrame& frame, Floats height) {
    constexpr float kFalloff = 4.0f;
    const float least = std::exp(-kFalloff);
    const Floats haze = hn::Mul(hn::Sub(hn::Exp(Lanes(), hn::Mul(set(-kFalloff), height)), set(least)),
                                set(1.0f / (1.0f - least)));
    return mix(set3(frame.zenith), set3(frame.horizon), {haze, haze, haze});
}

struct SunlitAir {
    Floats3 endless, most;
    Floats molecules, particles;
};

HWY_INLINE Floats3 least(const Floats3& a, const Floats3& b) {
    return {hn::Min(a.x, b.x), hn::Min(a.y, b.y), hn::Min(a.z, b.z)};
}

HWY_INLINE SunlitAir sunlit_air(const PictureFrame& frame, const Floats3& ray) {
    const Floats zero = hn::Zero(Lanes()), cosine = dot(set3(frame.to_sun), ray);
    const Floats3 endless = endless_air(frame, ray);
    if (frame.sky != nullptr)
        return {endless, endless, hn::Mul(set(shader::kPi), molecule_phase(cosine)),
                hn::Mul(set(shader::kPi * frame.air.z), particle_phase(cosine, frame.air.y))};
    const Floats phase = particle_phase(cosine, frame.zenith.w);
    const Floats direct = hn::Mul(set(frame.horizon.w * 4.0f * shader::kPi), phase);
    const Floats share = hn::Div(direct, hn::Add(direct, set(1.0f - frame.horizon.w + 1.0e-6f)));
    const Floats3 above = gradient_sky(frame, hn::Max(ray.z, zero));
    return {endless, times(share, least(endless, above)), zero, zero};
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

struct ShadowTexels {
    const float* texels = nullptr;
    int size = 0;
};

// Samples the shadow map bilinearly; points beyond it are fully lit.
HWY_INLINE Floats shadow_at(const ShadowTexels& map, Floats u, Floats v) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    const Floats size = set(float(map.size)), low = set(-2.0f), high = set(float(map.size) + 1.0f);
    const Floats x = hn::Min(hn::Max(hn::MulSub(u, size, set(0.5f)), low), high),
                 y = hn::Min(hn::Max(hn::MulSub(v, size, set(0.5f)), low), high);
    const Floats x0 = hn::Floor(x), y0 = hn::Floor(y);
    const auto texel = [&](Floats column, Floats row) {
        const Floats last = set(float(map.size - 1)), zero = hn::Zero(d);
        const Floats inside_x = hn::Min(hn::Max(column, zero), last),
                     inside_y = hn::Min(hn::Max(row, zero), last);
        const auto index =
            hn::Add(hn::Mul(hn::ConvertTo(di, inside_y), hn::Set(di, map.size)), hn::ConvertTo(di, inside_x));
        const auto inside = hn::And(hn::Eq(column, inside_x), hn::Eq(row, inside_y));
        return hn::IfThenElse(inside, hn::GatherIndex(d, map.texels, index), set(1.0f));
    };
    const Floats x1 = hn::Add(x0, set(1.0f)), y1 = hn::Add(y0, set(1.0f));
    const Floats share_x = hn::Sub(x, x0), share_y = hn::Sub(y, y0);
    const auto between = [](Floats a, Floats b, Floats share) { return hn::MulAdd(share, hn::Sub(b, a), a); };
    return between(between(texel(x0, y0), texel(x1, y0), share_x),
                   between(texel(x0, y1), texel(x1, y1), share_x), share_y);
}

// render/shading/background.glsl.
HWY_INLINE Floats3 sun_disc(const PictureFrame& frame, const Floats3& ray) {
    const Lanes d;
    const Floats zero = hn::Zero(d), one = set(1.0f);
    constexpr float kRadius = shader::kSunRadius;
    const Floats3 apart = subtract(ray, set3(frame.to_sun));
    const Floats angle = hn::Sqrt(dot(apart, apart));
    const Floats edge = hn::MulAdd(hn::Sub(set(kRadius), angle), set(frame.up.w), set(0.5f));
    const Floats covered = hn::Mul(hn::Max(hn::Min(edge, one), zero), set(frame.sun_disc.w));
    if (hn::AllFalse(d, hn::Gt(covered, zero))) return {zero, zero, zero};
    const Floats across = hn::Min(hn::Mul(angle, set(1.0f / kRadius)), one);
    const Floats log_cosine =
        hn::Mul(set(0.5f), hn::Log(d, hn::Max(hn::NegMulAdd(across, across, one), set(1.0e-4f))));
    const Floats rise = hn::Max(hn::Min(apart.z, set(kRadius)), set(-kRadius));
    const auto of = [&](float middle, float fade, float darkening) {
        const Floats power = hn::MulAdd(set(darkening), log_cosine, hn::Mul(set(fade), rise));
        return hn::Mul(hn::Mul(covered, set(middle)), hn::Exp(d, power));
    };
    return {of(frame.sun_disc.x, frame.sun_fade.x, shader::kLimbDarkeningRed),
            of(frame.sun_disc.y, frame.sun_fade.y, shader::kLimbDarkeningGreen),
            of(frame.sun_disc.z, frame.sun_fade.z, shader::kLimbDarkeningBlue)};
}

HWY_INLINE Floats3 sky(const PictureFrame& frame, const Floats3& ray) {
    const Floats height = hn::Max(ray.z, hn::Zero(Lanes()));
    if (frame.sky != nullptr) {
        const Floats3 upwards{ray.x, ray.y, height};
        return add(sky_scattered(frame, upwards), sun_disc(frame, upwards));
    }
    return gradient_sky(frame, height);
}

// Returns the radiance of the ground at a point relative to the eye, without the air in front of it.
HWY_INLINE Floats3 ground_light(const PictureFrame& frame, const ShadowTexels& map, const Floats3& point) {
    const Floats u = hn::Add(dot(set3(frame.shadow_u), point), set(frame.shadow_u.w)),
                 v = hn::Add(dot(set3(frame.shadow_v), point), set(frame.shadow_v.w));
    const Floats3 colour = times_add(shadow_at(map, u, v), set3(frame.ground_sun), set3(frame.ground));
    if (!(frame.flash.w > 0)) return colour;
    const Floats3 way = subtract(set3(frame.flash), point);
    const Floats squared = dot(way, way);
    const Floats cosine =
        hn::Div(hn::Max(way.z, hn::Zero(Lanes())), hn::Sqrt(hn::Max(squared, set(1.0e-6f))));
    return times_add(hn::Mul(flash_falloff(squared), cosine), set3(frame.ground_flash), colour);
}

HWY_INLINE Floats3 ground(const PictureFrame& frame, const ShadowTexels& map, const Floats3& ray,
                          Floats distance) {
    const Floats3 beta = air_transmittance(frame, ray, distance);
    return add(each_times(beta, ground_light(frame, map, times(distance, ray))), air_light(frame, ray, beta));
}

// Returns the radiance behind the clouds along unit rays: sky or ground, with the air in front of it.
HWY_INLINE Floats3 background(const PictureFrame& frame, const ShadowTexels& map, const Floats3& ray) {
    const Lanes d;
    const Floats distance = ground_distance(frame, ray.z);
    const auto meets = hn::Lt(distance, set(kNowhere));
    if (hn::AllFalse(d, meets)) return sky(frame, ray);
    const Floats3 below = ground(frame, map, ray, hn::IfThenElse(meets, distance, hn::Zero(d)));
    if (hn::AllTrue(d, meets)) return below;
    const Floats3 above = sky(frame, ray);
    return {hn::IfThenElse(meets, below.x, above.x), hn::IfThenElse(meets, below.y, above.y),
            hn::IfThenElse(meets, below.z, above.z)};
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
