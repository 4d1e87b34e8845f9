// SPDX-License-Identifier: Apache-2.0

// shaders/ray.glsl and shaders/background.glsl for vectors of pixels.

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

#include "render/column-inl.h"
#include "render/shaders/shared.h"

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
HWY_INLINE Floats3 pixel_direction(const shader::Frame& frame, Floats x, Floats y) {
    const Floats across =
                     hn::MulAdd(hn::Add(x, set(frame.picture.z)), set(2.0f / frame.picture.x), set(-1.0f)),
                 upward =
                     hn::NegMulAdd(hn::Add(y, set(frame.picture.w)), set(2.0f / frame.picture.y), set(1.0f));
    return times_add(upward, set3(frame.up), times_add(across, set3(frame.right), set3(frame.forward)));
}

inline constexpr float kNowhere = 1.0e30f;  // distance of the ground where a ray does not meet it

HWY_INLINE Floats ground_distance(const shader::Frame& frame, Floats ray_z) {
    const auto meets = hn::Lt(ray_z, set(frame.ground_sun.w > 0 ? 0.0f : -2.0f));
    const Floats distance = hn::Min(hn::Div(set(frame.ground.w), ray_z), set(kNowhere));
    return hn::IfThenElse(meets, distance, set(kNowhere));
}

// Irradiance of lightning relative to that at 1 km (flash_falloff() of shaders/shared.h).
HWY_INLINE Floats flash_falloff(Floats squared_m) {
    return hn::Div(set(1.0e6f), hn::Max(squared_m, set(1.0e4f)));
}

// shaders/air.glsl: D's beta, and the radiance of the air itself in full light.
HWY_INLINE Floats3 air_transmittance(const shader::Frame& frame, const Floats3& /*ray*/, Floats distance_m) {
    return decay(frame.air_extinction, distance_m);
}
HWY_INLINE Floats3 air_light(const shader::Frame& frame, const Floats3& /*ray*/, const Floats3& beta) {
    const Floats one = set(1.0f);
    return each_times({hn::Sub(one, beta.x), hn::Sub(one, beta.y), hn::Sub(one, beta.z)},
                      set3(frame.horizon));
}

struct ShadowTexels {
    const float* texels = nullptr;
    int size = 0;
};

// The map between the middles of four texels; what lies beyond it is in full light.
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

// The air is thickest at the horizon: its colour falls off exponentially with height, and reaches zero at the
// zenith.
HWY_INLINE Floats3 sky(const shader::Frame& frame, Floats height) {
    constexpr float kFalloff = 4.0f;
    const float least = std::exp(-kFalloff);
    const Floats haze = hn::Mul(hn::Sub(hn::Exp(Lanes(), hn::Mul(set(-kFalloff), height)), set(least)),
                                set(1.0f / (1.0f - least)));
    return mix(set3(frame.zenith), set3(frame.horizon), {haze, haze, haze});
}

// Radiance of the ground at a point relative to the eye, without the air before it.
HWY_INLINE Floats3 ground_light(const shader::Frame& frame, const ShadowTexels& map, const Floats3& point) {
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

HWY_INLINE Floats3 ground(const shader::Frame& frame, const ShadowTexels& map, const Floats3& ray,
                          Floats distance) {
    const Floats3 beta = air_transmittance(frame, ray, distance);
    return add(each_times(beta, ground_light(frame, map, times(distance, ray))), air_light(frame, ray, beta));
}

// What lies behind the clouds along unit rays.
HWY_INLINE Floats3 background(const shader::Frame& frame, const ShadowTexels& map, const Floats3& ray) {
    const Lanes d;
    const Floats distance = ground_distance(frame, ray.z);
    const auto meets = hn::Lt(distance, set(kNowhere));
    if (hn::AllFalse(d, meets)) return sky(frame, hn::Max(ray.z, hn::Zero(d)));
    const Floats3 below = ground(frame, map, ray, hn::IfThenElse(meets, distance, hn::Zero(d)));
    if (hn::AllTrue(d, meets)) return below;
    const Floats3 above = sky(frame, hn::Max(ray.z, hn::Zero(d)));
    return {hn::IfThenElse(meets, below.x, above.x), hn::IfThenElse(meets, below.y, above.y),
            hn::IfThenElse(meets, below.z, above.z)};
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
