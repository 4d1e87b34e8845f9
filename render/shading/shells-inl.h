// SPDX-License-Identifier: Apache-2.0

// render/shading/shells.glsl for vectors of pixels: the shells of air around the eye (air_shells.h,
// docs/air.md).

#if defined(NEPHOS_RENDER_SHELLS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_SHELLS_INL_H_
#undef NEPHOS_RENDER_SHELLS_INL_H_
#else
#define NEPHOS_RENDER_SHELLS_INL_H_
#endif

#include <algorithm>
#include <cstdint>

#include <hwy/highway.h>

#include "render/frame/air_shells.h"
#include "render/shading/air-inl.h"
#include "render/shading/background-inl.h"
#include "render/shading/endless-inl.h"
#include "render/shading/fog-inl.h"
#include "render/shading/formulas-inl.h"
#include "render/shading/scattering-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// The effect of a layer of air on the light behind it: light = light * transmittance + light of the layer.
struct AirLayer {
    Floats3 light;
    Floats transmittance;
    Floats distance;  // where half of what the layer hides is hidden
};

HWY_INLINE Floats along_row(const shader::vec4& row, const Floats3& point) {
    return hn::Add(dot(set3(row), point), set(row.w));
}

// Fraction of the sunlight that the clouds leave at points relative to the eye: D's gamma. The shade of a cloud
// begins at its top and is complete at its base.
HWY_INLINE Floats sunlight_left(const AirShells& air, const MarchedScene* endless, const Floats3& point) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    const shader::Shells& data = air.data;
    const auto place = [&](const shader::vec4& row, float largest) {
        return hn::Min(hn::Max(along_row(row, point), hn::Zero(d)), set(largest));
    };
    const Floats u = place(data.shade_u, data.shade.x), v = place(data.shade_v, data.shade.y);
    auto known = hn::FirstN(d, hn::Lanes(d));  // by the shade map: elsewhere by what repeats
    if (endless != nullptr) {
        const auto inner = [&](Floats at, float largest) {
            return hn::And(hn::Gt(at, set(2.0f)), hn::Lt(at, set(largest - 2)));
        };
        known = hn::And(hn::And(inner(u, data.shade.x), inner(v, data.shade.y)), sees_first_period(*endless, point));
    }
    if (hn::AllFalse(d, known)) return sunlight_beyond(*endless, point);
    const auto with_beyond = [&](Floats left) {
        return hn::AllTrue(d, known) ? left : hn::IfThenElse(known, left, sunlight_beyond(*endless, point));
    };
    const auto column = hn::ConvertTo(di, u), row = hn::ConvertTo(di, v);
    const Floats weight_u = hn::Sub(u, hn::ConvertTo(d, column)),
                 weight_v = hn::Sub(v, hn::ConvertTo(d, row));
    const auto columns = std::int32_t(data.settings.z), plane = std::int32_t(data.settings.w);
    const auto index = hn::Add(hn::Mul(row, hn::Set(di, columns)), column);
    const auto* words = reinterpret_cast<const std::int32_t*>(air.shade.data());
    const auto of_plane = [&](int number) {
        return between_bytes(hn::GatherIndex(di, words + number * plane, index), weight_u, weight_v);
    };
    const Floats gamma = of_plane(0), along = along_row(data.shade_along, point), one = set(1.0f);
    if (hn::AllTrue(d, hn::Ge(along, one))) return with_beyond(gamma);  // below all clouds
    const Floats begin = of_plane(1), length = hn::Max(hn::Sub(of_plane(2), begin), set(1.0f / 255.0f));
    const Floats part = hn::Min(hn::Max(hn::Div(hn::Sub(along, begin), length), hn::Zero(d)), one);
    return with_beyond(hn::NegMulAdd(part, hn::Sub(one, gamma), one));
}

// The terms common to all shells along rays.
struct RayAir {
    Floats3 ray;
    SunlitAir sunlit;
    Floats3 once;  // scattered by fog
    Words angle;  // to the sun: the nearest node of the table of what is scattered often

    RayAir(const PictureFrame& frame, const Floats3& direction)
        : ray(direction),
          sunlit(FrameAir(frame).sunlit_air(direction)),
          once{hn::Zero(Lanes()), hn::Zero(Lanes()), hn::Zero(Lanes())},
          angle(hn::Zero(hn::RebindToSigned<Lanes>())) {
        if (!frame.shells->has_fog()) return;
        const Floats cosine = dot(set3(frame.to_sun), direction);
        const Between column = scatter_column(cosine);
        once = scattered_once(frame, cosine);
        angle = hn::Add(column.below, hn::ConvertTo(hn::RebindToSigned<Lanes>(), hn::Round(column.fraction)));
    }
};

HWY_INLINE Floats3 fog_radiance(const PictureFrame& frame, const RayAir& of, Floats at,
                                const Floats3& sunlight, Floats lit) {
    const shader::Shells& data = frame.shells->data;
    const Floats above_base = hn::MulAdd(of.ray.z, at, set(data.fog.z));
    const Floats dense = fast_exp(hn::Min(hn::Mul(above_base, set(-data.fog.y)), set(60.0f)));
    const Floats above = hn::Mul(set(data.fog.x / data.fog.y), dense);
    const Floats sun_depth = hn::Mul(above, set(1.0f / std::max(frame.to_sun.z, 0.05f)));
    const Floats often = scattered_often(frame, of.angle, sun_depth);
    const Floats3 sun = times(lit, times_add(fast_exp(hn::Neg(sun_depth)), of.once, {often, often, often}));
    const Floats open = fast_exp(hn::Mul(set(-0.5f), above));
    const Floats3 ambient = mix(set3(frame.ambient_base), set3(frame.ambient_top), {open, open, open});
    Floats3 arriving = each_times_add(sun, sunlight, ambient);
    if (frame.flash.w > 0) {
        const Floats3 way = subtract(set3(frame.flash), times(at, of.ray));
        const Floats weight = hn::Mul(fast_exp(hn::Neg(above)), flash_falloff(dot(way, way)));
        arriving = times_add(hn::Mul(set(frame.flash.w), weight), set3(frame.flash_colour), arriving);
    }
    return times(set(frame.ambient_top.w), arriving);
}

enum class Heights {
    alike,  // pixels of a vector in one shell
    apart,  // splats
};

// The sample positions of a layer of air.
struct AirPlaces {
    Floats at, middle;
};

HWY_INLINE AirPlaces air_places(const AirShells& air, const FogPart& fog, const Floats3& ray, Floats begin,
                                Floats end, Floats weight) {
    const Lanes d;
    const Floats distance = hn::Sub(end, begin), one = set(1.0f), half = set(0.5f), zero = hn::Zero(d);
    const AirPlaces even{hn::MulAdd(weight, distance, begin), hn::MulAdd(half, distance, begin)};
    const auto last = hn::Ge(begin, set(air.data.shade.w));
    const Floats transmittance = fast_exp(hn::Neg(fog.depth));
    const Floats some = hn::Mul(hn::Sub(set(0.99f), transmittance), set(1.0f / 0.09f));
    const Floats much = hn::IfThenElse(last, one, hn::Min(hn::Max(some, zero), one));
    if (hn::AllTrue(d, hn::Le(much, zero))) return even;
    const Floats seen = fog_middle(air, fog, transmittance, ray, begin, end);
    const auto place = [&](Floats without) {
        return hn::IfThenElse(last, seen, hn::MulAdd(much, hn::Sub(seen, without), without));
    };
    return {place(even.at), place(even.middle)};
}

// `before`, `behind`: transmittance of clear air up to the two distances.
template <Heights kHeights>
HWY_INLINE AirLayer air_layer(const PictureFrame& frame, const RayAir& of, const Floats3& before,
                              const Floats3& behind, Floats begin, Floats end, Floats weight) {
    const Lanes d;
    const AirShells& air = *frame.shells;
    const Floats one = set(1.0f), zero = hn::Zero(d);
    const FogPart fog = air.has_fog() ? fog_part(air, of.ray, begin, end) : FogPart{zero, zero};
    const bool foggy = !hn::AllTrue(d, hn::Lt(fog.depth, set(1.0e-5f))), shaded = air.data.settings.y > 0;
    if (!foggy && !shaded) return {{zero, zero, zero}, one, begin};
    const AirPlaces places = air_places(air, fog, of.ray, begin, end, weight);
    const Floats height = hn::Mul(of.ray.z, places.middle);
    const Floats3 sunlight =
        kHeights == Heights::alike ? sunlight_nearby(frame, height) : sunlight_at(frame, height);
    Floats lit = sunlight_left(air, frame.endless, times(places.at, of.ray));
    if (frame.endless != nullptr)  // beyond the last shell but one a place does not stand for tens of kilometres
        lit = hn::IfThenElse(hn::Ge(begin, set(air.data.shade.w)), set(mean_sunlight(*frame.endless)), lit);
    const auto inside = hn::Lt(begin, set(air.data.shade.w));
    Floats3 light{zero, zero, zero};
    if (shaded) {
        const Floats strength = hn::IfThenElseZero(inside, set(air.data.settings.y));
        light = times(hn::Mul(strength, hn::Sub(lit, one)),
                      each_times(subtract(before, behind), FrameAir(frame).sunlit_at(of.sunlit, height, sunlight)));
    }
    if (!foggy) return {light, one, places.middle};
    const Floats patches = fog_patches(air, times(places.at, of.ray), begin, end);
    const Floats transmittance = fast_exp(hn::Neg(hn::Mul(fog.depth, patches)));
    const Floats way = hn::Div(hn::Sub(places.middle, begin), hn::Max(hn::Sub(end, begin), set(1.0e-6f)));
    Floats3 beta = hn::AllTrue(d, inside) ? mix(before, behind, {way, way, way})
                                          : clear_air(frame, of.ray, places.middle);
    Floats3 source = of.sunlit.source;
    if (frame.sky != nullptr && !hn::AllTrue(d, inside)) {  // far away
        const auto chosen = [&](const Floats3& near, const Floats3& far) {
            return Floats3{hn::IfThenElse(inside, near.x, far.x), hn::IfThenElse(inside, near.y, far.y),
                           hn::IfThenElse(inside, near.z, far.z)};
        };
        beta = chosen(beta, air_transmittance(frame, of.ray, places.middle));
        source = chosen(source, air_source(frame, of.ray, places.middle));
    }
    const Floats3 veil =
        each_times({hn::Sub(one, beta.x), hn::Sub(one, beta.y), hn::Sub(one, beta.z)}, source);
    const Floats3 of_fog = add(each_times(beta, fog_radiance(frame, of, places.middle, sunlight, lit)), veil);
    light = times(hn::MulAdd(set(0.5f), transmittance, set(0.5f)), light);
    return {times_add(hn::Sub(one, transmittance), of_fog, light), transmittance, places.middle};
}

// Returns the distance at which rays of a mirrored eye, which is below the ground, leave the ground.
HWY_INLINE Floats air_begin(const PictureFrame& frame, const Floats3& ray) {
    if (!(frame.ground.w > 0)) return hn::Zero(Lanes());
    return hn::Div(set(frame.ground.w), hn::Max(ray.z, set(1.0e-6f)));
}

// Returns the distance at which air ends: at the ground, but no farther than where a ray meets the plane of the fog,
// which over a round Earth it may do without meeting the ground.
HWY_INLINE Floats air_end(const PictureFrame& frame, Floats ray_z, Floats ground) {
    if (!(frame.ground_sun.w > 0)) return ground;
    const Floats plane = hn::Div(set(-std::abs(frame.ground.w)), hn::Min(ray_z, set(-1.0e-9f)));
    return hn::IfThenElse(hn::Lt(ray_z, hn::Zero(Lanes())), hn::Min(ground, plane), ground);
}

// The part of the shells of splats that lies in front of their centres; beyond the last shell, they begin at
// `distance` itself.
HWY_INLINE AirLayer layer_in_front(const PictureFrame& frame, const Floats3& ray, Floats shell_begins,
                                   Floats distance) {
    const Floats begin = hn::Min(hn::Max(shell_begins, air_begin(frame, ray)), distance);
    return air_layer<Heights::apart>(frame, RayAir(frame, ray), clear_air(frame, ray, begin),
                                     clear_air(frame, ray, distance), begin, distance, set(0.5f));
}

// Distances along rays between which something is drawn.
struct AirInterval {
    float begin = kNowhere, end = 0;
    void add(Floats from, Floats until) {
        const Lanes d;
        const auto some = hn::Lt(from, until);
        if (hn::AllFalse(d, some)) return;
        begin = std::min(begin, hn::GetLane(hn::MinOfLanes(d, hn::IfThenElse(some, from, set(kNowhere)))));
        end = std::max(end, hn::GetLane(hn::MaxOfLanes(d, hn::IfThenElseZero(some, until))));
    }
};

// Shade of clouds, and fog.
HWY_INLINE AirInterval interval_with_air(const AirShells& air, const MarchedScene* endless, const Floats3& ray) {
    const Lanes d;
    const shader::Shells& data = air.data;
    AirInterval part;
    const auto steep = [](Floats slope) {
        return hn::IfThenElse(hn::Lt(hn::Abs(slope), set(1.0e-12f)), set(1.0e-12f), slope);
    };
    if (data.settings.y > 0) {
        Floats begin = hn::Zero(d), end = set(kNowhere);
        const auto clip = [&](const shader::vec4& row, float low, float high) {
            const Floats slope = steep(dot(set3(row), ray));
            const Floats a = hn::Div(set(low - row.w), slope), b = hn::Div(set(high - row.w), slope);
            begin = hn::Max(begin, hn::Min(a, b));
            end = hn::Min(end, hn::Max(a, b));
        };
        clip(data.shade_u, 0, data.shade.x);
        clip(data.shade_v, 0, data.shade.y);
        clip(data.shade_along, data.shade.z, 1.0e12f);
        part.add(begin, end);
        if (endless != nullptr) {  // below the tops of what repeats
            for (const MarchedVolume& volume : endless->volumes) {
                if (!volume.repeats) continue;
                const Floats crossing = hn::Div(set(volume.shade_top), steep(ray.z));
                const auto up = hn::Gt(ray.z, hn::Zero(d));
                if (volume.shade_top > 0)
                    part.add(hn::Zero(d), hn::IfThenElse(up, crossing, set(kNowhere)));
                else
                    part.add(hn::IfThenElse(up, set(kNowhere), crossing), set(kNowhere));
            }
        }
    }
    if (air.has_fog()) {
        const float below_top = data.fog_limits.x - data.fog.z;
        const Floats crossing = hn::Min(hn::Div(set(below_top), steep(ray.z)), set(kNowhere));
        const auto up = hn::Gt(ray.z, hn::Zero(d));
        if (below_top > 0)
            part.add(hn::Zero(d), hn::IfThenElse(up, crossing, set(kNowhere)));
        else
            part.add(hn::IfThenElse(up, set(kNowhere), crossing), set(kNowhere));
    }
    return part;
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
