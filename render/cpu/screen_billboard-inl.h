// SPDX-License-Identifier: Apache-2.0

// T's billboards in vectors, a vector of billboards at a time: their rectangles on the screen and their light
// (render/blended/billboard.vert). billboard_pixels-inl.h draws them.

#if defined(NEPHOS_RENDER_SCREEN_BILLBOARD_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_SCREEN_BILLBOARD_INL_H_
#undef NEPHOS_RENDER_SCREEN_BILLBOARD_INL_H_
#else
#define NEPHOS_RENDER_SCREEN_BILLBOARD_INL_H_
#endif

#include <algorithm>
#include <bit>
#include <cstdint>
#include <iterator>
#include <span>

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/cpu/screen_ball-inl.h"
#include "render/cpu/view_scene.h"
#include "render/shading/background-inl.h"
#include "render/shared/half_floats.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// Positions of a vector of billboards, transposed from rows to columns.
struct BillboardPlaces {
    HWY_ALIGN float x[kMaxLanes], y[kMaxLanes], z[kMaxLanes], half_width[kMaxLanes], half_height[kMaxLanes];

    explicit BillboardPlaces(std::span<const shader::ViewBillboard* const> billboards) {
        const std::size_t lanes = hn::Lanes(Lanes());
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            const shader::ViewBillboard& billboard = *billboards[std::min(lane, billboards.size() - 1)];
            x[lane] = billboard.x;
            y[lane] = billboard.y;
            z[lane] = billboard.z;
            const auto [across, up] = unpack_halves(billboard.half_size);
            half_width[lane] = across;
            half_height[lane] = up;
        }
    }
};

// Their light.
struct BillboardColumns : BillboardPlaces {
    HWY_ALIGN float arrives[kMaxLanes], sun_absorbed[kMaxLanes], flash_absorbed[kMaxLanes], opacity[kMaxLanes],
        cloud_x[kMaxLanes], cloud_y[kMaxLanes], cloud_z[kMaxLanes], base[kMaxLanes],
        inverse_height[kMaxLanes];

    BillboardColumns(std::span<const shader::ViewBillboard* const> billboards,
                     std::span<const shader::ViewCloud> clouds)
        : BillboardPlaces(billboards) {
        const std::size_t lanes = hn::Lanes(Lanes());
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            const shader::ViewBillboard& billboard = *billboards[std::min(lane, billboards.size() - 1)];
            const shader::ViewCloud& cloud = clouds[billboard.cloud];
            arrives[lane] = float(billboard.texture_bits >> 16) / 65535.0f;
            sun_absorbed[lane] = float(billboard.absorbed & 0xffffu) * (1.0f / 65535.0f);
            flash_absorbed[lane] = float(billboard.absorbed >> 16) * (1.0f / 65535.0f);
            opacity[lane] = billboard.opacity;
            cloud_x[lane] = cloud.x;
            cloud_y[lane] = cloud.y;
            cloud_z[lane] = cloud.z;
            base[lane] = cloud.base;
            inverse_height[lane] = cloud.inverse_height;
        }
    }
};

// T: clamp(dot(towards the light, outwards from the cloud) * colour - absorbed, 0, 1).
HWY_INLINE Floats3 billboard_diffuse(Floats cosine, const Floats3& colour, Floats absorbed) {
    const Floats zero = hn::Zero(Lanes()), one = set(1.0f);
    const auto channel = [&](Floats of) {
        return hn::Min(hn::Max(hn::MulSub(cosine, of, absorbed), zero), one);
    };
    return {channel(colour.x), channel(colour.y), channel(colour.z)};
}

HWY_INLINE Floats3 billboard_light_at(const PictureFrame& frame, const BillboardColumns& billboard,
                                      const Floats3& position) {
    const Lanes d;
    const Floats one = set(1.0f);
    const Floats3 offset = subtract(position, {hn::Load(d, billboard.cloud_x), hn::Load(d, billboard.cloud_y),
                                               hn::Load(d, billboard.cloud_z)});
    const Floats3 outwards =
        times(hn::Div(one, hn::Max(hn::Sqrt(dot(offset, offset)), set(1.0e-6f))), offset);
    const Floats above =
        hn::Mul(hn::Sub(position.z, hn::Load(d, billboard.base)), hn::Load(d, billboard.inverse_height));
    const Floats height = hn::Min(hn::Max(above, hn::Zero(d)), one);
    const Floats3 of_sun = billboard_diffuse(dot(set3(frame.to_sun), outwards), sunlight_at(frame, position.z),
                                             hn::Load(d, billboard.sun_absorbed));
    Floats3 light = add(times(hn::Load(d, billboard.arrives), of_sun),
                        mix(set3(frame.ambient_base), set3(frame.ambient_top), {height, height, height}));
    if (frame.flash.w > 0) {
        const Floats3 way = subtract(set3(frame.flash), position);
        const Floats squared = dot(way, way);
        const Floats cosine = hn::Div(dot(way, outwards), hn::Sqrt(hn::Max(squared, set(1.0e-6f))));
        const Floats fraction = hn::Mul(set(frame.flash.w), flash_falloff(squared));
        light = times_add(
            fraction,
            billboard_diffuse(cosine, set3(frame.flash_colour), hn::Load(d, billboard.flash_absorbed)),
            light);
    }
    return times(set(frame.ambient_top.w), light);
}

// Unit vector along an axis of the picture, and 1 / the axis' length.
struct Axis {
    Floats3 unit;
    Floats per;
    explicit Axis(const shader::vec4& of)
        : unit(set3(of)), per(hn::Div(set(1.0f), hn::Sqrt(dot(set3(of), set3(of))))) {
        unit = times(per, unit);
    }
};

// The rectangles of some billboards: `screen` has one for each of `billboards`.
inline void shape_billboards(std::span<const shader::ViewBillboard* const> billboards,
                             const PictureFrame& frame, ScreenBall* const* screen) {
    const Lanes d;
    const std::size_t lanes = hn::Lanes(d);
    const Axis right(frame.right), up(frame.up);
    const Floats one = set(1.0f), half_width = set(0.5f * frame.picture.x),
                 half_height = set(0.5f * frame.picture.y);
    for (std::size_t begin = 0; begin < billboards.size(); begin += lanes) {
        const auto some = billboards.subspan(begin, std::min(lanes, billboards.size() - begin));
        const BillboardPlaces billboard(some);
        const Floats3 centre{hn::Load(d, billboard.x), hn::Load(d, billboard.y), hn::Load(d, billboard.z)};
        const Floats per_depth = hn::Div(one, dot(set3(frame.forward), centre));
        const Floats to_x = hn::Mul(hn::Mul(right.per, per_depth), half_width),
                     to_y = hn::Mul(hn::Mul(up.per, per_depth), half_height);
        HWY_ALIGN float field[5][kMaxLanes];
        const Floats fields[] = {
            hn::Sub(hn::MulAdd(dot(right.unit, centre), to_x, half_width), set(frame.picture.z)),
            hn::Sub(hn::NegMulAdd(dot(up.unit, centre), to_y, half_height), set(frame.picture.w)),
            hn::Div(one, hn::Mul(hn::Load(d, billboard.half_width), to_x)),
            hn::Div(one, hn::Mul(hn::Load(d, billboard.half_height), to_y)), hn::Sqrt(dot(centre, centre))};
        for (std::size_t n = 0; n < std::size(fields); ++n) hn::Store(fields[n], d, field[n]);
        for (std::size_t i = 0; i < some.size(); ++i) {
            const ScreenBillboard shaped{.x = field[0][i],
                                         .y = field[1][i],
                                         .per_half_width = field[2][i],
                                         .per_half_height = field[3][i],
                                         .light = {},
                                         .step = 0,
                                         .opacity = some[i]->opacity,
                                         .texture_bits = some[i]->texture_bits,
                                         .distance = -std::max(field[4][i], 1.0e-6f),
                                         .first = 0,
                                         .end = 0};
            *screen[begin + i] = std::bit_cast<ScreenBall>(shaped);
        }
    }
}

// Columns of ScreenBillboard::light and step.
struct BillboardLight {
    HWY_ALIGN std::int16_t columns[15][kMaxLanes];
    HWY_ALIGN std::int32_t steps[kMaxLanes];

    BillboardLight(const PictureFrame& frame, const BillboardColumns& billboard) {
        const Lanes d;
        const Floats one = set(1.0f), half = set(0.5f);
        const Axis right(frame.right), up(frame.up);
        const Floats3 centre{hn::Load(d, billboard.x), hn::Load(d, billboard.y), hn::Load(d, billboard.z)};
        const Floats reach_x = hn::Load(d, billboard.half_width),
                     reach_y = hn::Load(d, billboard.half_height);
        const Floats distance = hn::Sqrt(dot(centre, centre));
        const Floats3 ray = times(hn::Div(one, hn::Max(distance, set(1.0e-6f))), centre);
        Floats3 beta = air_transmittance(frame, ray, distance);
        Floats3 air = air_light(frame, ray, distance, beta);
        if (frame.shells != nullptr) {
            const AirLayer layer =
                layer_in_front(frame, ray, shell_begins(frame.shells->data, distance), distance);
            air = times_add(layer.transmittance, air, layer.light);
            beta = times(layer.transmittance, beta);
        }
        const Floats opacity = hn::Load(d, billboard.opacity);
        const Floats3 fraction = times(opacity, beta);
        const auto corner = [&](float s, float t) {
            const Floats3 place = times_add(hn::Mul(set(s), reach_x), right.unit,
                                            times_add(hn::Mul(set(t), reach_y), up.unit, centre));
            return each_times(fraction, billboard_light_at(frame, billboard, place));
        };
        const Floats3 low = corner(-1, -1), beside = corner(1, -1), high = corner(1, 1),
                      above = corner(-1, 1);
        const Floats3 parts[] = {times(half, add(low, high)), times(half, subtract(beside, low)),
                                 times(half, subtract(high, beside)),
                                 times(half, add(subtract(above, low), subtract(beside, high))),
                                 times(opacity, air)};
        store({parts[0].x, parts[0].y, parts[0].z, parts[1].x, parts[1].y, parts[1].z, parts[2].x, parts[2].y,
               parts[2].z, parts[3].x, parts[3].y, parts[3].z, parts[4].x, parts[4].y, parts[4].z});
    }

  private:
    // The largest of a billboard's values takes 15 bits.
    void store(const Floats (&values)[15]) {
        const Lanes d;
        const hn::RebindToSigned<Lanes> di;
        const hn::Rebind<std::int16_t, Lanes> d16;
        Floats most = set(1.0e-30f);
        for (const Floats value : values) most = hn::Max(most, hn::Abs(value));
        const auto exponent = hn::ShiftRight<23>(hn::BitCast(di, most));
        hn::Store(hn::ShiftLeft<7>(hn::Sub(exponent, hn::Set(di, 14))), di, steps);
        const Floats per_step =
            hn::BitCast(d, hn::ShiftLeft<23>(hn::Sub(hn::Set(di, 2 * 127 + 14), exponent)));
        for (std::size_t n = 0; n < std::size(values); ++n)
            hn::Store(hn::DemoteTo(d16, hn::NearestInt(hn::Mul(values[n], per_step))), d16, columns[n]);
    }
};

// The light of some billboards that have their shapes: `screen` has one for each of `billboards`.
inline void light_billboards(std::span<const shader::ViewBillboard* const> billboards,
                             std::span<const shader::ViewCloud> clouds, const PictureFrame& frame,
                             ScreenBall* const* screen) {
    const std::size_t lanes = hn::Lanes(Lanes());
    for (std::size_t begin = 0; begin < billboards.size(); begin += lanes) {
        const auto some = billboards.subspan(begin, std::min(lanes, billboards.size() - begin));
        const BillboardLight light(frame, BillboardColumns(some, clouds));
        for (std::size_t i = 0; i < some.size(); ++i) {
            auto lit = std::bit_cast<ScreenBillboard>(*screen[begin + i]);
            for (std::size_t n = 0; n < 15; ++n) lit.light[n] = light.columns[n][i];
            lit.step = std::uint16_t(light.steps[i]);
            *screen[begin + i] = std::bit_cast<ScreenBall>(lit);
        }
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
