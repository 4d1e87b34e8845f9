// SPDX-License-Identifier: Apache-2.0

// T's billboards in vectors: from one as the eye sees it to what is drawn of it, a vector of billboards at a
// time, and its pixels (render/blended/billboard.vert and billboard.frag).

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
#include <utility>

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/cpu/billboard_texels.h"
#include "render/cpu/screen_ball-inl.h"
#include "render/cpu/view_scene.h"
#include "render/frame/billboard_textures.h"
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
    HWY_ALIGN float sun_absorbed[kMaxLanes], flash_absorbed[kMaxLanes], opacity[kMaxLanes],
        cloud_x[kMaxLanes], cloud_y[kMaxLanes], cloud_z[kMaxLanes], base[kMaxLanes],
        inverse_height[kMaxLanes];

    BillboardColumns(std::span<const shader::ViewBillboard* const> billboards,
                     std::span<const shader::ViewCloud> clouds)
        : BillboardPlaces(billboards) {
        const std::size_t lanes = hn::Lanes(Lanes());
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            const shader::ViewBillboard& billboard = *billboards[std::min(lane, billboards.size() - 1)];
            const shader::ViewCloud& cloud = clouds[billboard.cloud];
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
    Floats3 light = add(billboard_diffuse(dot(set3(frame.to_sun), outwards), sunlight_at(frame, position.z),
                                          hn::Load(d, billboard.sun_absorbed)),
                        mix(set3(frame.ambient_base), set3(frame.ambient_top), {height, height, height}));
    if (frame.flash.w > 0) {
        const Floats3 way = subtract(set3(frame.flash), position);
        const Floats squared = dot(way, way);
        const Floats cosine = hn::Div(dot(way, outwards), hn::Sqrt(hn::Max(squared, set(1.0e-6f))));
        const Floats share = hn::Mul(set(frame.flash.w), flash_falloff(squared));
        light = times_add(
            share, billboard_diffuse(cosine, set3(frame.flash_colour), hn::Load(d, billboard.flash_absorbed)),
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
        Floats3 air = air_light(frame, ray, beta);
        if (frame.shells != nullptr) {
            const AirLayer layer =
                layer_in_front(frame, ray, shell_begins(frame.shells->data, distance), distance);
            air = times_add(layer.transmittance, air, layer.light);
            beta = times(layer.transmittance, beta);
        }
        const Floats opacity = hn::Load(d, billboard.opacity);
        const Floats3 share = times(opacity, beta);
        const auto corner = [&](float s, float t) {
            const Floats3 place = times_add(hn::Mul(set(s), reach_x), right.unit,
                                            times_add(hn::Mul(set(t), reach_y), up.unit, centre));
            return each_times(share, billboard_light_at(frame, billboard, place));
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

// Sums of products of pairs of 16-bit integers.
HWY_INLINE Words pairs_times(Words pairs, Words weights) {
    const hn::RebindToSigned<Lanes> di;
#if HWY_TARGET == HWY_SCALAR
    const Words low = hn::Set(di, 0xFFFF);
    return hn::Add(hn::Mul(hn::And(pairs, low), hn::And(weights, low)),
                   hn::Mul(hn::ShiftRight<16>(pairs), hn::ShiftRight<16>(weights)));
#else
    const hn::Repartition<std::int16_t, decltype(di)> d16;
    Words odd = hn::Zero(di);
    const Words even = hn::ReorderWidenMulAccumulate(di, hn::BitCast(d16, pairs), hn::BitCast(d16, weights),
                                                     hn::Zero(di), odd);
    return hn::RearrangeToOddPlusEven(even, odd);
#endif
}

// Maps points of a billboard to texture coordinates.
struct BillboardSampler {
    static constexpr int kWhole = 32767;             // of a weight of two columns
    static constexpr float kUnit = 255.0f * kWhole;  // of what sample() gives
    const std::int32_t* texels;
    int stride;
    float across, up;  // texels for s, and for t
    float middle, last;

    BillboardSampler(const BillboardTexels& all, std::uint32_t bits) {
        const std::uint32_t layer = bits & 255u, turn = bits >> 8 & 15u, level = bits >> 12;
        const int side = kBillboardTexels >> level;
        const std::uint32_t exchanged =
            (turn & 4u) != 0 ? std::uint32_t(kBillboardKinds * kBillboardVariants) : 0;
        stride = side + 2;
        texels = reinterpret_cast<const std::int32_t*>(all.texels.data()) + all.first[level] +
                 (layer + exchanged) * std::uint32_t(stride * stride);
        const float half = 0.5f * float(side);
        across = (turn & 1u) != 0 ? -half : half;
        up = (turn & 2u) != 0 ? half : -half;
        middle = half + 0.5f;  // one for the rim, half for the middle of a texel
        last = float(side) + 0.999f;
    }

    HWY_INLINE Floats place(float scale, Floats of) const {
        const Floats at = hn::MulAdd(set(scale), of, set(middle));
        return hn::Min(hn::Max(at, hn::Zero(Lanes())), set(last));
    }
};

// A column of points of a texture.
struct BillboardColumn {
    Floats column;  // of texels
    Words weights;  // of it and the next, 16 bits each

    BillboardColumn(const BillboardSampler& sampler, Floats s) {
        const hn::RebindToSigned<Lanes> di;
        const Floats u = sampler.place(sampler.across, s);
        column = hn::Floor(u);
        const auto next =
            hn::ConvertTo(di, hn::Mul(hn::Sub(u, column), set(float(BillboardSampler::kWhole))));
        weights = hn::Or(hn::ShiftLeft<16>(next), hn::Sub(hn::Set(di, BillboardSampler::kWhole), next));
    }
};

struct BillboardSample {
    Floats opacity, bright;  // 0..BillboardSampler::kUnit, as the texture has them
};

// Between the middles of four texels.
HWY_INLINE BillboardSample sample_billboard(const BillboardSampler& sampler, const BillboardColumn& column,
                                            Floats t) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    const Floats v = sampler.place(sampler.up, t), row = hn::Floor(v), share = hn::Sub(v, row);
    const auto index = hn::ConvertTo(di, hn::MulAdd(row, set(float(sampler.stride)), column.column));
    const Words upper = hn::GatherIndex(di, sampler.texels, index),
                lower = hn::GatherIndex(di, sampler.texels + sampler.stride, index);
    const auto between = [&](Words above, Words below) {
        const Words bytes = hn::Set(di, 0x00FF00FF);
        const Words a = pairs_times(hn::And(above, bytes), column.weights),
                    b = pairs_times(hn::And(below, bytes), column.weights);
        return hn::MulAdd(share, hn::ConvertTo(d, hn::Sub(b, a)), hn::ConvertTo(d, a));
    };
    return {between(upper, lower), between(hn::ShiftRight<8>(upper), hn::ShiftRight<8>(lower))};
}

// ScreenBillboard::light in floats.
struct BillboardColours {
    HWY_ALIGN float light[16];

    explicit BillboardColours(const ScreenBillboard& billboard) {
        const Lanes d;
        const hn::RebindToSigned<Lanes> di;
        const hn::Rebind<std::int16_t, Lanes> d16;
        const Floats step = set(std::bit_cast<float>(std::uint32_t(billboard.step) << 16));
        HWY_ALIGN std::int16_t steps[16];
        std::copy_n(billboard.light, std::size(billboard.light), steps);
        steps[15] = 0;
        for (std::size_t n = 0; n < std::size(light); n += hn::Lanes(d))
            hn::Store(hn::Mul(step, hn::ConvertTo(d, hn::PromoteTo(di, hn::Load(d16, steps + n)))), d,
                      light + n);
    }
    HWY_INLINE Floats operator()(std::size_t part, std::size_t channel) const {
        return set(light[3 * part + channel]);
    }
};

// sum += transmittance * (what the billboard adds); transmittance *= 1 - opacity
template <bool kColours>
HWY_INLINE void add_billboard(const ScreenBillboard& billboard, const Rows& rows, const ViewTile& tile,
                              const Layout& layout, const FirstPixels* first, const BillboardTexels& texels,
                              bool distances, TileSums& sums) {
    const Lanes d;
    const BillboardSampler sampler(texels, billboard.texture_bits);
    const BillboardColours light(billboard);
    const float down = float(layout.rows) * -billboard.per_half_height;
    for (std::size_t block = 0; block < layout.blocks; ++block) {
        const Floats dx = hn::Add(hn::Load(d, first[block].x), set(float(tile.x) - billboard.x));
        const Floats s = hn::Mul(dx, set(billboard.per_half_width));
        const BillboardColumn column(sampler, s);
        const Floats dy =
            hn::Add(hn::Load(d, first[block].y), set(float(tile.y) + float(rows.begin) - billboard.y));
        Floats t = hn::Mul(dy, set(-billboard.per_half_height));
        Floats3 beside{};
        if constexpr (kColours)
            beside = {hn::MulAdd(s, light(1, 0), light(0, 0)), hn::MulAdd(s, light(1, 1), light(0, 1)),
                      hn::MulAdd(s, light(1, 2), light(0, 2))};
        for (std::size_t row = rows.begin; row < rows.end; row += layout.rows, t = hn::Add(t, set(down))) {
            const std::size_t at = row * shader::kTileWidth + block * layout.lanes;
            const Floats before = hn::Load(d, sums.transmittance + at);
            const BillboardSample sample = sample_billboard(sampler, column, t);
            const Floats scaled = hn::Mul(before, set(1.0f / BillboardSampler::kUnit));
            const Floats part = hn::Mul(scaled, sample.opacity);
            hn::Store(hn::NegMulAdd(part, set(billboard.opacity), before), d, sums.transmittance + at);
            if constexpr (kColours) {
                const Floats bend = hn::Max(hn::Sub(t, s), hn::Zero(d)),
                             bright = hn::Mul(scaled, sample.bright);
                const auto channel = [&](std::size_t c, Floats of_s, float* to) {
                    const Floats radiance = hn::MulAdd(t, light(2, c), hn::MulAdd(bend, light(3, c), of_s));
                    const Floats sum = hn::MulAdd(bright, radiance, hn::Load(d, to + at));
                    hn::Store(hn::MulAdd(part, light(4, c), sum), d, to + at);
                };
                channel(0, beside.x, sums.red);
                channel(1, beside.y, sums.green);
                channel(2, beside.z, sums.blue);
                if (distances)
                    hn::Store(hn::MulAdd(part, set(-billboard.opacity * billboard.distance),
                                         hn::Load(d, sums.distance + at)),
                              d, sums.distance + at);
            }
        }
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
