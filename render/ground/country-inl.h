// SPDX-License-Identifier: Apache-2.0

// The albedo of country (country.h) for vectors of pixels.

#if defined(NEPHOS_RENDER_COUNTRY_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_COUNTRY_INL_H_
#undef NEPHOS_RENDER_COUNTRY_INL_H_
#else
#define NEPHOS_RENDER_COUNTRY_INL_H_
#endif

#include <hwy/highway.h>

#include "render/ground/country.h"
#include "render/ground/ground_noise-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// What a pixel covers of the ground: two vectors, along the view and across it, metres.
struct Footprint {
    Floats along_x, along_y, across_x, across_y, longest;
};

// `distance`, `ray`: of the pixel's middle; `per_unit`: pixels of a unit at distance 1.
HWY_INLINE Footprint footprint(const Floats3& ray, Floats distance, float per_unit) {
    const Lanes d;
    const Floats level = hn::Sqrt(hn::Max(hn::MulAdd(ray.x, ray.x, hn::Mul(ray.y, ray.y)), set(1.0e-8f)));
    const Floats x = hn::Div(ray.x, level), y = hn::Div(ray.y, level);
    const Floats width = hn::Mul(distance, set(1.0f / per_unit));
    const Floats length = hn::Div(width, hn::Max(hn::Neg(ray.z), set(1.0e-4f)));
    return {hn::Mul(length, x), hn::Mul(length, y), hn::Neg(hn::Mul(width, y)), hn::Mul(width, x),
            hn::Max(length, hn::Zero(d))};
}

// Returns a hash of a cell of the fields.
HWY_INLINE Hash field_hash(Hash column, Hash row) { return mixed(hn::Add(mixed(column), row)); }

// The part of an interval a..a + width that lies in the cell above its lower one: 0..1, width <= 1.
HWY_INLINE Floats upper_part(Floats low, Floats width) {
    const Floats upper = hn::Sub(hn::Add(low, width), hn::Add(hn::Floor(low), set(1.0f)));
    return clamp01(hn::Div(upper, width));
}

// The part of an interval that hedges cover, which lie around whole numbers.
HWY_INLINE Floats hedge_part(Floats middle, Floats width, Floats half) {
    const Floats away = hn::Abs(hn::Sub(middle, hn::Round(middle))), reach = hn::Mul(set(0.5f), width);
    const Floats overlap = hn::Sub(hn::Min(hn::Add(away, reach), half), hn::Max(hn::Sub(away, reach), hn::Neg(half)));
    return hn::Div(hn::Max(overlap, hn::Zero(Lanes())), width);
}

// Colours of a row of fields, filtered along it. Every other pair of cells is one field.
HWY_INLINE Floats3 row_of_fields(const Country& country, Floats x, Floats width, Hash row) {
    const Lanes d;
    const Ints di;
    const HashLanes dh;
    // Rows are displaced against each other, and their fields have different lengths.
    const Hash own = mixed(row);
    const auto shift = hn::And(own, hn::Set(dh, 1023u));
    const Floats along = hn::MulAdd(hn::ConvertTo(d, hn::BitCast(di, shift)), set(1.0f / 1024.0f),
                                    hn::Sub(x, hn::Mul(set(0.5f), width)));
    const auto crop = [&](Floats cell, std::size_t c) {
        const Hash number = cell_of(cell, country.fields.cell_x);
        const Hash pair = hn::AndNot(hn::Set(dh, 1u), number);
        const Hash joined = hn::And(field_hash(pair, row), hn::Set(dh, 64u));
        const Hash kind = field_hash(hn::IfThenElse(hn::Ne(joined, hn::Zero(dh)), pair, number), row);
        const auto index = hn::BitCast(di, hn::And(hn::ShiftRight<8>(kind), hn::Set(dh, std::uint32_t(kCrops - 1))));
        return hn::GatherIndex(d, country.crops[c].data(), index);
    };
    const Floats low = hn::Floor(along), high = hn::Add(low, set(1.0f)), part = upper_part(along, width);
    return {lerp(crop(low, 0), crop(high, 0), part), lerp(crop(low, 1), crop(high, 1), part),
            lerp(crop(low, 2), crop(high, 2), part)};
}

// Returns the part of a field of noise that lies above a level, in standard deviations.
HWY_INLINE Floats part_above(const ResolvedNoise& noise, float level) {
    constexpr float kSharpness = 0.12f;
    const Floats deviation = hn::Sqrt(hn::Add(noise.variance, set(kSharpness * kSharpness)));
    const Floats x = hn::Max(hn::Min(hn::Div(hn::Sub(set(level), noise.value), deviation), set(30.0f)), set(-30.0f));
    return hn::Div(set(1.0f), hn::Add(set(1.0f), hn::Exp(Lanes(), hn::Mul(set(1.702f), x))));
}

// Returns noise as a pixel sees it, whose footprint is long and narrow near the horizon: the mean of kProbes places along it, so
// that what it resolves across the view is not lost to its length (Heckbert 1989 on elliptical footprints; probes as in McCormack
// et al. 1999).
HWY_INLINE Floats probed_noise(std::span<const NoiseOctave> octaves, const Floats3& point, const Footprint& print) {
    constexpr int kProbes = 4;
    const Floats width = hn::Sqrt(hn::MulAdd(print.across_x, print.across_x, hn::Mul(print.across_y, print.across_y)));
    const auto is_round = hn::Le(print.longest, hn::Mul(set(1.5f), width));
    Floats at_middle = hn::Zero(Lanes());
    if (!hn::AllFalse(Lanes(), is_round)) at_middle = resolved_noise(octaves, point, print.longest).value;
    if (hn::AllTrue(Lanes(), is_round)) return at_middle;
    const Floats size = hn::Max(width, hn::Mul(set(1.0f / kProbes), print.longest));
    Floats sum = hn::Zero(Lanes());
    for (int n = 0; n < kProbes; ++n) {
        const Floats part = set((float(n) + 0.5f) / kProbes - 0.5f);
        const Floats3 probe{hn::MulAdd(part, print.along_x, point.x), hn::MulAdd(part, print.along_y, point.y), point.z};
        sum = hn::Add(sum, resolved_noise(octaves, probe, size).value);
    }
    return hn::IfThenElse(is_round, at_middle, hn::Mul(set(1.0f / kProbes), sum));
}

inline constexpr float kWoodLevel = 0.7f;  // above which lies 0.24 of noise of variance 1

// Returns the albedo relative to that of plain ground, at points relative to the eye.
HWY_INLINE Floats3 country_albedo(const Country& country, const Floats3& point, const Footprint& print) {
    const Floats one = set(1.0f), zero = hn::Zero(Lanes());
    const NoiseOctave& o = country.fields;
    // Fields follow the lie of the land.
    const Floats3 turned{hn::Add(point.x, set(3170.0f)), hn::Sub(point.y, set(1230.0f)), point.z};
    const Floats bend = set(country.bend_m);
    const Floats3 bent{hn::MulAdd(bend, resolved_noise(country.bends, point, print.longest).value, point.x),
                       hn::MulAdd(bend, resolved_noise(country.bends, turned, print.longest).value, point.y),
                       point.z};
    const Floats x = hn::MulAdd(set(o.x_x), bent.x, hn::MulAdd(set(o.x_y), bent.y, set(o.from_x))),
                 y = hn::MulAdd(set(o.y_x), bent.x, hn::MulAdd(set(o.y_y), bent.y, set(o.from_y)));
    const auto extent = [&](float along_x, float along_y) {
        const auto of = [&](Floats px, Floats py) {
            return hn::Abs(hn::MulAdd(set(along_x), px, hn::Mul(set(along_y), py)));
        };
        return hn::Max(hn::Add(of(print.along_x, print.along_y), of(print.across_x, print.across_y)),
                       set(1.0e-4f));
    };
    const Floats full_x = extent(o.x_x, o.x_y), full_y = extent(o.y_x, o.y_y);
    const Floats wide = hn::Min(full_x, one), deep = hn::Min(full_y, one);
    const Floats low = hn::Sub(y, hn::Mul(set(0.5f), deep)), row = hn::Floor(low);
    const Hash first = cell_of(row, o.cell_y), second = hn::Add(first, hn::Set(HashLanes(), 1u));
    const Floats part = upper_part(low, deep);
    Floats3 albedo = mix(row_of_fields(country, x, wide, first), row_of_fields(country, x, wide, second),
                         {part, part, part});
    // Of many fields in a pixel only their mean is left.
    const Floats plain = smooth_step(one, set(4.0f), hn::Max(full_x, full_y));
    const auto mean_of = [&](std::size_t c) {
        float sum = 0;
        for (const float crop : country.crops[c]) sum += crop;
        return set(sum / float(kCrops));
    };
    albedo = mix(albedo, {mean_of(0), mean_of(1), mean_of(2)}, {plain, plain, plain});
    const Floats hedges = hn::Min(hedge_part(y, full_y, set(country.hedge_cells)), one);
    albedo = mix(albedo, set3({country.hedge[0], country.hedge[1], country.hedge[2], 0}), {hedges, hedges, hedges});
    const Floats woods = part_above(resolved_noise(country.woods, point, print.longest), kWoodLevel);
    albedo = mix(albedo, set3({country.wood[0], country.wood[1], country.wood[2], 0}), {woods, woods, woods});
    const Floats tone = hn::MulAdd(set(0.09f), probed_noise(country.tones, point, print),
                                   hn::Mul(set(0.15f), probed_noise(country.tussocks, point, print)));
    return times(hn::Max(hn::Add(one, tone), zero), albedo);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
