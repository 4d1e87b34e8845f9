// SPDX-License-Identifier: Apache-2.0

// render/shading/ray.glsl and background.glsl for vectors of pixels.

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
#include "render/image/ground_light.h"
#include "render/shading/air-inl.h"
#include "render/shading/endless-inl.h"
#include "render/shading/floats3-inl.h"
#include "render/shading/formulas-inl.h"
#include "render/shared/shared.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

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
    if (frame.sky != nullptr) {
        const auto below = hn::Lt(ray_z, set(frame.ground_sun.w > 0 ? frame.earth.x : -2.0f));
        const Floats way = hn::Min(sphere_distance(ray_z, frame.earth.x, frame.earth.y), set(kNowhere));
        return hn::IfThenElse(below, way, set(kNowhere));
    }
    const auto meets = hn::Lt(ray_z, set(frame.ground_sun.w > 0 ? 0.0f : -2.0f));
    const Floats distance = hn::Min(hn::Div(set(frame.ground.w), ray_z), set(kNowhere));
    return hn::IfThenElse(meets, distance, set(kNowhere));
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
    const Floats fraction_x = hn::Sub(x, x0), fraction_y = hn::Sub(y, y0);
    const auto between = [](Floats a, Floats b, Floats fraction) {
        return hn::MulAdd(fraction, hn::Sub(b, a), a);
    };
    return between(between(texel(x0, y0), texel(x1, y0), fraction_x),
                   between(texel(x0, y1), texel(x1, y1), fraction_x), fraction_y);
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
    if (frame.sky != nullptr) return add(FrameAir(frame).sky_scattered(ray), sun_disc(frame, ray));
    return FrameAir(frame).gradient_sky(hn::Max(ray.z, hn::Zero(Lanes())));
}

// Fractions of the light of open ground at points relative to the eye: scattered sunlight, and the sky's.
struct LightBelow {
    Floats sun, sky;
};

HWY_INLINE LightBelow light_below(const GroundLight& light, const shader::vec4& place, const Floats3& point) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    constexpr float kLast = float(GroundLight::kTexels - 1);
    const auto inside = [&](Floats at) { return hn::Min(hn::Max(at, hn::Zero(d)), set(kLast)); };
    const Floats x = inside(hn::MulAdd(set(place.x), point.x, set(place.z))),
                 y = inside(hn::MulAdd(set(place.y), point.y, set(place.w)));
    const Floats i = hn::Min(hn::Floor(x), set(kLast - 1)), j = hn::Min(hn::Floor(y), set(kLast - 1));
    const auto first = hn::ConvertTo(di, hn::MulAdd(j, set(float(GroundLight::kTexels)), i));
    const auto texel = [&](int offset) {
        const auto word = hn::GatherIndex(di, reinterpret_cast<const std::int32_t*>(light.words.data()),
                                          hn::Add(first, hn::Set(di, offset)));
        return LightBelow{hn::ConvertTo(d, hn::And(word, hn::Set(di, 0xFFFF))),
                          hn::ConvertTo(d, hn::And(hn::ShiftRight<16>(word), hn::Set(di, 0xFFFF)))};
    };
    const auto between = [](const LightBelow& a, const LightBelow& b, Floats part) {
        return LightBelow{hn::MulAdd(part, hn::Sub(b.sun, a.sun), a.sun), hn::MulAdd(part, hn::Sub(b.sky, a.sky), a.sky)};
    };
    const LightBelow of = between(between(texel(0), texel(1), hn::Sub(x, i)),
                                  between(texel(GroundLight::kTexels), texel(GroundLight::kTexels + 1), hn::Sub(x, i)),
                                  hn::Sub(y, j));
    return {hn::Mul(of.sun, set(1.0f / 65535)), hn::Mul(of.sky, set(1.0f / 65535))};
}

// Returns the fraction of direct sunlight that arrives on the ground at a point relative to the eye.
HWY_INLINE Floats sun_share(const PictureFrame& frame, const ShadowTexels& map, const Floats3& point) {
    const Floats u = hn::Add(dot(set3(frame.shadow_u), point), set(frame.shadow_u.w)),
                 v = hn::Add(dot(set3(frame.shadow_v), point), set(frame.shadow_v.w));
    const Floats shadow = shadow_at(map, u, v);
    if (frame.endless == nullptr) return shadow;
    const auto inside = [](Floats at) { return hn::And(hn::Gt(at, set(0.01f)), hn::Lt(at, set(0.99f))); };
    const auto known = hn::And(hn::And(inside(u), inside(v)), sees_first_period(*frame.endless, point));
    if (hn::AllTrue(Lanes(), known)) return shadow;
    return hn::IfThenElse(known, shadow, sunlight_beyond(*frame.endless, point));
}

// Returns the radiance of the ground at a point relative to the eye, without the air in front of it.
HWY_INLINE Floats3 ground_light(const PictureFrame& frame, const ShadowTexels& map, const Floats3& point) {
    const Floats shadow = sun_share(frame, map, point);
    Floats3 colour = times_add(shadow, set3(frame.ground_sun), set3(frame.ground));
    if (frame.ground_light != nullptr) {
        const LightBelow below = light_below(*frame.ground_light, frame.ground_light_place, point);
        colour = times_add(hn::Add(shadow, below.sun), set3(frame.ground_sun), times(below.sky, set3(frame.ground)));
    }
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
    return add(each_times(beta, ground_light(frame, map, times(distance, ray))), air_light(frame, ray, distance, beta));
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
