// SPDX-License-Identifier: Apache-2.0

// Samples of rays in clouds with detail, and the steps to the next ones, for vectors of rays.

#if defined(NEPHOS_RENDER_MARCH_SAMPLE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_MARCH_SAMPLE_INL_H_
#undef NEPHOS_RENDER_MARCH_SAMPLE_INL_H_
#else
#define NEPHOS_RENDER_MARCH_SAMPLE_INL_H_
#endif

#include <cstddef>
#include <limits>

#include <hwy/highway.h>

#include "render/cpu/marched_light-inl.h"
#include "render/frame/marched_scene.h"
#include "render/shared/march.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// What a sample of a ray found in all volumes.
struct MarchSample {
    Floats extinction, margin, step, which;
    Mask near;  // to cloud: it was sampled
};

// One over a direction, never infinite.
HWY_INLINE Floats inverse(Floats direction) {
    const Floats least = set(1.0e-6f);
    const Floats safe = hn::IfThenElse(hn::Lt(hn::Abs(direction), least), least, direction);
    return hn::Div(set(1.0f), safe);
}

// The part of rays in the box of a volume's bricks.
struct BoxPart {
    Floats begin, end;
};

// The part of rays in a slab that goes on to the horizon, between two heights above the eye: a ray rises above the ground
// by ray.z t + bend_t t^2.
HWY_INLINE BoxPart part_in_slab(float base, float top, Floats ray_z, Floats bend) {
    const Floats zero = hn::Zero(Lanes()), least = set(1.0e-9f);
    if (top == 0) top = shader::kLeastHeight_m;
    const auto root_at = [&](float height) {
        return hn::Sqrt(hn::Max(hn::MulAdd(set(4 * height), bend, hn::Mul(ray_z, ray_z)), zero));
    };
    const auto rising_at = [&](float height, Floats root) {  // the later crossing
        const Floats sum = hn::Add(ray_z, root);
        return hn::Div(set(2 * height), height > 0 ? hn::Max(sum, least) : hn::Min(sum, hn::Neg(least)));
    };
    const Floats root = root_at(top);
    BoxPart part{zero, hn::Min(rising_at(top, root), set(shader::kHorizon_m))};
    if (base > 0) part.begin = rising_at(base, root_at(base));
    if (top < 0) {
        const Floats falling = hn::Sub(ray_z, root);
        const Mask meets = hn::And(hn::Lt(ray_z, zero), hn::Gt(root, zero));
        part.begin = hn::IfThenElse(meets, hn::Div(set(2 * top), hn::Min(falling, hn::Neg(least))),
                                    set(shader::kFarAway_m));
    }
    return part;
}

HWY_INLINE BoxPart part_in_box(const MarchedVolume& volume, const Floats3& ray, const Floats3& per_ray) {
    if (volume.repeats) {
        const Floats level = hn::NegMulAdd(ray.z, ray.z, set(1.0f));
        return part_in_slab(volume.corner[2],
                            volume.corner[2] + 8 * volume.kernel.node_m * float(volume.kernel.bricks[2]), ray.z,
                            hn::Mul(set(volume.bend), level));
    }
    const float edge = 8 * volume.kernel.node_m;
    BoxPart part{hn::Zero(Lanes()), set(std::numeric_limits<float>::max())};
    const Floats per[3] = {per_ray.x, per_ray.y, per_ray.z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const Floats a = hn::Mul(set(volume.corner[axis]), per[axis]),
                     b = hn::Mul(set(volume.corner[axis] + edge * float(volume.kernel.bricks[axis])), per[axis]);
        part.begin = hn::Max(part.begin, hn::Min(a, b));
        part.end = hn::Min(part.end, hn::Max(a, b));
    }
    return part;
}

// The part in which a volume is marched.
HWY_INLINE BoxPart part_of(const MarchedScene& march, const MarchedVolume& volume, const Floats3& ray,
                           const Floats3& per_ray) {
    BoxPart part = part_in_box(volume, ray, per_ray);
    if (!volume.repeats) part.end = hn::Min(part.end, set(march.fade_ends));
    return part;
}

// Numbers of the octants that directions lie in (CoverageField::table()), given one over them.
HWY_INLINE Words octant_of(const Floats3& per_way) {
    const hn::RebindToSigned<Lanes> di;
    const auto bit_of = [&](Floats per, int bit) {
        return hn::IfThenElseZero(hn::RebindMask(di, hn::Gt(per, hn::Zero(Lanes()))), hn::Set(di, bit));
    };
    return hn::Add(bit_of(per_way.x, 1), hn::Add(bit_of(per_way.y, 2), bit_of(per_way.z, 4)));
}

// The ways out of the half cells between eight nodes.
HWY_INLINE Floats out_of_half(const MarchedVolume& volume, const BrickPlace& place, const Floats3& offset,
                              const Floats3& per_way) {
    const Floats zero = hn::Zero(Lanes());
    const auto along = [&](Floats brick, Floats local, Floats offset_m, Floats per) {
        const Floats low = hn::MulAdd(brick, set(8.0f), hn::Min(hn::Floor(local), set(7.0f)));
        const Floats edge = hn::IfThenElse(hn::Gt(per, zero), hn::Add(low, set(1.0f)), low);
        return hn::Mul(hn::MulSub(edge, set(volume.kernel.node_m), offset_m), per);
    };
    const Floats out = hn::Min(along(place.brick.x, place.local.x, offset.x, per_way.x),
                               hn::Min(along(place.brick.y, place.local.y, offset.y, per_way.y),
                                       along(place.brick.z, place.local.z, offset.z, per_way.z)));
    return hn::Max(out, zero);
}

HWY_INLINE MarchSample sample_volumes(const MarchedScene& march, const Floats3& ray, const Floats3& per_ray,
                                      const BoxPart* parts, Floats distance, Floats transmittance, Mask active) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    const Floats zero = hn::Zero(d), one = set(1.0f);
    const Floats footprint = hn::Mul(distance, set(march.per_unit));
    const Floats fade = hn::Div(hn::Sub(distance, set(march.fade_begins)), set(march.fade_ends - march.fade_begins));
    const Floats share = hn::Max(hn::Min(fade, one), zero);
    const Floats kept = hn::NegMulAdd(hn::Mul(share, share), hn::NegMulAdd(set(2.0f), share, set(3.0f)), one);
    const Floats finest = hn::Min(hn::Max(set(march.least_step), hn::Mul(set(shader::kStepPixels), footprint)),
                                  set(march.most_step));
    const Floats least_step = hn::Mul(finest, hn::MulAdd(hn::Sub(one, transmittance), set(shader::kStepGrowth), one));
    MarchSample sample{zero, one, set(shader::kFarAway_m), zero, hn::Lt(one, zero)};
    for (std::size_t v = 0; v < march.volumes.size(); ++v) {
        const MarchedVolume& volume = march.volumes[v];
        const PlaceIn in_volume = place_in(volume, times(distance, ray));
        const Floats3& offset = in_volume.offset;
        const BrickPlace place = brick_place(volume, offset);
        const Mask before = hn::Lt(distance, parts[v].begin);
        Floats3 per_way = per_ray;
        if (volume.repeats) {
            const Floats3 way = way_in(volume, in_volume, ray, distance);
            per_way = {inverse(way.x), inverse(way.y), inverse(way.z)};
        }
        // At the faces of the box rounding decides what is inside: there rays go on by a metre. Below a cloud that
        // repeats they go on to its base.
        Floats on = one;
        if (volume.repeats) {
            const Floats rising = hn::IfThenElse(hn::Gt(per_way.z, zero), per_way.z, set(shader::kLongestLeap_m));
            on = hn::Max(one, hn::Min(hn::Mul(hn::Neg(offset.z), rising), set(shader::kLongestLeap_m)));
        }
        const Floats beside = hn::IfThenElse(hn::Lt(distance, parts[v].end), on, set(shader::kFarAway_m));
        Floats step = hn::IfThenElse(before, hn::Add(hn::Sub(parts[v].begin, distance), set(shader::kBeyondFace_m)), beside);
        Mask within = hn::And(place.within, active);
        if (!volume.repeats) within = hn::And(within, hn::Lt(distance, set(march.fade_ends)));
        const Mask holds = hn::And(within, hn::RebindMask(d, hn::Gt(place.number, hn::Set(di, -1))));
        // The cell in the brick, and the cube without cloud that begins at that cell, or at a brick without cloud.
        const Floats half = set(0.5f), three = set(3.0f);
        const auto cell_of = [&](Floats local) { return hn::Min(hn::Floor(hn::Mul(local, half)), three); };
        const Floats3 cell{cell_of(place.local.x), cell_of(place.local.y), cell_of(place.local.z)};
        const Floats in_brick = hn::MulAdd(hn::MulAdd(cell.z, set(4.0f), cell.y), set(4.0f), cell.x);
        const Words octant = octant_of(per_way);
        const auto of_octant = hn::Add(hn::ShiftLeft<3>(hn::Max(place.number, hn::Zero(di))), octant);
        const auto word = hn::GatherOffset(di, reinterpret_cast<const std::int32_t*>(volume.kernel.cells),
                                           hn::Add(hn::ShiftLeft<6>(of_octant), hn::ConvertTo(di, in_brick)));
        const auto byte = hn::And(word, hn::Set(di, 255));
        const Floats least_patches = hn::Mul(hn::ConvertTo(d, byte), set(CoverageField::kFactorStep));
        Mask sampled = hn::And(holds, hn::Lt(least_patches, set(volume.most_patches)));
        Floats patches = one;
        if (volume.repeats && !hn::AllFalse(d, sampled)) {
            patches = patches_at(volume, in_volume);
            sampled = hn::And(sampled, hn::Lt(least_patches, patches));
        }
        const auto bit = hn::Add(octant, hn::ShiftLeft<1>(octant));
        const auto of_cells = hn::Sub(byte, hn::Set(di, CoverageField::kOccupied)),
                   of_bricks = hn::Add(hn::And(hn::Shr(place.number, bit), hn::Set(di, 7)), hn::Set(di, 1));
        const Floats count = hn::ConvertTo(
            d, hn::IfThenElse(hn::RebindMask(di, holds), hn::Max(of_cells, hn::Set(di, 1)), of_bricks));
        const Floats size = hn::IfThenElse(holds, set(2 * volume.kernel.node_m), set(8 * volume.kernel.node_m));
        const auto way_out = [&](Floats brick, Floats in_cell, Floats offset_m, Floats per) {
            const Floats own = hn::IfThenElse(holds, hn::MulAdd(brick, set(4.0f), in_cell), brick);
            const Floats edge = hn::IfThenElse(hn::Gt(per, zero), hn::Add(own, count),
                                               hn::Sub(hn::Add(own, one), count));
            return hn::Mul(hn::MulSub(edge, size, offset_m), per);
        };
        Floats out = hn::Min(way_out(place.brick.x, cell.x, offset.x, per_way.x),
                             hn::Min(way_out(place.brick.y, cell.y, offset.y, per_way.y),
                                     way_out(place.brick.z, cell.z, offset.z, per_way.z)));
        if (volume.repeats) {  // the next period is another place in the bricks
            const auto to_face = [&](Floats at, std::size_t axis, Floats per) {
                const Floats face =
                    hn::IfThenElse(hn::Gt(per, zero), set(volume.home + volume.period[axis]), set(volume.home));
                return hn::Mul(hn::Sub(face, at), per);
            };
            out = hn::Min(out, hn::Min(to_face(offset.x, 0, per_way.x), to_face(offset.y, 1, per_way.y)));
            out = hn::Min(out, set(shader::kStraightWay_m));
        }
        const Floats beyond = set(volume.repeats ? shader::kBeyondBentFace_m : shader::kBeyondFace_m);
        step = hn::IfThenElse(within, hn::Add(hn::Max(out, zero), beyond), step);
        if (!hn::AllFalse(d, sampled)) {
            // The other lanes read the first brick, which is in the cache.
            const auto number = hn::IfThenElseZero(hn::RebindMask(di, sampled), place.number);
            Floats most_t = zero;
            erosion::Node node =
                erosion::node_at(volume.kernel, number, place.local.x, place.local.y, place.local.z, &most_t);
            if (volume.repeats) node.t = scaled_share(node.t, patches);
            const Mask clear =
                hn::AndNot(erosion::text::may_hold_cloud(most_t, patches, volume.cloud_odds), sampled);
            if (!hn::AllFalse(d, clear)) {
                sampled = hn::AndNot(clear, sampled);
                step = hn::IfThenElse(clear, hn::Add(out_of_half(volume, place, offset, per_way), beyond), step);
            }
            if (hn::AllFalse(d, sampled)) {
                sample.step = hn::Min(sample.step, step);
                continue;
            }
            const erosion::Eroded found = erosion::eroded<true>(volume.kernel, node, offset.x, offset.y, offset.z,
                                                          hn::Max(footprint, set(shader::kLeastFootprint_m)), sampled);
            Floats extinction = hn::Mul(found.density, set(volume.kernel.extinction_per_m));
            if (!volume.repeats) extinction = hn::Mul(extinction, kept);
            sample.extinction = hn::Add(sample.extinction, extinction);
            sample.which = hn::IfThenElse(hn::Gt(extinction, zero), set(float(v)), sample.which);
            sample.margin = hn::IfThenElse(sampled, hn::Min(sample.margin, found.margin), sample.margin);
            const Floats nearing = hn::Min(hn::Max(hn::Mul(found.margin, set(volume.reach)), least_step),
                                           hn::Max(set(shader::kLongestStep_m), least_step));
            step = hn::IfThenElse(sampled, nearing, step);
            sample.near = hn::Or(sample.near, sampled);
        }
        sample.step = hn::Min(sample.step, step);
    }
    return sample;
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
