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

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "density/detail-inl.h"
#include "render/frame/marched_scene.h"
#include "render/cpu/screen_ball-inl.h"
#include "render/cpu/tile_air-inl.h"
#include "render/cpu/view_scene.h"
#include "render/shading/background-inl.h"
#include "render/shading/scattering-inl.h"
#include "render/shading/shells-inl.h"
#include "render/shared/march.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

using Mask = hn::Mask<Lanes>;

// A place in the bricks of a volume.
struct BrickPlace {
    Floats3 brick, local;  // coordinates of the brick; nodes from its corner
    Words number;          // of the brick, or -n as in CoverageField::table()
    Mask within;           // the bricks' box
};

HWY_INLINE BrickPlace brick_place(const MarchedVolume& volume, const Floats3& offset_m) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    const DetailKernel& kernel = volume.kernel;
    const Floats per_node = set(1.0f / kernel.node_m), eighth = set(0.125f), zero = hn::Zero(d);
    BrickPlace place;
    const auto along = [&](Floats offset, Floats& brick, Floats& local) {
        const Floats nodes = hn::Mul(offset, per_node);
        brick = hn::Floor(hn::Mul(nodes, eighth));
        local = hn::NegMulAdd(brick, set(8.0f), nodes);
    };
    along(offset_m.x, place.brick.x, place.local.x);
    along(offset_m.y, place.brick.y, place.local.y);
    along(offset_m.z, place.brick.z, place.local.z);
    const auto inside = [&](Floats brick, int count) {
        return hn::And(hn::Ge(brick, zero), hn::Lt(brick, set(float(count))));
    };
    place.within = hn::And(inside(place.brick.x, kernel.bricks[0]),
                           hn::And(inside(place.brick.y, kernel.bricks[1]), inside(place.brick.z, kernel.bricks[2])));
    const auto index_of = [&](Floats brick) {
        return hn::ConvertTo(di, hn::IfThenElseZero(place.within, brick));
    };
    const auto row = hn::Add(hn::Mul(index_of(place.brick.z), hn::Set(di, kernel.bricks[1])), index_of(place.brick.y));
    const auto index = hn::Add(hn::Mul(row, hn::Set(di, kernel.bricks[0])), index_of(place.brick.x));
    place.number = hn::GatherIndex(di, kernel.table, index);
    return place;
}

HWY_INLINE erosion::Eroded density_at(const MarchedVolume& volume, const Floats3& offset_m, Floats footprint,
                                      Mask asked) {
    const hn::RebindToSigned<Lanes> di;
    const BrickPlace place = brick_place(volume, offset_m);
    asked = hn::And(asked, place.within);
    asked = hn::And(asked, hn::RebindMask(Lanes(), hn::Gt(place.number, hn::Set(di, -1))));
    const auto number = hn::Max(place.number, hn::Zero(di));
    const erosion::Node node =
        erosion::node_at(volume.kernel, number, place.local.x, place.local.y, place.local.z);
    return erosion::eroded(volume.kernel, node, offset_m.x, offset_m.y, offset_m.z, footprint, asked);
}

// Interpolates numbers of 16 bits at the corners of cells; `parts` turns a word of two of them, along x, into numbers.
template <class Parts>
HWY_INLINE auto light_at(const std::uint16_t* nodes, const BrickPlace& place, const Parts& parts) {
    const hn::RebindToSigned<Lanes> di;
    constexpr int kEdge = kLightNodes;
    const Floats half = set(0.5f), three = set(3.0f);
    const Floats x = hn::Mul(place.local.x, half), y = hn::Mul(place.local.y, half), z = hn::Mul(place.local.z, half);
    const Floats x0 = hn::Min(hn::Floor(x), three), y0 = hn::Min(hn::Floor(y), three), z0 = hn::Min(hn::Floor(z), three);
    const auto number = hn::Max(place.number, hn::Zero(di));
    const auto row = hn::Add(hn::Mul(hn::ConvertTo(di, z0), hn::Set(di, kEdge)), hn::ConvertTo(di, y0));
    const auto first = hn::ShiftLeft<1>(
        hn::Add(hn::Mul(number, hn::Set(di, int(kLightNodesOfBrick))),
                hn::Add(hn::Mul(row, hn::Set(di, kEdge)), hn::ConvertTo(di, x0))));
    const auto* base = reinterpret_cast<const std::int32_t*>(nodes);
    const auto word = [&](int offset) {
        return parts(hn::GatherOffset(di, base, hn::Add(first, hn::Set(di, 2 * offset))), hn::Sub(x, x0));
    };
    return std::array{word(0), word(kEdge), word(kEdge * kEdge), word(kEdge * kEdge + kEdge)};
}

HWY_INLINE Floats between_rows(Floats a, Floats b, Floats c, Floats e, const BrickPlace& place) {
    const auto rest = [](Floats local) {
        const Floats cells = hn::Mul(local, set(0.5f));
        return hn::Sub(cells, hn::Min(hn::Floor(cells), set(3.0f)));
    };
    const auto mixed = [](Floats low, Floats high, Floats weight) {
        return hn::MulAdd(weight, hn::Sub(high, low), low);
    };
    const Floats fy = rest(place.local.y);
    return mixed(mixed(a, b, fy), mixed(c, e, fy), rest(place.local.z));
}

HWY_INLINE Floats sun_depth_at(const MarchedVolume& volume, const BrickPlace& place) {
    const auto corners = light_at(volume.sun_depths, place, [](Words word, Floats fx) {
        const hn::RebindToSigned<Lanes> di;
        const Floats low = hn::ConvertTo(Lanes(), hn::And(word, hn::Set(di, 0xFFFF))),
                     high = hn::ConvertTo(Lanes(), hn::And(hn::ShiftRight<16>(word), hn::Set(di, 0xFFFF)));
        return hn::MulAdd(fx, hn::Sub(high, low), low);
    });
    const Floats root =
        hn::Mul(between_rows(corners[0], corners[1], corners[2], corners[3], place), set(1.0f / 65535.0f));
    return hn::Mul(hn::Mul(root, root), set(kMostMarchedDepth));
}

struct Surroundings {
    Floats sky, ground;
};

HWY_INLINE Surroundings surroundings_at(const MarchedVolume& volume, const BrickPlace& place) {
    const auto corners = light_at(volume.surroundings, place, [](Words word, Floats fx) {
        const auto along = [&](int low, int high) {
            const Floats a = byte_of(word, low), b = byte_of(word, high);
            return hn::MulAdd(fx, hn::Sub(b, a), a);
        };
        return Surroundings{along(0, 16), along(8, 24)};
    });
    const Floats unit = set(1.0f / 255.0f);
    return {hn::Mul(unit, between_rows(corners[0].sky, corners[1].sky, corners[2].sky, corners[3].sky, place)),
            hn::Mul(unit,
                    between_rows(corners[0].ground, corners[1].ground, corners[2].ground, corners[3].ground, place))};
}

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

// The light of points in a volume towards the eye. The sunlight that arrives is attenuated by three samples towards
// the sun, which see the detail, and beyond them by the volume's depths.
HWY_INLINE Floats3 marched_radiance(const ViewScene& scene, const MarchedVolume& volume, const Floats3& ray,
                                    Floats distance, Mask asked) {
    const Lanes d;
    const PictureFrame& frame = *scene.frame;
    const Floats footprint = hn::Mul(distance, set(scene.march->per_unit)), zero = hn::Zero(d);
    const Floats3 point = times(distance, ray), corner{set(volume.corner[0]), set(volume.corner[1]),
                                                       set(volume.corner[2])};
    const Floats3 offset = subtract(point, corner), to_sun = set3(frame.to_sun);
    constexpr float kTap_m[] = {shader::kTap0_m, shader::kTap1_m, shader::kTap2_m},
                    kTapLength_m[] = {shader::kTap0Length_m, shader::kTap1Length_m, shader::kTap2Length_m};
    Floats own = zero;
    for (std::size_t tap = 0; tap < 3; ++tap) {
        const Floats extinction =
            density_at(volume, times_add(set(kTap_m[tap]), to_sun, offset), footprint, asked).density;
        own = hn::MulAdd(set(kTapLength_m[tap] * volume.kernel.extinction_per_m), extinction, own);
    }
    BrickPlace beyond = brick_place(volume, times_add(set(shader::kTapsEnd_m), to_sun, offset));
    const Floats far = hn::IfThenElseZero(beyond.within, sun_depth_at(volume, beyond));
    const Floats sun_depth = hn::Add(own, far);
    const Surroundings seen = surroundings_at(volume, brick_place(volume, offset));
    const Floats fold = hn::MulAdd(
        set(shader::kFoldShare), fast_exp(hn::Mul(own, set(-shader::kFoldDecay))), set(1 - shader::kFoldShare));

    const Floats albedo = set(frame.ambient_top.w);
    const Floats3 sunlight = sunlight_at(frame, point.z);
    Floats3 arriving = times(hn::Mul(seen.sky, fold), set3(frame.ambient_top));
    arriving = times_add(hn::Mul(seen.ground, fold), set3(frame.ambient_base), arriving);
    arriving = times_add(scattered_often(frame, ray, sun_depth), sunlight, arriving);
    const Floats once = hn::Mul(scattered_once(frame, dot(to_sun, ray)), hn::Exp(d, hn::Neg(sun_depth)));
    arriving = times_add(once, sunlight, arriving);
    if (frame.flash.w > 0) {
        const Floats3 way = subtract(set3(frame.flash), point);
        const Floats falloff = hn::Mul(set(frame.flash.w), flash_falloff(dot(way, way)));
        arriving = times_add(hn::Mul(falloff, fold), set3(frame.flash_colour), arriving);
    }
    const Floats3 beta = air_transmittance(frame, ray, distance);
    Floats3 radiance = add(each_times(beta, times(albedo, arriving)), air_light(frame, ray, distance, beta));
    if (frame.shells != nullptr) {
        const AirLayer layer = layer_in_front(frame, ray, shell_begins(frame.shells->data, distance), distance);
        radiance = add(times(layer.transmittance, radiance), layer.light);
    }
    return radiance;
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

HWY_INLINE BoxPart part_in_box(const MarchedVolume& volume, const Floats3& per_ray) {
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

HWY_INLINE MarchSample sample_volumes(const MarchedScene& march, const Floats3& ray, const Floats3& per_ray,
                                      const BoxPart* parts, Floats distance, Floats transmittance, Mask active) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    const Floats zero = hn::Zero(d), one = set(1.0f);
    const Floats footprint = hn::Mul(distance, set(march.per_unit));
    const Floats finest = hn::Max(set(shader::kLeastStep_m), hn::Mul(set(shader::kStepPixels), footprint));
    const Floats least_step = hn::Mul(finest, hn::MulAdd(hn::Sub(one, transmittance), set(shader::kStepGrowth), one));
    MarchSample sample{zero, one, set(shader::kFarAway_m), zero, hn::Lt(one, zero)};
    for (std::size_t v = 0; v < march.volumes.size(); ++v) {
        const MarchedVolume& volume = march.volumes[v];
        const Floats3 corner{set(volume.corner[0]), set(volume.corner[1]), set(volume.corner[2])};
        const Floats3 offset = subtract(times(distance, ray), corner);
        const BrickPlace place = brick_place(volume, offset);
        const Mask before = hn::Lt(distance, parts[v].begin);
        // At the faces of the box rounding decides what is inside: there rays go on by a metre.
        const Floats beside = hn::IfThenElse(hn::Lt(distance, parts[v].end), one, set(shader::kFarAway_m));
        Floats step = hn::IfThenElse(before, hn::Add(hn::Sub(parts[v].begin, distance), set(shader::kBeyondFace_m)), beside);
        const Mask within = hn::And(place.within, active);
        const Mask holds = hn::And(within, hn::RebindMask(d, hn::Gt(place.number, hn::Set(di, -1))));
        // Cells of the brick, and how far away the next with cloud is.
        const Floats half = set(0.5f), three = set(3.0f);
        const auto cell_of = [&](Floats local) { return hn::Min(hn::Floor(hn::Mul(local, half)), three); };
        const Floats3 cell{cell_of(place.local.x), cell_of(place.local.y), cell_of(place.local.z)};
        const Floats in_brick = hn::MulAdd(hn::MulAdd(cell.z, set(4.0f), cell.y), set(4.0f), cell.x);
        const auto at = hn::Add(hn::ShiftLeft<6>(hn::Max(place.number, hn::Zero(di))), hn::ConvertTo(di, in_brick));
        const auto clear_word = hn::GatherOffset(
            di, reinterpret_cast<const std::int32_t*>(volume.kernel.clearance), at);
        const Floats clear = hn::ConvertTo(d, hn::And(clear_word, hn::Set(di, 255)));
        const Mask sampled = hn::And(holds, hn::Eq(clear, zero));
        // Out of the cube of empty bricks or cells around the place.
        const Floats count = hn::IfThenElse(holds, clear, hn::ConvertTo(d, hn::Neg(place.number)));
        const Floats size = hn::IfThenElse(holds, set(2 * volume.kernel.node_m), set(8 * volume.kernel.node_m));
        const auto way_out = [&](Floats brick, Floats of_cell, Floats offset_m, Floats per) {
            const Floats own = hn::IfThenElse(holds, hn::MulAdd(brick, set(4.0f), of_cell), brick);
            const Floats edge = hn::IfThenElse(hn::Gt(per, zero), hn::Add(own, count),
                                               hn::Sub(hn::Add(own, one), count));
            return hn::Mul(hn::MulSub(edge, size, offset_m), per);
        };
        const Floats out = hn::Min(way_out(place.brick.x, cell.x, offset.x, per_ray.x),
                                   hn::Min(way_out(place.brick.y, cell.y, offset.y, per_ray.y),
                                           way_out(place.brick.z, cell.z, offset.z, per_ray.z)));
        step = hn::IfThenElse(within, hn::Add(hn::Max(out, zero), set(shader::kBeyondFace_m)), step);
        if (!hn::AllFalse(d, sampled)) {
            const auto number = hn::Max(place.number, hn::Zero(di));
            const erosion::Node node =
                erosion::node_at(volume.kernel, number, place.local.x, place.local.y, place.local.z);
            const erosion::Eroded found = erosion::eroded<true>(volume.kernel, node, offset.x, offset.y, offset.z,
                                                          hn::Max(footprint, set(shader::kLeastFootprint_m)), sampled);
            const Floats extinction = hn::Mul(found.density, set(volume.kernel.extinction_per_m));
            sample.extinction = hn::Add(sample.extinction, extinction);
            sample.which = hn::IfThenElse(hn::Gt(extinction, zero), set(float(v)), sample.which);
            sample.margin = hn::IfThenElse(sampled, hn::Min(sample.margin, found.margin), sample.margin);
            const Floats towards = hn::Min(hn::Max(hn::Mul(found.margin, set(volume.reach)), least_step),
                                           hn::Max(set(shader::kLongestStep_m), least_step));
            step = hn::IfThenElse(sampled, towards, step);
            sample.near = hn::Or(sample.near, sampled);
        }
        sample.step = hn::Min(sample.step, step);
    }
    return sample;
}

inline void begin_march(const MarchedScene& march, const TileRays& rays, MarchState& state) {
    const Lanes d;
    for (std::size_t at = 0; at < kTilePixels; at += hn::Lanes(d)) {
        const Floats3 per_ray{inverse(hn::Load(d, rays.x + at)), inverse(hn::Load(d, rays.y + at)),
                              inverse(hn::Load(d, rays.z + at))};
        Floats first = set(std::numeric_limits<float>::max());
        for (const MarchedVolume& volume : march.volumes) {
            const BoxPart part = part_in_box(volume, per_ray);
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
        parts[v] = part_in_box(march.volumes[v], per_ray);
        end = hn::Max(end, hn::IfThenElseZero(hn::Lt(parts[v].begin, parts[v].end), parts[v].end));
    }
    end = hn::Min(end, hn::Min(hn::Load(d, rays.ground + at), set(march.fade_ends)));
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
        const Floats fade = hn::Div(hn::Sub(distance, set(march.fade_begins)),
                                    set(march.fade_ends - march.fade_begins));
        const Floats share = hn::Max(hn::Min(fade, one), zero);
        const Floats kept = hn::NegMulAdd(hn::Mul(share, share), hn::NegMulAdd(set(2.0f), share, set(3.0f)), one);
        const Floats found = hn::Mul(now.extinction, kept);
        // The step before counts as cloud; where it came from outside, only from the surface on: where the margin
        // of the two samples passes zero, or about one fine step where empty space was skipped.
        const Floats finest =
            hn::Max(set(shader::kLeastStep_m), hn::Mul(set(shader::kStepPixels * march.per_unit), distance));
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
