// SPDX-License-Identifier: Apache-2.0

// Rays through clouds with detail, a vector of pixels at a time. A ray crosses empty space in one step, bricks or
// cells at once; near cloud it steps by the coverage that is missing, in cloud by about a pixel. What it sees is
// shaded whenever an eighth of opacity has come together, a vector of points at a time.

#if defined(NEPHOS_RENDER_MARCH_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_MARCH_INL_H_
#undef NEPHOS_RENDER_MARCH_INL_H_
#else
#define NEPHOS_RENDER_MARCH_INL_H_
#endif

#include <cstddef>
#include <cstdint>
#include <limits>

#include <hwy/highway.h>

#include "render/cpu/march_sample-inl.h"
#include "render/cpu/marched_light-inl.h"
#include "render/cpu/tile_air-inl.h"
#include "render/cpu/view_scene.h"
#include "render/frame/marched_scene.h"
#include "render/shared/march.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// Points that wait to be shaded, of one volume.
struct MarchQueue {
    static constexpr std::size_t kSize = 256;
    HWY_ALIGN float distance[kSize], weight[kSize];
    HWY_ALIGN std::int32_t pixel[kSize];
    std::size_t count = 0;
};

HWY_INLINE Floats3 ray_of(const TileRays& rays, Words pixel) {
    const Lanes d;
    return {hn::GatherIndex(d, rays.x, pixel), hn::GatherIndex(d, rays.y, pixel), hn::GatherIndex(d, rays.z, pixel)};
}

inline void shade_queue(const ViewScene& scene, const MarchedVolume& volume, const TileRays& rays, MarchQueue& queue,
                        TileSums& sums) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    const std::size_t lanes = hn::Lanes(d);
    HWY_ALIGN float colour[3][2 * shader::kTileWidth];
    for (std::size_t begin = 0; begin < queue.count; begin += lanes) {
        const std::size_t some = std::min(lanes, queue.count - begin);
        for (std::size_t i = begin + some; i < begin + lanes; ++i) {  // idle lanes see what the last one sees
            queue.distance[i] = queue.distance[begin + some - 1];
            queue.pixel[i] = queue.pixel[begin + some - 1];
        }
        const Floats3 radiance =
            marched_radiance(scene, volume, ray_of(rays, hn::Load(di, queue.pixel + begin)),
                             hn::Load(d, queue.distance + begin), hn::FirstN(d, some));
        hn::Store(radiance.x, d, colour[0]);
        hn::Store(radiance.y, d, colour[1]);
        hn::Store(radiance.z, d, colour[2]);
        for (std::size_t i = 0; i < some; ++i) {
            const auto at = std::size_t(queue.pixel[begin + i]);
            const float weight = queue.weight[begin + i];
            sums.red[at] += weight * colour[0][i];
            sums.green[at] += weight * colour[1][i];
            sums.blue[at] += weight * colour[2][i];
            sums.distance[at] += weight * queue.distance[begin + i];
        }
    }
    queue.count = 0;
}

inline void begin_march(const MarchedScene& march, const TileRays& rays, MarchState& state) {
    const Lanes d;
    for (std::size_t at = 0; at < kTilePixels; at += hn::Lanes(d)) {
        const Floats3 ray{hn::Load(d, rays.x + at), hn::Load(d, rays.y + at), hn::Load(d, rays.z + at)};
        const Floats3 per_ray{inverse(ray.x), inverse(ray.y), inverse(ray.z)};
        Floats first = set(std::numeric_limits<float>::max());
        for (const MarchedVolume& volume : march.volumes) {
            const BoxPart part = part_in_box(volume, ray, per_ray);
            first = hn::Min(first, hn::IfThenElse(hn::Lt(part.begin, part.end), part.begin, first));
        }
        hn::Store(first, d, state.distance + at);
        hn::Store(set(-1.0f), d, state.margin + at);
    }
    state.begun = true;
}

// Marches one vector of rays up to a distance. Returns true while there is more to march.
HWY_INLINE bool march_vector(const ViewScene& scene, const TileRays& rays, std::size_t at, float limit_m,
                             MarchQueue* queues, MarchState& state, TileSums& sums) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    const MarchedScene& march = *scene.march;
    const Floats zero = hn::Zero(d), one = set(1.0f), opaque = set(shader::kMarchOpaque);
    Floats distance = hn::Load(d, state.distance + at), left = hn::Load(d, sums.transmittance + at);
    const Floats3 ray{hn::Load(d, rays.x + at), hn::Load(d, rays.y + at), hn::Load(d, rays.z + at)};
    const Floats3 per_ray{inverse(ray.x), inverse(ray.y), inverse(ray.z)};
    BoxPart parts[shader::kMostVolumes];
    Floats end = zero;
    for (std::size_t v = 0; v < march.volumes.size(); ++v) {
        parts[v] = part_in_box(march.volumes[v], ray, per_ray);
        if (!march.volumes[v].repeats) parts[v].end = hn::Min(parts[v].end, set(march.fade_ends));
        end = hn::Max(end, hn::IfThenElseZero(hn::Lt(parts[v].begin, parts[v].end), parts[v].end));
    }
    end = hn::Min(end, hn::Load(d, rays.ground + at));
    const Floats stop = hn::Min(end, set(limit_m));
    Mask active = hn::And(hn::Lt(distance, stop), hn::Gt(left, opaque));
    if (hn::AllFalse(d, active)) return !hn::AllFalse(d, hn::And(hn::Lt(distance, end), hn::Gt(left, opaque)));
    Floats extinction = hn::Load(d, state.extinction + at), way = hn::Load(d, state.step + at),
           margin = hn::Load(d, state.margin + at), weight = hn::Load(d, state.weight + at),
           weighted = hn::Load(d, state.weighted_distance + at), which = zero;
    const Words pixel = hn::Iota(di, std::int32_t(at));
    const auto enqueue = [&](Mask asked) {
        const Floats mean = hn::Div(weighted, hn::Max(weight, set(1.0e-9f)));
        for (std::size_t v = 0; v < march.volumes.size(); ++v) {
            const Mask of = march.volumes.size() == 1 ? asked : hn::And(asked, hn::Eq(which, set(float(v))));
            if (hn::AllFalse(d, of)) continue;
            MarchQueue& queue = queues[v];
            if (queue.count + 2 * hn::Lanes(d) > MarchQueue::kSize)
                shade_queue(scene, march.volumes[v], rays, queue, sums);
            hn::CompressStore(mean, of, d, queue.distance + queue.count);
            hn::CompressStore(weight, of, d, queue.weight + queue.count);
            queue.count += hn::CompressStore(pixel, hn::RebindMask(di, of), di, queue.pixel + queue.count);
        }
        weight = hn::IfThenElse(asked, zero, weight);
        weighted = hn::IfThenElse(asked, zero, weighted);
    };
    while (!hn::AllFalse(d, active)) {
        const MarchSample now = sample_volumes(march, ray, per_ray, parts, distance, left, active);
        const Floats found = now.extinction;
        // The step before counts as cloud; where it came from outside, only from the surface on: where the margin
        // of the two samples passes zero, or about one fine step where empty space was skipped.
        const Floats finest =
            hn::Min(hn::Max(set(march.least_step), hn::Mul(set(shader::kStepPixels * march.per_unit), distance)),
                    set(march.most_step));
        const Floats inside = hn::Div(hn::Neg(now.margin), hn::Max(hn::Sub(margin, now.margin), set(shader::kLeastMargin)));
        const Floats behind = hn::IfThenElse(
            hn::Lt(margin, zero), hn::Mul(set(shader::kSkippedSteps), finest),
            hn::MulAdd(way, hn::Max(hn::Min(inside, one), zero), hn::Mul(set(shader::kSurfaceSteps), finest)));
        const Floats length = hn::IfThenElse(hn::Gt(extinction, zero), way, hn::Min(way, behind));
        const Floats depth = hn::Mul(hn::Mul(set(0.5f), hn::Add(found, extinction)), length);
        const Floats opacity = hn::IfThenElseZero(active, hn::Sub(one, fast_exp(hn::Neg(depth))));
        Floats seen = hn::Mul(left, opacity);
        left = hn::Sub(left, seen);
        const Mask ends = hn::And(active, hn::Le(left, opaque));  // what little is left is seen here, too
        seen = hn::IfThenElse(ends, hn::Add(seen, left), seen);
        left = hn::IfThenElse(ends, zero, left);
        weight = hn::Add(weight, seen);
        weighted = hn::MulAdd(seen, hn::NegMulAdd(set(0.5f), length, distance), weighted);
        which = hn::IfThenElse(hn::Gt(found, zero), now.which, which);
        const Mask leaves = hn::And(hn::Gt(weight, set(shader::kLeavingOpacity)), hn::Le(found, zero));
        const Mask full = hn::And(active, hn::Or(hn::Gt(weight, set(shader::kEventOpacity)), hn::Or(leaves, ends)));
        if (!hn::AllFalse(d, full)) enqueue(full);
        extinction = hn::IfThenElse(active, found, extinction);
        margin = hn::IfThenElse(active, hn::IfThenElse(now.near, now.margin, set(-1.0f)), margin);
        way = hn::IfThenElse(active, now.step, way);
        const Floats next =
            hn::Max(hn::Add(distance, now.step), hn::Mul(distance, set(shader::kLeastAdvance)));
        distance = hn::IfThenElse(active, next, distance);
        active = hn::And(active, hn::And(hn::Lt(distance, stop), hn::Gt(left, opaque)));
    }
    const Mask rest = hn::Gt(weight, zero);
    if (!hn::AllFalse(d, rest)) enqueue(rest);
    hn::Store(distance, d, state.distance + at);
    hn::Store(extinction, d, state.extinction + at);
    hn::Store(way, d, state.step + at);
    hn::Store(margin, d, state.margin + at);
    hn::Store(weight, d, state.weight + at);
    hn::Store(weighted, d, state.weighted_distance + at);
    hn::Store(left, d, sums.transmittance + at);
    return !hn::AllFalse(d, hn::And(hn::Lt(distance, end), hn::Gt(left, opaque)));
}

// Marches the rays of a tile up to a distance from the eye.
inline void march_to(const ViewScene& scene, const TileRays& rays, float limit_m, MarchState& state,
                     TileSums& sums) {
    if (state.done) return;
    if (!state.begun) begin_march(*scene.march, rays, state);
    MarchQueue queues[shader::kMostVolumes];
    bool more = false;
    for (std::size_t at = 0; at < kTilePixels; at += hn::Lanes(Lanes()))
        more = march_vector(scene, rays, at, limit_m, queues, state, sums) || more;
    for (std::size_t v = 0; v < scene.march->volumes.size(); ++v)
        shade_queue(scene, scene.march->volumes[v], rays, queues[v], sums);
    state.done = !more;
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
