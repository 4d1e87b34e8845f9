// SPDX-License-Identifier: Apache-2.0

// render/shading/endless.glsl for vectors of places.

#if defined(NEPHOS_RENDER_ENDLESS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_ENDLESS_INL_H_
#undef NEPHOS_RENDER_ENDLESS_INL_H_
#else
#define NEPHOS_RENDER_ENDLESS_INL_H_
#endif

#include <cstddef>
#include <cstdint>

#include <hwy/highway.h>

#include "density/detail-inl.h"
#include "render/frame/frame_data.h"
#include "render/frame/marched_scene.h"
#include "render/shading/floats3-inl.h"
#include "render/shading/formulas-inl.h"
#include "render/shared/march.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// A place relative to the eye, as if the round Earth were a plane.
HWY_INLINE Floats3 above_plane(const Floats3& point, float bend) {
    return {point.x, point.y, hn::MulAdd(set(bend), hn::MulAdd(point.x, point.x, hn::Mul(point.y, point.y)), point.z)};
}

// How far images are drawn aside, metres, and what that adds to the slope of lines.
struct Wave {
    Floats height, slope;
};

// `beyond`: from the first period, along the axis across which they are drawn; `length`: kWaveAcross or kWaveAlong.
HWY_INLINE Wave wave_at(const MarchedVolume& volume, Floats beyond, float length) {
    const Lanes d;
    const Floats one = set(1.0f);
    const float per_wave = volume.patch_ramp / length;
    const Floats turns = hn::Mul(beyond, set(per_wave)), half = hn::Sub(hn::Sub(turns, hn::Floor(turns)), set(0.5f));
    const Floats q = hn::MulSub(hn::Abs(half), set(4.0f), one), rest = hn::Sub(set(2.0f), hn::Abs(q));
    const Floats slope = hn::Mul(set(-8 * shader::kWaveHeight), hn::CopySign(hn::Sub(rest, one), half));
    return {hn::Mul(set(shader::kWaveHeight / per_wave), hn::NegMulAdd(q, rest, one)),
            hn::IfThenElseZero(hn::Ne(beyond, hn::Zero(d)), slope)};
}

// Places in a volume.
struct PlaceIn {
    // Relative to its corner. Of a volume that repeats: those with the same cloud in its first period, over a plane
    // ground.
    Floats3 offset;
    // Of a volume that repeats: relative to its corner, not taken back; how far beyond the first period in x and y; and
    // the waves there, of the first axis by the second and the other way round.
    Floats x, y, beyond_x, beyond_y;
    Wave across, along;
};

HWY_INLINE PlaceIn endless_place(const MarchedVolume& volume, Floats x, Floats y) {
    const Lanes d;
    const Floats zero = hn::Zero(d);
    const auto beyond = [&](Floats at, std::size_t axis) {
        return hn::Sub(hn::Max(hn::Sub(at, set(volume.home + volume.period[axis])), zero),
                       hn::Max(hn::Sub(set(volume.home), at), zero));
    };
    const Floats beyond_x = beyond(x, 0), beyond_y = beyond(y, 1);
    Wave across{zero, zero}, along{zero, zero};
    if (!hn::AllTrue(d, hn::Eq(hn::Or(beyond_x, beyond_y), zero))) {
        across = wave_at(volume, beyond_y, shader::kWaveAcross);
        along = wave_at(volume, beyond_x, shader::kWaveAlong);
    }
    const auto at_home = [&](Floats at, std::size_t axis) {
        const Floats periods = hn::Floor(hn::Mul(hn::Sub(at, set(volume.home)), set(volume.per_period[axis])));
        return hn::NegMulAdd(periods, set(volume.period[axis]), at);
    };
    return {{at_home(hn::Add(x, across.height), 0), at_home(hn::Add(y, along.height), 1), zero},
            x, y, beyond_x, beyond_y, across, along};
}

// Of points relative to the eye.
HWY_INLINE PlaceIn place_in(const MarchedVolume& volume, const Floats3& point) {
    const Floats3 corner{set(volume.corner[0]), set(volume.corner[1]), set(volume.corner[2])};
    if (!volume.repeats) {
        const Floats zero = hn::Zero(Lanes());
        return {subtract(point, corner), zero, zero, zero, zero, {zero, zero}, {zero, zero}};
    }
    const Floats3 apart = subtract(above_plane(point, volume.bend), corner);
    PlaceIn place = endless_place(volume, apart.x, apart.y);
    place.offset.z = apart.z;
    return place;
}

// The direction of rays at a distance from the eye, as such places go on along it. The volume repeats.
HWY_INLINE Floats3 way_in(const MarchedVolume& volume, const PlaceIn& place, const Floats3& ray, Floats distance) {
    const Floats level = hn::NegMulAdd(ray.z, ray.z, set(1.0f));
    return {hn::MulAdd(place.across.slope, ray.y, ray.x), hn::MulAdd(place.along.slope, ray.x, ray.y),
            hn::MulAdd(hn::Mul(set(2 * volume.bend), distance), level, ray.z)};
}

// How much cloud there is, relative to the first period.
HWY_INLINE Floats patches_at(const MarchedVolume& volume, const PlaceIn& place) {
    const Lanes d;
    const Floats zero = hn::Zero(d), one = set(1.0f);
    if (!volume.repeats) return one;
    const Floats away = hn::Max(hn::Abs(place.beyond_x), hn::Abs(place.beyond_y));
    const Floats share = hn::Min(hn::Mul(away, set(volume.patch_ramp)), one);
    if (hn::AllTrue(d, hn::Eq(share, zero))) return one;
    const float* const to = volume.to_patches;
    const Floats voxels = set(float(kLargeNoiseVoxels));
    const Floats across = hn::MulAdd(set(to[0]), place.x, hn::Mul(set(to[1]), place.y)),
                 along = hn::MulAdd(set(to[2]), place.x, hn::Mul(set(to[3]), place.y));
    const Floats noise = erosion::noise_at(volume.kernel.large_noise, erosion::integer(0), erosion::integer(7),
                                           hn::Mul(across, voxels), hn::Mul(along, voxels),
                                           set(shader::kPatchLevel * float(kLargeNoiseVoxels)));
    const Floats more = hn::NegMulAdd(set(2.0f), noise, one);
    return hn::Max(hn::MulAdd(hn::Mul(share, set(shader::kPatchSpread)), more, one), zero);
}

// D times a factor, as the share t of D and the density of half coverage that nodes store.
HWY_INLINE Floats scaled_share(Floats t, Floats factor) {
    const Floats scaled = hn::Mul(t, factor);
    return hn::Div(scaled, hn::Max(hn::Add(hn::Sub(set(1.0f), t), scaled), set(1.0e-6f)));
}

// The mean fraction of the sunlight that clouds which repeat leave below them.
inline float mean_sunlight(const MarchedScene& march) {
    float left = 1;
    for (const MarchedVolume& volume : march.volumes) left *= volume.repeats ? volume.mean_sunlight : 1;
    return left;
}

// Where lines from points towards the sun cross a volume that repeats, in the middle of its height: column and row of its
// shade, and metres from its corner.
struct SunCrossing {
    Floats3 above;  // the points, over a plane ground
    Floats column, row, x, y;
};

HWY_INLINE SunCrossing sun_crossing(const MarchedVolume& volume, const Floats3& point) {
    const Floats3 above = above_plane(point, volume.bend);
    const Floats column = hn::Add(dot(set3(volume.shade_u), above), set(volume.shade_u.w)),
                 row = hn::Add(dot(set3(volume.shade_v), above), set(volume.shade_v.w));
    const Floats cell = set(2 * volume.kernel.node_m);
    return {above, column, row, hn::MulAdd(column, cell, set(volume.shade_mid[0])),
            hn::MulAdd(row, cell, set(volume.shade_mid[1]))};
}

// Whether these lines cross the first period, which the shade map and the shadow map know, of all such volumes.
HWY_INLINE hn::Mask<Lanes> sees_first_period(const MarchedScene& march, const Floats3& point) {
    hn::Mask<Lanes> first = hn::FirstN(Lanes(), hn::Lanes(Lanes()));
    for (const MarchedVolume& volume : march.volumes) {
        if (!volume.repeats) continue;
        const SunCrossing at = sun_crossing(volume, point);
        const auto inside = [&](Floats along, std::size_t axis) {
            return hn::And(hn::Ge(along, set(volume.home)), hn::Le(along, set(volume.home + volume.period[axis])));
        };
        first = hn::And(first, hn::And(inside(at.x, 0), inside(at.y, 1)));
    }
    return first;
}

// Fraction of the sunlight that clouds which repeat leave at points relative to the eye.
HWY_INLINE Floats sunlight_beyond(const MarchedScene& march, const Floats3& point) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    Floats left = set(1.0f);
    const Floats away = hn::Mul(hn::Sub(hn::Sqrt(dot(point, point)), set(shader::kShadeFades_m)),
                                set(0.5f / shader::kShadeFades_m));
    const Floats blurred = hn::Max(hn::Min(away, left), hn::Zero(d));
    for (const MarchedVolume& volume : march.volumes) {
        if (!volume.repeats) continue;
        const SunCrossing at = sun_crossing(volume, point);
        const Floats per_cell = set(0.5f / volume.kernel.node_m);
        const auto wrapped = [&](Floats along, int count) {
            const Floats size = set(float(count));
            return hn::NegMulAdd(hn::Floor(hn::Mul(along, set(1.0f / float(count)))), size, along);
        };
        const PlaceIn middle = endless_place(volume, at.x, at.y);
        const Floats u = wrapped(hn::MulAdd(middle.across.height, per_cell, at.column), volume.shade_columns),
                     v = wrapped(hn::MulAdd(middle.along.height, per_cell, at.row), volume.shade_rows);
        const auto texel = [&](Floats along, int count) {
            return hn::Min(hn::Max(hn::ConvertTo(di, along), hn::Zero(di)), hn::Set(di, count - 1));
        };
        const auto i = texel(u, volume.shade_columns), j = texel(v, volume.shade_rows);
        const auto words = hn::GatherIndex(di, reinterpret_cast<const std::int32_t*>(volume.shade),
                                           hn::Add(hn::Mul(j, hn::Set(di, volume.shade_columns)), i));
        const Floats root = hn::Mul(erosion::of_word(words, hn::Sub(u, hn::ConvertTo(d, i)), hn::Sub(v, hn::ConvertTo(d, j))),
                                    set(1.0f / 255.0f));
        const Floats patches = patches_at(volume, middle);
        const Floats below = hn::Mul(hn::Sub(set(volume.shade_top), at.above.z), set(volume.per_shade_height));
        const Floats part = hn::Max(hn::Min(below, set(1.0f)), hn::Zero(d));
        const Floats depth = hn::Mul(hn::Mul(hn::Mul(root, root), set(shader::kMostShadeDepth)), hn::Mul(patches, part));
        const Floats mean = hn::NegMulAdd(part, set(1 - volume.mean_sunlight), set(1.0f));
        const Floats exact = fast_exp(hn::Neg(depth));
        left = hn::Mul(left, hn::MulAdd(blurred, hn::Sub(mean, exact), exact));
    }
    return left;
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
