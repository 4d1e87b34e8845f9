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

#include <algorithm>
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

// Finds where the rays of a tile begin and end.
inline void begin_march(const MarchedScene& march, const TileRays& rays, MarchState& state) {
    const Lanes d;
    for (std::size_t at = 0; at < kTilePixels; at += hn::Lanes(d)) {
        const Floats3 ray{hn::Load(d, rays.x + at), hn::Load(d, rays.y + at), hn::Load(d, rays.z + at)};
        const Floats3 per_ray{inverse(ray.x), inverse(ray.y), inverse(ray.z)};
        Floats first = set(std::numeric_limits<float>::max()), end = hn::Zero(d);
        for (const MarchedVolume& volume : march.volumes) {
            const BoxPart part = part_of(march, volume, ray, per_ray);
            const Mask meets = hn::Lt(part.begin, part.end);
            first = hn::Min(first, hn::IfThenElse(meets, part.begin, first));
            end = hn::Max(end, hn::IfThenElseZero(meets, part.end));
        }
        hn::Store(first, d, state.distance + at);
        hn::Store(hn::Min(end, hn::Load(d, rays.ground + at)), d, state.end + at);
        hn::Store(set(-1.0f), d, state.margin + at);
    }
    state.begun = true;
}

// The numbers of a ray on its way; kEnd: the transmittance at which it ends.
enum RayPart : std::size_t { kDistance, kLeft, kExtinction, kWay, kMargin, kStop, kEnd, kRayX, kRayY, kRayZ, kRayParts };

// The rays of a tile that go on, one after the other, so that no lane of a vector has none.
struct WaitingRays {
    static constexpr std::size_t kMostLanes = 2 * shader::kTileWidth, kSize = kTilePixels + kMostLanes;
    HWY_ALIGN float parts[kRayParts][kSize];
    HWY_ALIGN std::int32_t pixel[kSize];
    std::size_t next = 0, end = 0;

    // Those of a tile that have not come to `limit_m`.
    WaitingRays(const TileRays& rays, float limit_m, const MarchState& state, const TileSums& sums) {
        const Lanes d;
        const hn::RebindToSigned<Lanes> di;
        const Floats limit = set(limit_m);
        for (std::size_t at = 0; at < kTilePixels; at += hn::Lanes(d)) {
            const Floats distance = hn::Load(d, state.distance + at), left = hn::Load(d, sums.transmittance + at),
                         stop = hn::Min(hn::Load(d, state.end + at), limit),
                         opaque = hn::Mul(set(shader::kMarchOpaqueFactor), hn::Load(d, sums.opaque + at));
            const Mask go_on = hn::And(hn::Lt(distance, stop), hn::Gt(left, opaque));
            if (hn::AllFalse(d, go_on)) continue;
            // Full vectors are stored, each over the idle end of the one before.
            const auto put = [&](RayPart part, Floats value) {
                hn::StoreU(hn::Compress(value, go_on), d, parts[part] + end);
            };
            put(kDistance, distance);
            put(kLeft, left);
            put(kExtinction, hn::Load(d, state.extinction + at));
            put(kWay, hn::Load(d, state.step + at));
            put(kMargin, hn::Load(d, state.margin + at));
            put(kStop, stop);
            put(kEnd, opaque);
            put(kRayX, hn::Load(d, rays.x + at));
            put(kRayY, hn::Load(d, rays.y + at));
            put(kRayZ, hn::Load(d, rays.z + at));
            hn::StoreU(hn::Compress(hn::Iota(di, std::int32_t(at)), hn::RebindMask(di, go_on)), di, pixel + end);
            end += hn::CountTrue(d, go_on);
        }
        if (end == 0) return;
        // Lanes behind the last ray are as the first: what lies there could be a place far beyond all bricks.
        for (auto& part : parts) hn::StoreU(set(part[0]), d, part + end);
        hn::StoreU(hn::Set(di, pixel[0]), di, pixel + end);
    }
    bool any() const { return next < end; }
};

// A vector of rays.
struct MarchLanes {
    Floats parts[kRayParts];
    Words pixel;
    Floats weight = hn::Zero(Lanes()), weighted = hn::Zero(Lanes()), which = hn::Zero(Lanes());  // not shaded yet
    Floats3 per_ray;
    BoxPart in_box[shader::kMostVolumes];
    Mask active;

    Floats3 ray() const { return {parts[kRayX], parts[kRayY], parts[kRayZ]}; }

    // Takes the next `count` rays that wait.
    HWY_INLINE MarchLanes(const MarchedScene& march, WaitingRays& waiting, std::size_t count)
        : pixel(hn::LoadU(hn::RebindToSigned<Lanes>(), waiting.pixel + waiting.next)), active(hn::FirstN(Lanes(), count)) {
        for (std::size_t n = 0; n < kRayParts; ++n) parts[n] = hn::LoadU(Lanes(), waiting.parts[n] + waiting.next);
        waiting.next += count;
        const Floats3 way = ray();
        per_ray = {inverse(way.x), inverse(way.y), inverse(way.z)};
        for (std::size_t v = 0; v < march.volumes.size(); ++v)
            in_box[v] = part_of(march, march.volumes[v], way, per_ray);
    }

    // Keeps where the first `count` rays have come to.
    void store(std::size_t count, MarchState& state, TileSums& sums) const {
        const Lanes d;
        HWY_ALIGN float out[kMargin + 1][WaitingRays::kMostLanes];
        HWY_ALIGN std::int32_t to[WaitingRays::kMostLanes];
        for (std::size_t n = kDistance; n <= kMargin; ++n) hn::Store(parts[n], d, out[n]);
        hn::Store(pixel, hn::RebindToSigned<Lanes>(), to);
        for (std::size_t i = 0; i < count; ++i) {
            const auto at = std::size_t(to[i]);
            state.distance[at] = out[kDistance][i];
            sums.transmittance[at] = out[kLeft][i];
            state.extinction[at] = out[kExtinction][i];
            state.step[at] = out[kWay][i];
            state.margin[at] = out[kMargin][i];
        }
    }
};

// Where points that were seen wait until there are many to be shaded.
struct MarchQueues {
    const ViewScene& scene;
    const TileRays& rays;
    TileSums& sums;
    MarchQueue of[shader::kMostVolumes];

    MarchQueues(const ViewScene& s, const TileRays& r, TileSums& t) : scene(s), rays(r), sums(t) {}
    void shade(std::size_t v) { shade_queue(scene, scene.march->volumes[v], rays, of[v], sums); }
    void shade_all() {
        for (std::size_t v = 0; v < scene.march->volumes.size(); ++v) shade(v);
    }
    HWY_INLINE void add(Mask asked, MarchLanes& lanes) {
        const Lanes d;
        const hn::RebindToSigned<Lanes> di;
        const std::size_t volumes = scene.march->volumes.size();
        const Floats mean = hn::Div(lanes.weighted, hn::Max(lanes.weight, set(1.0e-9f)));
        for (std::size_t v = 0; v < volumes; ++v) {
            const Mask in = volumes == 1 ? asked : hn::And(asked, hn::Eq(lanes.which, set(float(v))));
            if (hn::AllFalse(d, in)) continue;
            MarchQueue& queue = of[v];
            if (queue.count + 2 * hn::Lanes(d) > MarchQueue::kSize) shade(v);
            hn::CompressStore(mean, in, d, queue.distance + queue.count);
            hn::CompressStore(lanes.weight, in, d, queue.weight + queue.count);
            queue.count += hn::CompressStore(lanes.pixel, hn::RebindMask(di, in), di, queue.pixel + queue.count);
        }
        lanes.weight = hn::IfThenElse(asked, hn::Zero(d), lanes.weight);
        lanes.weighted = hn::IfThenElse(asked, hn::Zero(d), lanes.weighted);
    }
};

// Takes the next sample of each ray into account, and goes on behind it.
HWY_INLINE void advance(const MarchedScene& march, MarchLanes& lanes, MarchQueues& queues) {
    const Lanes d;
    const Floats zero = hn::Zero(d), one = set(1.0f);
    const Mask active = lanes.active;
    const Floats distance = lanes.parts[kDistance], extinction = lanes.parts[kExtinction], way = lanes.parts[kWay],
                 margin = lanes.parts[kMargin];
    Floats left = lanes.parts[kLeft];
    const MarchSample now = sample_volumes(march, lanes.ray(), lanes.per_ray, lanes.in_box, distance, left, active);
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
    const Mask ends = hn::And(active, hn::Le(left, lanes.parts[kEnd]));  // what little is left is seen here, too
    seen = hn::IfThenElse(ends, hn::Add(seen, left), seen);
    left = hn::IfThenElse(ends, zero, left);
    lanes.weight = hn::Add(lanes.weight, seen);
    lanes.weighted = hn::MulAdd(seen, hn::NegMulAdd(set(0.5f), length, distance), lanes.weighted);
    lanes.which = hn::IfThenElse(hn::Gt(found, zero), now.which, lanes.which);
    const Mask leaves = hn::And(hn::Gt(lanes.weight, set(shader::kLeavingOpacity)), hn::Le(found, zero));
    const Mask full = hn::And(active, hn::Or(hn::Gt(lanes.weight, set(shader::kEventOpacity)), hn::Or(leaves, ends)));
    if (!hn::AllFalse(d, full)) queues.add(full, lanes);
    lanes.parts[kLeft] = left;
    lanes.parts[kExtinction] = hn::IfThenElse(active, found, extinction);
    lanes.parts[kMargin] = hn::IfThenElse(active, hn::IfThenElse(now.near, now.margin, set(-1.0f)), margin);
    lanes.parts[kWay] = hn::IfThenElse(active, now.step, way);
    const Floats next = hn::Max(hn::Add(distance, now.step), hn::Mul(distance, set(shader::kLeastAdvance)));
    lanes.parts[kDistance] = hn::IfThenElse(active, next, distance);
}

// Marches the rays of a tile up to a distance from the eye.
inline void march_to(const ViewScene& scene, const TileRays& rays, float limit_m, MarchState& state,
                     TileSums& sums) {
    const Lanes d;
    if (state.done) return;
    if (!state.begun) begin_march(*scene.march, rays, state);
    if (limit_m <= state.next) return;
    WaitingRays waiting(rays, limit_m, state, sums);
    MarchQueues queues(scene, rays, sums);
    while (waiting.any()) {
        const std::size_t count = std::min(hn::Lanes(d), waiting.end - waiting.next);
        MarchLanes lanes(*scene.march, waiting, count);
        while (!hn::AllFalse(d, lanes.active)) {
            advance(*scene.march, lanes, queues);
            lanes.active = hn::And(lanes.active, hn::And(hn::Lt(lanes.parts[kDistance], lanes.parts[kStop]),
                                                         hn::Gt(lanes.parts[kLeft], lanes.parts[kEnd])));
        }
        const Mask rest = hn::Gt(lanes.weight, hn::Zero(d));
        if (!hn::AllFalse(d, rest)) queues.add(rest, lanes);
        lanes.store(count, state, sums);
    }
    queues.shade_all();
    state.find_next(sums.transmittance, sums.opaque);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
