// SPDX-License-Identifier: Apache-2.0

// Rain shafts (rain_shafts.h) for vectors of pixels of a row.

#if defined(NEPHOS_RENDER_RAIN_SHAFTS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_RAIN_SHAFTS_INL_H_
#undef NEPHOS_RENDER_RAIN_SHAFTS_INL_H_
#else
#define NEPHOS_RENDER_RAIN_SHAFTS_INL_H_
#endif

#include <cstddef>
#include <cstdint>

#include <hwy/highway.h>

#include "core/vectors-inl.h"
#include "render/rain/rain_curtains-inl.h"
#include "render/rain/rain_shafts_pass.h"
#include "render/shading/background-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// particle_phase() and particle_radiance() of precipitation_light.h; `sun`: what the sun adds without clouds.
HWY_INLINE Floats drop_phase(float g, Floats cosine) {
    const Floats base = hn::NegMulAdd(set(2 * g), cosine, set(1 + g * g));
    const Floats forward = hn::Div(set(0.25f * (1 - g * g)), hn::Mul(base, hn::Sqrt(base)));
    return hn::MulAdd(set(float(kForwardFraction)), forward, set(0.25f * float(1 - kForwardFraction)));
}

// What drops scatter of the sun along rays, with their bows.
HWY_INLINE Floats3 sun_of_drops(const ShaftPass& p, Floats cosine) {
    const Lanes d;
    const Floats lobe = drop_phase(p.forward_g, cosine);
    if (p.bow == nullptr) return times(lobe, set3(p.sun));
    const hn::RebindToSigned<Lanes> di;
    const Floats half = hn::Sqrt(clamped(hn::MulAdd(set(0.5f), cosine, set(0.5f)), 0, 1));
    const Floats place = hn::Mul(half, set(float(Rainbow::kCells)));
    const auto below = hn::Min(hn::ConvertTo(di, place), hn::Set(di, Rainbow::kCells - 1));
    const Floats part = hn::Sub(place, hn::ConvertTo(d, below)),
                 rest = hn::Mul(set(1 - float(p.bow->share)), lobe);
    const auto channel = [&](const std::vector<float>& nodes, float sun) {
        const Floats a = hn::GatherIndex(d, nodes.data(), below),
                     b = hn::GatherIndex(d, nodes.data() + 1, below);
        return hn::Mul(set(sun), hn::Add(rest, hn::MulAdd(part, hn::Sub(b, a), a)));
    };
    return {channel(p.bow->nodes[0], p.sun.x), channel(p.bow->nodes[1], p.sun.y),
            channel(p.bow->nodes[2], p.sun.z)};
}

// shadow_at() of background-inl.h, faster where no texel lies beyond the map.
HWY_INLINE Floats shadow_between(const ShaftPass& p, Floats u, Floats v) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    const Floats size = set(float(p.shadow_size)), zero = hn::Zero(d), last = set(float(p.shadow_size - 1));
    const Floats x = hn::MulSub(u, size, set(0.5f)), y = hn::MulSub(v, size, set(0.5f));
    const Mask inside =
        hn::And(hn::And(hn::Ge(x, zero), hn::Lt(x, last)), hn::And(hn::Ge(y, zero), hn::Lt(y, last)));
    if (!hn::AllTrue(d, inside)) return shadow_at({p.shadow, p.shadow_size}, u, v);
    const auto column = hn::ConvertTo(di, x), row = hn::ConvertTo(di, y);
    const auto index = hn::Add(hn::Mul(row, hn::Set(di, p.shadow_size)), column);
    const Floats weight_x = hn::Sub(x, hn::ConvertTo(d, column)),
                 weight_y = hn::Sub(y, hn::ConvertTo(d, row));
    const auto across = [&](const float* from) {
        const Floats a = hn::GatherIndex(d, from, index), b = hn::GatherIndex(d, from + 1, index);
        return hn::MulAdd(weight_x, hn::Sub(b, a), a);
    };
    const Floats low = across(p.shadow), high = across(p.shadow + p.shadow_size);
    return hn::MulAdd(weight_y, hn::Sub(high, low), low);
}

HWY_INLINE Floats3 radiance(const ShaftPass& p, const Floats3& ray, const Floats3& sun, Floats t) {
    LightBelow below{hn::Zero(Lanes()), set(1)};
    if (p.ground != nullptr) below = light_below(*p.ground, p.ground_place, times(t, ray));
    Floats3 light = times_add(below.sun, set3(p.by_scattered_sun), times(below.sky, set3(p.by_sky)));
    if (p.has_sun) {
        Floats weight = set(1);
        if (p.shadow != nullptr) {
            const Floats u = hn::MulAdd(t, dot(set3(p.to_u), ray), set(p.shadow_u)),
                         v = hn::MulAdd(t, dot(set3(p.to_v), ray), set(p.shadow_v));
            weight = shadow_between(p, u, v);
        }
        light = times_add(weight, add(sun, set3(p.by_sunlit_ground)), light);
    }
    if (p.has_flash) {
        const Floats3 way = subtract(set3(p.flash_m), times(t, ray));
        const Floats squared = hn::Max(dot(way, way), set(1e4f));
        const Floats cosine = hn::Div(dot(ray, way), hn::Sqrt(squared));
        light =
            times_add(hn::Mul(flash_falloff(squared), drop_phase(p.forward_g, cosine)), set3(p.flash), light);
    }
    return light;
}

// PictureAir::horizon along rays.
HWY_INLINE Floats3 horizon_at(const ShaftPass& p, const Floats3& ray) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    constexpr float kLast = float(PictureAir::kHorizons - 1);
    const float sun = p.to_sun.x * p.to_sun.x + p.to_sun.y * p.to_sun.y;
    const Floats level = hn::Mul(hn::MulAdd(ray.x, ray.x, hn::Mul(ray.y, ray.y)), set(sun));
    const Floats cosine = hn::Div(hn::MulAdd(ray.x, set(p.to_sun.x), hn::Mul(ray.y, set(p.to_sun.y))),
                                  hn::Sqrt(hn::Max(level, set(1e-12f))));
    const Floats across = hn::Sqrt(hn::Max(hn::MulAdd(set(-0.5f), cosine, set(0.5f)), hn::Zero(d)));
    const Floats at = hn::Mul(hn::Min(across, set(1)), set(kLast)), below = hn::Min(hn::Floor(at), set(kLast - 1)),
                 part = hn::Sub(at, below);
    const auto first = hn::ConvertTo(di, below);
    const auto of = [&](const float* from) {
        const Floats a = hn::GatherIndex(d, from, first), b = hn::GatherIndex(d, from + 1, first);
        return hn::MulAdd(part, hn::Sub(b, a), a);
    };
    return {of(p.horizon[0]), of(p.horizon[1]), of(p.horizon[2])};
}

// A run of steps in front of the pixels' clouds, or behind them.
struct Through {
    Floats transmittance;
    Floats3 radiance;
};

HWY_INLINE void add(Through& run, Floats depth, const Floats3& light) {
    const Floats kept = fast_exp(hn::Neg(depth));
    const Floats weight = hn::NegMulAdd(run.transmittance, kept, run.transmittance);
    run.radiance = times_add(weight, light, run.radiance);
    run.transmittance = hn::Mul(run.transmittance, kept);
}

// Returns what the curtains around points of rays leave of the sun's light.
HWY_INLINE Floats sun_left(const ShaftPass& p, const MetCurtains& met, const Floats3& ray, Floats t) {
    Floats deepest = hn::Zero(Lanes());
    for (std::size_t m = 0; m < met.count; ++m)
        deepest = hn::Max(deepest, depth_to_sun(p, *met.curtains[m], met.way(m), ray.z, t));
    return fast_exp(hn::Neg(deepest));
}

// Marches one interval of every ray, or the part of it before or behind the pixels' clouds.
HWY_INLINE void march(const ShaftPass& p, MetCurtains& met, const Floats3& ray, const Floats3& sun,
                      const Floats3& horizon, Floats begin, Floats end, Floats offset, Through& run) {
    const Lanes d;
    if (hn::AllFalse(d, hn::Lt(begin, end))) return;
    const Floats zero = hn::Zero(d);
    const Floats step = hn::Mul(hn::Sub(end, begin), set(1.0f / kShaftSteps));
    const auto at = [&](int i) { return hn::MulAdd(hn::Add(offset, set(float(i))), step, begin); };
    const auto through_air = [&](Floats way_m) {
        const auto of = [&](float per_m) { return fast_exp(hn::Mul(set(-per_m), way_m)); };
        return Floats3{of(p.air_per_m.x), of(p.air_per_m.y), of(p.air_per_m.z)};
    };
    Floats3 kept = through_air(at(kShaftStepsPerLight / 2));
    const Floats3 more = through_air(hn::Mul(set(float(kShaftStepsPerLight)), step));
    for (int first = 0; first < kShaftSteps; first += kShaftStepsPerLight, kept = each_times(kept, more)) {
        const Floats middle = at(first + kShaftStepsPerLight / 2);
        for (std::size_t m = 0; m < met.count; ++m)
            met.set_falls(m, falls_at(p, *met.curtains[m], met.way(m), ray.z, middle));
        Floats depth = zero;
        for (int i = first; i < first + kShaftStepsPerLight; ++i) {
            const Floats t = at(i);
            Floats densest = zero;
            for (std::size_t m = 0; m < met.count; ++m) {
                const Floats steady = extinction(p, *met.curtains[m], met.way(m), ray.z, t);
                densest = hn::Max(densest, hn::Mul(steady, met.falls(m)));
            }
            if (p.clear_m > 0 && !hn::AllFalse(d, hn::Lt(t, set(p.clear_m))))
                densest =
                    hn::Mul(densest, smooth_blend(clamped(hn::MulSub(set(2 / p.clear_m), t, set(1)), 0, 1)));
            depth = hn::MulAdd(densest, step, depth);
        }
        if (hn::AllFalse(d, hn::Gt(depth, zero))) continue;
        const Floats3 lit = p.has_sun ? times(sun_left(p, met, ray, middle), sun) : sun;
        const Floats3 seen = mix(horizon, radiance(p, ray, lit, middle), kept);
        add(run, depth, seen);
    }
}

// The displacements (shader::kShaftOffsetX) of the pixels of a row.
HWY_INLINE Floats shaft_offsets(std::size_t x, std::size_t y) {
    const Lanes d;
    const hn::RebindToUnsigned<Lanes> du;
    const auto first = hn::Set(du, std::uint32_t(x) * shader::kShaftOffsetX + std::uint32_t(y) * shader::kShaftOffsetY);
    const auto sum = hn::Add(first, hn::Mul(hn::Iota(du, 0), hn::Set(du, shader::kShaftOffsetX)));
    const auto mixed = hn::ShiftRight<8>(hn::Mul(hn::ShiftRight<8>(sum), hn::Set(du, shader::kShaftOffsetMix)));
    const Floats fraction = hn::ConvertTo(d, hn::BitCast(hn::RebindToSigned<Lanes>(), mixed));
    return hn::MulAdd(set(0x1p-25f), fraction, set(0.25f));
}

// The layers of the picture at some pixels of a row.
struct Pixels {
    float* beauty;
    const float *depth_m, *transmittance;
    const float* terrain_m;  // where ground that is not level ends the rays; null: it is level
};

void draw_pixels(const ShaftPass& p, MetCurtains& met, std::size_t x, std::size_t y, const Pixels& pixels) {
    const Lanes d;
    const Floats column = hn::Iota(d, float(x));
    const Floats across = hn::MulAdd(column, set(p.column), set(0.5f * p.column - 1));
    const float upward = 1 - (float(y) + 0.5f) * p.row;
    Floats3 ray = times_add(set(upward), set3(p.up), times_add(across, set3(p.right), set3(p.forward)));
    ray = times(hn::Div(set(1), hn::Sqrt(dot(ray, ray))), ray);
    met.clear();
    const Floats level2 = hn::MulAdd(ray.x, ray.x, hn::Mul(ray.y, ray.y));
    for (const SeenCurtain& c : p.curtains) {
        if (!may_meet(c, ray, level2)) continue;
        Way way = way_through(c, ray);
        if (pixels.terrain_m != nullptr) way.end = hn::Min(way.end, hn::LoadU(d, pixels.terrain_m));
        if (!hn::AllFalse(d, hn::Lt(way.begin, way.end))) met.add(c, way);
    }
    if (met.count == 0) return;

    const Floats cloud_m = hn::LoadU(d, pixels.depth_m);
    Floats3 sun = set3(p.sun);
    if (p.has_sun) sun = sun_of_drops(p, dot(ray, set3(p.to_sun)));
    const Floats3 horizon = horizon_at(p, ray);
    const Floats zero = hn::Zero(d), one = set(1), offset = shaft_offsets(x, y);
    Through before{one, {zero, zero, zero}}, behind = before;
    const Floats seen = hn::LoadU(d, pixels.transmittance);
    const bool see_through = !hn::AllFalse(d, hn::Gt(seen, set(kShaftLeastSeen)));
    for (Floats begin = set(-1), end = begin; next_run(met, begin, end);) {
        const Floats parting = hn::Min(hn::Max(cloud_m, begin), end);
        march(p, met, ray, sun, horizon, begin, parting, offset, before);
        if (see_through) march(p, met, ray, sun, horizon, parting, end, offset, behind);
    }
    // The air before a curtain is in both its terms: what the curtain sends has it already, and what it lets
    // through keeps the rest.
    const Floats lost = hn::Mul(seen, hn::Sub(behind.transmittance, one));
    const auto through = [&](Floats value, Floats nearer, Floats farther) {
        value = hn::MulAdd(seen, farther, hn::MulAdd(lost, value, value));
        return hn::MulAdd(before.transmittance, value, nearer);
    };
    Floats3 beauty;
    hn::LoadInterleaved3(d, pixels.beauty, beauty.x, beauty.y, beauty.z);
    hn::StoreInterleaved3(through(beauty.x, before.radiance.x, behind.radiance.x),
                          through(beauty.y, before.radiance.y, behind.radiance.y),
                          through(beauty.z, before.radiance.z, behind.radiance.z), d, pixels.beauty);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
