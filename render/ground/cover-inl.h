// SPDX-License-Identifier: Apache-2.0

// What lies on the ground at points, from the map of water and snow.

#if defined(NEPHOS_RENDER_COVER_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_COVER_INL_H_
#undef NEPHOS_RENDER_COVER_INL_H_
#else
#define NEPHOS_RENDER_COVER_INL_H_
#endif

#include <span>

#include <hwy/highway.h>

#include "render/ground/ground_noise-inl.h"
#include "render/ground/ground_pass.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

struct Lying {
    Floats water_mm, snow_mm, rain_mm_per_h;
};

// Samples the map bilinearly at points; it fades to the outside values towards its edge.
HWY_INLINE Lying lying_at(const CoverTexels& texels, const Floats3& point) {
    const Lanes d;
    const Ints di;
    const GroundCoverView& map = *texels.map;
    const Lying outside{set(float(map.outside.water_mm)), set(float(map.outside.snow_mm)),
                        set(float(map.outside_rain_mm_per_h))};
    if (map.columns == 0) return outside;
    const Floats across = hn::MulAdd(set(texels.per_x), point.x, set(texels.from_x)),
                 up = hn::MulAdd(set(texels.per_y), point.y, set(texels.from_y));
    constexpr float kEdge = 0.1f;  // of the map's size, over which it fades out
    const auto from_edge = [](Floats at, int count) {
        return hn::Mul(hn::Min(at, hn::Sub(set(float(count)), at)), set(1.0f / float(count)));
    };
    const Floats inner = hn::Min(from_edge(across, map.columns), from_edge(up, map.rows));
    const Floats fraction = smooth_step(hn::Zero(d), set(kEdge), inner);
    if (hn::AllFalse(d, hn::Gt(fraction, hn::Zero(d)))) return outside;
    const auto place = [&](Floats at, int count) {
        return hn::Max(hn::Min(hn::Sub(at, set(0.5f)), set(float(count - 1))), hn::Zero(d));
    };
    const Floats x = place(across, map.columns), y = place(up, map.rows);
    const Floats x0 = hn::Min(hn::Floor(x), set(float(map.columns - 2))),
                 y0 = hn::Min(hn::Floor(y), set(float(map.rows - 2)));
    const auto index =
        hn::Add(hn::Mul(hn::ConvertTo(di, y0), hn::Set(di, map.columns)), hn::ConvertTo(di, x0));
    const auto value = [&](std::span<const float> of, Floats beyond) {
        const auto row = [&](const float* first) {
            return lerp(hn::GatherIndex(d, first, index), hn::GatherIndex(d, first + 1, index),
                        hn::Sub(x, x0));
        };
        return lerp(beyond, lerp(row(of.data()), row(of.data() + map.columns), hn::Sub(y, y0)), fraction);
    };
    return {value(map.water_mm, outside.water_mm), value(map.snow_mm, outside.snow_mm),
            value(map.rain_mm_per_h, outside.rain_mm_per_h)};
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
