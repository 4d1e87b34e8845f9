// SPDX-License-Identifier: Apache-2.0

// Places in the bricks of clouds with detail, and the light that points in them send towards the eye, for vectors of
// points.

#if defined(NEPHOS_RENDER_MARCHED_LIGHT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_MARCHED_LIGHT_INL_H_
#undef NEPHOS_RENDER_MARCHED_LIGHT_INL_H_
#else
#define NEPHOS_RENDER_MARCHED_LIGHT_INL_H_
#endif

#include <array>
#include <cstddef>
#include <cstdint>

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "density/detail-inl.h"
#include "render/cpu/screen_ball-inl.h"
#include "render/cpu/view_scene.h"
#include "render/frame/marched_scene.h"
#include "render/shading/background-inl.h"
#include "render/shading/endless-inl.h"
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

HWY_INLINE Mask holds_cloud(const BrickPlace& place) {
    const hn::RebindToSigned<Lanes> di;
    return hn::And(place.within, hn::RebindMask(Lanes(), hn::Gt(place.number, hn::Set(di, -1))));
}

// `patches`: patches_at() there.
HWY_INLINE erosion::Eroded density_at(const MarchedVolume& volume, const Floats3& offset_m, Floats patches,
                                      Floats footprint, Mask asked) {
    const hn::RebindToSigned<Lanes> di;
    const BrickPlace place = brick_place(volume, offset_m);
    asked = hn::And(asked, holds_cloud(place));
    const auto number = hn::Max(place.number, hn::Zero(di));
    erosion::Node node = erosion::node_at(volume.kernel, number, place.local.x, place.local.y, place.local.z);
    if (volume.repeats) node.t = scaled_share(node.t, patches);
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

// The lower and the upper bytes of such numbers, 0..255.
struct TwoBytes {
    Floats low, high;
};

HWY_INLINE TwoBytes bytes_at(const std::uint16_t* nodes, const BrickPlace& place) {
    const auto corners = light_at(nodes, place, [](Words word, Floats fx) {
        const auto along = [&](int low, int high) {
            const Floats a = byte_of(word, low), b = byte_of(word, high);
            return hn::MulAdd(fx, hn::Sub(b, a), a);
        };
        return TwoBytes{along(0, 16), along(8, 24)};
    });
    return {between_rows(corners[0].low, corners[1].low, corners[2].low, corners[3].low, place),
            between_rows(corners[0].high, corners[1].high, corners[2].high, corners[3].high, place)};
}

// The sunlight that is scattered more than once towards the eye, of colour 1: by light that still travels nearly along
// the sun's, and by light that diffuses (render/cloud/diffusion.h). That is known at the lattice's scale; bumps and
// folds have more and less of it as their own depth differs from the lattice's.
HWY_INLINE Floats scattered_in_volume(const ViewScene& scene, const MarchedVolume& volume, const Floats3& ray,
                                      Floats sun_depth, const BrickPlace& here, Mask in_brick) {
    const hn::RebindToSigned<Lanes> di;
    const MarchedScene& march = *scene.march;
    const PictureFrame& frame = *scene.frame;
    if (!(march.diffuse > 0)) return scattered_often(frame, ray, sun_depth);
    const TwoBytes up = bytes_at(volume.upwards, here), side = bytes_at(volume.sideways, here);
    const Floats root = hn::Mul(up.low, set(1.0f / 255.0f)), unit = set(1.0f / 127.0f), none = set(128.0f / 127.0f);
    const Floats along = dot({hn::MulSub(side.low, unit, none), hn::MulSub(side.high, unit, none),
                              hn::MulSub(up.high, unit, none)},
                             ray);
    const Floats directed = hn::Max(hn::NegMulAdd(set(shader::diffuse_flux(march.mean_cosine)), along,
                                                  set(shader::kDiffuseBase)),
                                    hn::Zero(Lanes()));
    const Floats one = set(1.0f), decay = set(shader::kDiffuseDecay * (1 - march.mean_cosine));
    const Floats relief = hn::Div(hn::MulAdd(decay, sun_depth_at(volume, here), one), hn::MulAdd(decay, sun_depth, one));
    const Floats diffuse = hn::Mul(hn::Mul(hn::Mul(root, root), hn::Min(relief, set(shader::kMostRelief))),
                                   hn::Mul(directed, set(0.25f * shader::kMostFluence)));
    const Between column = scatter_column(dot(set3(frame.to_sun), ray));
    const Floats forwards = scattering_at(
        frame.scattering, hn::Set(di, int((1 + shader::kScatterDepths) * shader::kScatterAngles)), column);
    const Floats near = hn::Sub(fast_exp(hn::Mul(sun_depth, set(march.mean_cosine - 1))), fast_exp(hn::Neg(sun_depth)));
    return hn::Mul(set(march.diffuse),
                   hn::MulAdd(forwards, hn::Max(near, hn::Zero(Lanes())), hn::IfThenElseZero(in_brick, diffuse)));
}

// The light of points in a volume towards the eye. The sunlight that arrives is attenuated by three samples towards
// the sun, which see the detail, and beyond them by the volume's depths.
HWY_INLINE Floats3 marched_radiance(const ViewScene& scene, const MarchedVolume& volume, const Floats3& ray,
                                    Floats distance, Mask asked) {
    const Lanes d;
    const PictureFrame& frame = *scene.frame;
    const Floats footprint = hn::Mul(distance, set(scene.march->per_unit)), zero = hn::Zero(d);
    const Floats3 point = times(distance, ray), to_sun = set3(frame.to_sun);
    const PlaceIn place = place_in(volume, point);
    const Floats3& offset = place.offset;
    constexpr float kTap_m[] = {shader::kTap0_m, shader::kTap1_m, shader::kTap2_m},
                    kTapLength_m[] = {shader::kTap0Length_m, shader::kTap1Length_m, shader::kTap2Length_m};
    const Floats patches = patches_at(volume, place);
    Floats own = zero;
    for (std::size_t tap = 0; tap < 3; ++tap) {
        const Floats extinction =
            density_at(volume, times_add(set(kTap_m[tap]), to_sun, offset), patches, footprint, asked).density;
        own = hn::MulAdd(set(kTapLength_m[tap] * volume.kernel.extinction_per_m), extinction, own);
    }
    // Bricks without cloud have no depths: what is beyond them shows in those of the point itself.
    const BrickPlace here = brick_place(volume, offset),
                     beyond = brick_place(volume, times_add(set(shader::kTapsEnd_m), to_sun, offset));
    const Mask known = holds_cloud(beyond), in_brick = holds_cloud(here);
    Floats sun_depth = hn::MulAdd(patches, sun_depth_at(volume, beyond), own);
    if (!hn::AllTrue(d, known)) {
        const Floats depth_here = hn::IfThenElseZero(in_brick, hn::Mul(patches, sun_depth_at(volume, here)));
        sun_depth = hn::IfThenElse(known, sun_depth, hn::Max(own, depth_here));
    }
    const TwoBytes seen = bytes_at(volume.surroundings, here);
    const Floats unit = set(1.0f / 255.0f), sky = hn::IfThenElse(in_brick, hn::Mul(unit, seen.low), set(1.0f)),
                 ground_seen = hn::IfThenElse(in_brick, hn::Mul(unit, seen.high), set(1.0f));
    const Floats albedo = set(frame.ambient_top.w);
    const Floats3 sunlight = sunlight_at(frame, above_plane(point, volume.bend).z);
    Floats3 arriving = times(sky, set3(frame.ambient_top));
    arriving = times_add(ground_seen, set3(frame.ambient_base), arriving);
    arriving = times_add(scattered_in_volume(scene, volume, ray, sun_depth, here, in_brick), sunlight, arriving);
    const Floats3 once = times(hn::Exp(d, hn::Neg(sun_depth)), scattered_once(frame, dot(to_sun, ray)));
    arriving = each_times_add(once, sunlight, arriving);
    if (frame.flash.w > 0) {
        const Floats3 way = subtract(set3(frame.flash), point);
        const Floats falloff = hn::Mul(set(frame.flash.w), flash_falloff(dot(way, way)));
        arriving = times_add(falloff, set3(frame.flash_colour), arriving);
    }
    const Floats3 beta = air_transmittance(frame, ray, distance);
    Floats3 radiance = add(each_times(beta, times(albedo, arriving)), air_light(frame, ray, distance, beta));
    if (frame.shells != nullptr) {
        const AirLayer layer = layer_in_front(frame, ray, shell_begins(frame.shells->data, distance), distance);
        radiance = add(times(layer.transmittance, radiance), layer.light);
    }
    return radiance;
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
