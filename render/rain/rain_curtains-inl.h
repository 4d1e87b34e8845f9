// SPDX-License-Identifier: Apache-2.0

// Curtains of rain (rain_shafts_pass.h) for vectors of rays: their intersections, their extinction along them, and
// the intervals that several cover.

#if defined(NEPHOS_RENDER_RAIN_CURTAINS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_RAIN_CURTAINS_INL_H_
#undef NEPHOS_RENDER_RAIN_CURTAINS_INL_H_
#else
#define NEPHOS_RENDER_RAIN_CURTAINS_INL_H_
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <hwy/highway.h>

#include "core/vectors-inl.h"
#include "render/rain/rain_shafts_pass.h"
#include "render/shading/background-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

using Mask = hn::Mask<Lanes>;

HWY_INLINE Floats3 set3(const glm::vec3& v) { return {set(v.x), set(v.y), set(v.z)}; }
HWY_INLINE Floats clamped(Floats v, float low, float high) {
    return hn::Min(hn::Max(v, set(low)), set(high));
}

// The intersections of the rays of some pixels of a row with one curtain.
struct Way {
    Floats begin, end;        // distances; begin > end: none
    Floats x, y;              // of a metre in the curtain's units
    Floats level_x, level_y;  // in metres, without its lean
};

// Intersects rays with a curtain.
HWY_INLINE Way way_through(const SeenCurtain& c, const Floats3& ray) {
    const Lanes d;
    const Floats zero = hn::Zero(d), one = set(1), nowhere = set(kNowhere);
    Way way;
    way.level_x = hn::NegMulAdd(set(c.lean_x), ray.z, ray.x);
    way.level_y = hn::NegMulAdd(set(c.lean_y), ray.z, ray.y);
    way.x = hn::MulAdd(set(c.ax), way.level_x, hn::Mul(set(c.ay), way.level_y));
    way.y = hn::MulAdd(set(c.bx), way.level_x, hn::Mul(set(c.by), way.level_y));
    // Relative to the point of the ray nearest to the axis, which is accurate from far away, too.
    const Floats a = hn::Max(hn::MulAdd(way.x, way.x, hn::Mul(way.y, way.y)), set(1e-16f));
    const Floats nearest = hn::Neg(hn::Div(hn::MulAdd(set(c.eye_x), way.x, hn::Mul(set(c.eye_y), way.y)), a));
    const Floats x = hn::MulAdd(nearest, way.x, set(c.eye_x)), y = hn::MulAdd(nearest, way.y, set(c.eye_y));
    const Floats chord = hn::NegMulAdd(x, x, hn::NegMulAdd(y, y, one));
    const Floats half = hn::Sqrt(hn::Div(hn::Max(chord, zero), a));
    const Floats level = set(1e-7f), rise = hn::IfThenElse(hn::Lt(hn::Abs(ray.z), level), level, ray.z);
    const Floats low = hn::Div(set(-c.eye_z), rise), high = hn::Div(set(c.height_m - c.eye_z), rise);
    way.begin = hn::Max(hn::Max(hn::Sub(nearest, half), hn::Min(low, high)), zero);
    way.end = hn::Min(hn::Add(nearest, half), hn::Max(low, high));
    const Mask met = hn::And(hn::Gt(chord, zero), hn::Lt(way.begin, way.end));
    way.begin = hn::IfThenElse(met, way.begin, nowhere);
    way.end = hn::IfThenElse(met, way.end, hn::Neg(nowhere));
    return way;
}

// Returns true when some of the rays pass the circle around a curtain.
HWY_INLINE bool may_meet(const SeenCurtain& c, const Floats3& ray, Floats level2) {
    const Floats across = hn::MulSub(set(c.centre_x), ray.y, hn::Mul(set(c.centre_y), ray.x));
    return !hn::AllFalse(Lanes(),
                         hn::Le(hn::Mul(across, across), hn::Mul(set(c.reach_m * c.reach_m), level2)));
}

// Smooth noise 0..255 (rain_shafts.h).
HWY_INLINE Floats noise_at(const ShaftPass& p, Floats x, Floats y) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    const hn::RebindToUnsigned<Lanes> du;
    const Floats x0 = hn::Floor(x), y0 = hn::Floor(y);
    const Floats sx = smooth_blend(hn::Sub(x, x0)), sy = smooth_blend(hn::Sub(y, y0));
    const auto side = hn::Set(di, kShaftNoiseSide - 1), byte = hn::Set(di, 255);
    const auto column = hn::And(hn::ConvertTo(di, x0), side), row = hn::And(hn::ConvertTo(di, y0), side);
    const auto cell = hn::GatherIndex(di, reinterpret_cast<const std::int32_t*>(p.noise.data()),
                                      hn::Or(hn::ShiftLeft<kShaftNoiseBits>(row), column));
    const Floats a = hn::ConvertTo(d, hn::And(cell, byte)),
                 b = hn::ConvertTo(d, hn::And(hn::ShiftRight<8>(cell), byte)),
                 e = hn::ConvertTo(d, hn::And(hn::ShiftRight<16>(cell), byte)),
                 f = hn::ConvertTo(d, hn::BitCast(di, hn::ShiftRight<24>(hn::BitCast(du, cell))));
    const Floats low = hn::MulAdd(sx, hn::Sub(b, a), a), high = hn::MulAdd(sx, hn::Sub(f, e), e);
    return hn::MulAdd(sy, hn::Sub(high, low), low);
}

struct Grains {
    Floats x, y;
};
HWY_INLINE Grains grains_at(const SeenCurtain& c, const Way& way, Floats t) {
    const Floats along = hn::Mul(t, set(c.per_grain));
    return {hn::MulAdd(along, way.level_x, set(c.grain_x)), hn::MulAdd(along, way.level_y, set(c.grain_y))};
}

// Returns the factor of f, the texture's falling parts, which several steps share.
HWY_INLINE Floats falls_at(const ShaftPass& p, const SeenCurtain& c, const Way& way, Floats rise, Floats t) {
    if (p.contrast <= 0) return set(1);
    const Grains grains = grains_at(c, way, t);
    const Floats height_m = hn::MulAdd(t, rise, set(c.eye_z));
    const Floats falls =
        noise_at(p, hn::Add(grains.x, grains.y), hn::MulAdd(height_m, set(c.per_fall), set(c.fall)));
    return fast_exp(hn::MulAdd(set(1.5f / 255 * p.contrast), falls, set(-0.75f * p.contrast)));
}

// A place in texels, of a grid that repeats or else a little beyond its sides at most.
HWY_INLINE Floats texel_place(Floats at, int texels, bool repeats) {
    const auto count = float(texels);
    if (!repeats) return clamped(at, -2, count + 1);
    return hn::NegMulAdd(set(count), hn::Floor(hn::Mul(at, set(1 / count))), at);
}

// Rain of the cloud above points of rays: its part of the rate, fading in below the base of each column; and their heights
// as fractions of that of the column's base, 0..1 in the rain.
struct ColumnRain {
    Floats part, height;
};
HWY_INLINE ColumnRain rain_of_cloud(const SeenCurtain& c, const Way& way, Floats t, Floats height_m) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    const CloudBases& cloud = *c.cloud;
    const Floats zero = hn::Zero(d), along = hn::Mul(t, set(c.per_texel));
    const Floats u = texel_place(hn::MulAdd(along, way.level_x, set(c.cloud_x)), cloud.columns,
                                 cloud.repeats_x),
                 v = texel_place(hn::MulAdd(along, way.level_y, set(c.cloud_y)), cloud.rows, cloud.repeats_y);
    const Floats i = hn::Floor(u), j = hn::Floor(v), part_x = hn::Sub(u, i), part_y = hn::Sub(v, j);
    Floats water = zero, base = zero;
    const auto add_texel = [&](Floats column, Floats row, Floats weight) {
        const auto first_again = [](Floats n, int texels) {
            return hn::IfThenElseZero(hn::Lt(n, set(float(texels))), n);
        };
        if (cloud.repeats_x) column = first_again(column, cloud.columns);
        if (cloud.repeats_y) row = first_again(row, cloud.rows);
        const Floats x = clamped(column, 0, float(cloud.columns - 1)),
                     y = clamped(row, 0, float(cloud.rows - 1));
        const Mask inside = hn::And(hn::Eq(x, column), hn::Eq(y, row));
        const auto at =
            hn::Add(hn::Mul(hn::ConvertTo(di, y), hn::Set(di, cloud.columns)), hn::ConvertTo(di, x));
        const Floats counts = hn::IfThenElseZero(inside, weight);
        water = hn::MulAdd(counts, hn::GatherIndex(d, cloud.water.data(), at), water);
        base = hn::MulAdd(counts, hn::GatherIndex(d, cloud.water_base_m.data(), at), base);
    };
    const Floats one = set(1), i1 = hn::Add(i, one), j1 = hn::Add(j, one);
    const Floats west = hn::Sub(one, part_x), south = hn::Sub(one, part_y);
    add_texel(i, j, hn::Mul(west, south));
    add_texel(i1, j, hn::Mul(part_x, south));
    add_texel(i, j1, hn::Mul(west, part_y));
    add_texel(i1, j1, hn::Mul(part_x, part_y));
    const Floats top = hn::Sub(hn::Div(base, hn::Max(water, set(1e-6f))), set(c.ground_m));
    const Floats below = hn::Div(hn::Sub(top, height_m), hn::Max(top, one));
    return {hn::Mul(water, clamped(hn::Mul(below, set(1 / kShaftCloudFade)), 0, 1)), hn::Sub(one, below)};
}

// Returns the extinction of one curtain at distances along its rays, without the factor of f.
HWY_INLINE Floats extinction(const ShaftPass& p, const SeenCurtain& c, const Way& way, Floats rise,
                             Floats t) {
    const Lanes d;
    const Floats zero = hn::Zero(d), one = set(1);
    const Floats x = hn::MulAdd(t, way.x, set(c.eye_x)), y = hn::MulAdd(t, way.y, set(c.eye_y));
    const Floats radius2 = hn::MulAdd(x, x, hn::Mul(y, y)), height_m = hn::MulAdd(t, rise, set(c.eye_z));
    Floats h = hn::Mul(height_m, set(c.per_height)), part;
    if (c.cloud != nullptr) {
        const ColumnRain rain = rain_of_cloud(c, way, t, height_m);
        part = rain.part;
        h = rain.height;
    } else {
        part = clamped(hn::Mul(hn::Sub(one, h), set(1 / kShaftTopFade)), 0, 1);
    }
    Floats most = hn::Mul(set(c.per_m), part);
    if (p.evaporation > 0) {
        const Floats left = clamped(
            hn::Mul(hn::Sub(h, set(p.evaporation)), set(1 / std::max(1 - p.evaporation, 1e-3f))), 0, 1);
        most = hn::Mul(most, hn::Mul(left, hn::Sub(set(2), left)));
    }
    most = hn::IfThenElseZero(hn::And(hn::Ge(height_m, zero), hn::Lt(radius2, one)), most);
    if (hn::AllFalse(d, hn::Gt(most, zero))) return zero;
    const auto [gx, gy] = grains_at(c, way, t);
    const Floats four = set(4), own = set(c.own);
    const Floats strands =
        hn::MulAdd(set(0.6f / 255), noise_at(p, hn::Add(gx, own), gy),
                   hn::Mul(set(0.4f / 255), noise_at(p, hn::Mul(four, gx), hn::MulAdd(four, gy, own))));
    const Floats radius = hn::Sqrt(radius2);
    const Floats inside = hn::NegMulAdd(radius, hn::MulAdd(set(p.fray), strands, one), one);
    const Floats inner = p.softness > 0 ? clamped(hn::Mul(inside, set(1 / p.softness)), 0, 1)
                                        : hn::IfThenElseZero(hn::Gt(inside, zero), one);
    const Floats even = hn::Mul(most, smooth_blend(inner));
    if (p.contrast <= 0) return even;
    const float mean = -2.25f * p.contrast - 0.25f * p.contrast * p.contrast;
    const Floats power = hn::MulAdd(set(4.5f * p.contrast), strands, set(mean));
    return hn::Mul(even, fast_exp(power));
}

// Returns the optical depth of one curtain from points of rays in it to the sun, 0 elsewhere; see rain_shafts.h.
HWY_INLINE Floats depth_to_sun(const ShaftPass& p, const SeenCurtain& c, const Way& way, Floats rise, Floats t) {
    const Lanes d;
    const Floats zero = hn::Zero(d), x = hn::MulAdd(t, way.x, set(c.eye_x)), y = hn::MulAdd(t, way.y, set(c.eye_y));
    const float a = std::max(c.sun_x * c.sun_x + c.sun_y * c.sun_y, 1e-14f);
    const Floats b = hn::MulAdd(x, set(c.sun_x), hn::Mul(y, set(c.sun_y)));
    const Floats inside = hn::NegMulAdd(x, x, hn::NegMulAdd(y, y, set(1)));
    const Floats root = hn::Sqrt(hn::Max(hn::MulAdd(b, b, hn::Mul(set(a), inside)), zero));
    const Floats height_m = hn::MulAdd(t, rise, set(c.eye_z)),
                 top = hn::Mul(hn::Sub(set(c.height_m), height_m), set(1 / std::max(p.to_sun.z, 1e-3f)));
    const Floats way_m = hn::Min(hn::Mul(hn::Sub(root, b), set(1 / a)), top);
    // The integral of (1 - r^2)^2 over way_m, divided by it.
    Floats mean = hn::MulAdd(way_m, set(0.2f * a * a), hn::Mul(set(a), b));
    mean = hn::MulAdd(way_m, mean, hn::MulAdd(set(4.0f / 3), hn::Mul(b, b), hn::Mul(set(-2.0f / 3 * a), inside)));
    mean = hn::MulAdd(way_m, mean, hn::Mul(set(-2), hn::Mul(inside, b)));
    mean = hn::MulAdd(way_m, mean, hn::Mul(inside, inside));
    const Floats depth = hn::Mul(hn::Mul(set(c.sun_per_m), way_m), hn::MulAdd(set(p.sun_profile), mean, set(1 - p.sun_profile)));
    const Mask within = hn::And(hn::And(hn::Gt(inside, zero), hn::Ge(height_m, zero)), hn::Gt(way_m, zero));
    return hn::IfThenElseZero(within, hn::Max(depth, zero));
}

// The curtains that some rays intersect; allocated once a row.
struct MetCurtains {
    static constexpr std::size_t kParts = 7;
    std::vector<const SeenCurtain*> curtains;
    std::vector<float> ways;  // of each a Way, and its falls
    std::size_t count = 0;
    explicit MetCurtains(std::size_t most) : curtains(most), ways(most * kParts * hn::MaxLanes(Lanes())) {}
    void clear() { count = 0; }
    HWY_INLINE void add(const SeenCurtain& c, const Way& way) {
        const Lanes d;
        float* to = &ways[count * kParts * hn::Lanes(d)];
        for (const Floats& part : {way.begin, way.end, way.x, way.y, way.level_x, way.level_y}) {
            hn::StoreU(part, d, to);
            to += hn::Lanes(d);
        }
        curtains[count++] = &c;
    }
    HWY_INLINE Floats part(std::size_t i, std::size_t which) const {
        const Lanes d;
        return hn::LoadU(d, &ways[(kParts * i + which) * hn::Lanes(d)]);
    }
    HWY_INLINE Floats begin(std::size_t i) const { return part(i, 0); }
    HWY_INLINE Floats end(std::size_t i) const { return part(i, 1); }
    HWY_INLINE Floats falls(std::size_t i) const { return part(i, 6); }
    HWY_INLINE void set_falls(std::size_t i, Floats falls) {
        const Lanes d;
        hn::StoreU(falls, d, &ways[(kParts * i + 6) * hn::Lanes(d)]);
    }
    HWY_INLINE Way way(std::size_t i) const {
        return {begin(i), end(i), part(i, 2), part(i, 3), part(i, 4), part(i, 5)};
    }
};

// Finds for each ray the next interval of the union of the curtains' intersections after `begin` .. `end`.
// Returns false when no ray has one.
HWY_INLINE bool next_run(const MetCurtains& met, Floats& begin, Floats& end) {
    const Lanes d;
    const Floats nowhere = set(kNowhere), last = end;
    begin = nowhere;
    for (std::size_t i = 0; i < met.count; ++i)
        begin = hn::Min(begin, hn::IfThenElse(hn::Gt(met.begin(i), last), met.begin(i), nowhere));
    end = begin;
    const Mask some = hn::Lt(begin, nowhere);
    if (hn::AllFalse(d, some)) return false;
    for (Floats before = hn::Neg(nowhere); !hn::AllFalse(d, hn::Gt(end, before));) {
        before = end;
        for (std::size_t i = 0; i < met.count; ++i)
            end = hn::IfThenElse(hn::Le(met.begin(i), end), hn::Max(end, met.end(i)), end);
    }
    return true;
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
