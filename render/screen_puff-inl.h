// SPDX-License-Identifier: Apache-2.0

// T's billboards in vectors: from one as the eye sees it to what is drawn of it, a vector of billboards at a
// time, and its pixels (shaders/puff.vert and puff.frag).

#if defined(NEPHOS_RENDER_SCREEN_PUFF_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_SCREEN_PUFF_INL_H_
#undef NEPHOS_RENDER_SCREEN_PUFF_INL_H_
#else
#define NEPHOS_RENDER_SCREEN_PUFF_INL_H_
#endif

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/background-inl.h"
#include "render/half_floats.h"
#include "render/puff_texels.h"
#include "render/puff_textures.h"
#include "render/view_scene.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

inline constexpr std::size_t kMostLanes = 2 * shader::kTileWidth;

// Billboards of one vector and their clouds, turned from rows into columns.
struct PuffColumns {
    HWY_ALIGN float x[kMostLanes], y[kMostLanes], z[kMostLanes], half_width[kMostLanes],
        half_height[kMostLanes], sun_absorbed[kMostLanes], flash_absorbed[kMostLanes], opacity[kMostLanes],
        cloud_x[kMostLanes], cloud_y[kMostLanes], cloud_z[kMostLanes], base[kMostLanes],
        inverse_height[kMostLanes];

    PuffColumns(std::span<const shader::Puff> puffs, std::span<const shader::PuffCloud> clouds) {
        const std::size_t lanes = hn::Lanes(Lanes());
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            const shader::Puff& puff = puffs[std::min(lane, puffs.size() - 1)];
            const shader::PuffCloud& cloud = clouds[puff.cloud];
            x[lane] = puff.x;
            y[lane] = puff.y;
            z[lane] = puff.z;
            const auto [across, up] = unpack_halves(puff.half_size);
            half_width[lane] = across;
            half_height[lane] = up;
            sun_absorbed[lane] = float(puff.absorbed & 0xffffu) * (1.0f / 65535.0f);
            flash_absorbed[lane] = float(puff.absorbed >> 16) * (1.0f / 65535.0f);
            opacity[lane] = puff.opacity;
            cloud_x[lane] = cloud.x;
            cloud_y[lane] = cloud.y;
            cloud_z[lane] = cloud.z;
            base[lane] = cloud.base;
            inverse_height[lane] = cloud.inverse_height;
        }
    }
};

// T: clamp(dot(towards the light, outwards from the cloud) * colour - absorbed, 0, 1).
HWY_INLINE Floats3 puff_diffuse(Floats cosine, const Floats3& colour, Floats absorbed) {
    const Floats zero = hn::Zero(Lanes()), one = set(1.0f);
    const auto channel = [&](Floats of) {
        return hn::Min(hn::Max(hn::MulSub(cosine, of, absorbed), zero), one);
    };
    return {channel(colour.x), channel(colour.y), channel(colour.z)};
}

HWY_INLINE Floats3 puff_light_at(const PictureFrame& frame, const PuffColumns& puff,
                                 const Floats3& position) {
    const Lanes d;
    const Floats one = set(1.0f);
    const Floats3 offset =
        subtract(position, {hn::Load(d, puff.cloud_x), hn::Load(d, puff.cloud_y), hn::Load(d, puff.cloud_z)});
    const Floats3 outwards =
        times(hn::Div(one, hn::Max(hn::Sqrt(dot(offset, offset)), set(1.0e-6f))), offset);
    const Floats above =
        hn::Mul(hn::Sub(position.z, hn::Load(d, puff.base)), hn::Load(d, puff.inverse_height));
    const Floats height = hn::Min(hn::Max(above, hn::Zero(d)), one);
    Floats3 light = add(puff_diffuse(dot(set3(frame.to_sun), outwards), sunlight_at(frame, position.z),
                                     hn::Load(d, puff.sun_absorbed)),
                        mix(set3(frame.ambient_base), set3(frame.ambient_top), {height, height, height}));
    if (frame.flash.w > 0) {
        const Floats3 way = subtract(set3(frame.flash), position);
        const Floats squared = dot(way, way);
        const Floats cosine = hn::Div(dot(way, outwards), hn::Sqrt(hn::Max(squared, set(1.0e-6f))));
        const Floats share = hn::Mul(set(frame.flash.w), flash_falloff(squared));
        light = times_add(
            share, puff_diffuse(cosine, set3(frame.flash_colour), hn::Load(d, puff.flash_absorbed)), light);
    }
    return times(set(frame.ambient_top.w), light);
}

// Everything of a vector of billboards that is a matter of their places and their light; columns of floats in
// the order of ScreenPuff.
struct PuffFields {
    HWY_ALIGN float x[kMostLanes], y[kMostLanes], per_half_width[kMostLanes], per_half_height[kMostLanes],
        light[12][kMostLanes], air[3][kMostLanes], distance[kMostLanes];
};

inline void compute_puffs(const PictureFrame& frame, const PuffColumns& puff, PuffFields& out) {
    const Lanes d;
    const Floats one = set(1.0f), opacity = hn::Load(d, puff.opacity);
    const Floats3 centre{hn::Load(d, puff.x), hn::Load(d, puff.y), hn::Load(d, puff.z)};
    const auto axis = [&](const shader::vec4& of) {  // unit, and 1 / its length
        const Floats per = hn::Div(one, hn::Sqrt(dot(set3(of), set3(of))));
        return std::pair(times(per, set3(of)), per);
    };
    const auto [right, per_right] = axis(frame.right);
    const auto [up, per_up] = axis(frame.up);
    const Floats per_depth = hn::Div(one, dot(set3(frame.forward), centre));
    const Floats half_width = set(0.5f * frame.picture.x), half_height = set(0.5f * frame.picture.y);
    const Floats to_x = hn::Mul(hn::Mul(per_right, per_depth), half_width),
                 to_y = hn::Mul(hn::Mul(per_up, per_depth), half_height);
    hn::Store(hn::Sub(hn::MulAdd(dot(right, centre), to_x, half_width), set(frame.picture.z)), d, out.x);
    hn::Store(hn::Sub(hn::NegMulAdd(dot(up, centre), to_y, half_height), set(frame.picture.w)), d, out.y);
    const Floats reach_x = hn::Load(d, puff.half_width), reach_y = hn::Load(d, puff.half_height);
    hn::Store(hn::Div(one, hn::Mul(reach_x, to_x)), d, out.per_half_width);
    hn::Store(hn::Div(one, hn::Mul(reach_y, to_y)), d, out.per_half_height);

    const Floats distance = hn::Sqrt(dot(centre, centre));
    hn::Store(distance, d, out.distance);
    const Floats3 ray = times(hn::Div(one, hn::Max(distance, set(1.0e-6f))), centre);
    const Floats3 beta = air_transmittance(frame, ray, distance);
    const Floats3 air = times(opacity, air_light(frame, ray, beta)), share = times(opacity, beta);
    const auto corner = [&](float s, float t) {
        const Floats3 place =
            times_add(hn::Mul(set(s), reach_x), right, times_add(hn::Mul(set(t), reach_y), up, centre));
        return each_times(share, puff_light_at(frame, puff, place));
    };
    const Floats3 low = corner(-1, -1), beside = corner(1, -1), high = corner(1, 1), above = corner(-1, 1);
    const Floats half = set(0.5f);
    const Floats3 parts[] = {times(half, add(low, high)), times(half, subtract(beside, low)),
                             times(half, subtract(high, beside)),
                             times(half, add(subtract(above, low), subtract(beside, high)))};
    for (std::size_t n = 0; n < 4; ++n) {
        hn::Store(parts[n].x, d, out.light[3 * n]);
        hn::Store(parts[n].y, d, out.light[3 * n + 1]);
        hn::Store(parts[n].z, d, out.light[3 * n + 2]);
    }
    hn::Store(air.x, d, out.air[0]);
    hn::Store(air.y, d, out.air[1]);
    hn::Store(air.z, d, out.air[2]);
}

// Where the texture lies: mirrored, and the axes exchanged, as the bits of `turn` say (puff.vert).
inline void place_texture(shader::uint bits, ScreenPuff& puff) {
    const shader::uint layer = bits & 255u, turn = bits >> 8 & 15u, level = bits >> 12;
    puff.side = std::uint32_t(kPuffTexels) >> level;
    puff.texels = puff_texels().first[level] + layer * (puff.side + 2) * (puff.side + 2);
    const float half = 0.5f * float(puff.side);
    float* const of_s = (turn & 4u) != 0 ? puff.v : puff.u;
    float* const of_t = (turn & 4u) != 0 ? puff.u : puff.v;
    of_s[0] = of_t[0] = half + 0.5f;  // one for the rim, half for the middle of a texel
    of_s[1] = (turn & 1u) != 0 ? -half : half;
    of_s[2] = 0;
    of_t[1] = 0;
    of_t[2] = (turn & 2u) != 0 ? half : -half;
}

inline void shape_puffs(std::span<const shader::Puff> puffs, std::span<const shader::PuffCloud> clouds,
                        const PictureFrame& frame, ScreenPuff* out) {
    const std::size_t lanes = hn::Lanes(Lanes());
    for (std::size_t begin = 0; begin < puffs.size(); begin += lanes) {
        const auto some = puffs.subspan(begin, std::min(lanes, puffs.size() - begin));
        PuffFields fields;
        compute_puffs(frame, PuffColumns(some, clouds), fields);
        for (std::size_t i = 0; i < some.size(); ++i) {
            ScreenPuff& to = out[begin + i];
            to.x = fields.x[i];
            to.y = fields.y[i];
            to.per_half_width = fields.per_half_width[i];
            to.per_half_height = fields.per_half_height[i];
            for (std::size_t n = 0; n < 12; ++n) to.light[n / 3][n % 3] = fields.light[n][i];
            for (std::size_t c = 0; c < 3; ++c) to.air[c] = fields.air[c][i];
            to.opacity = some[i].opacity;
            to.distance = fields.distance[i];
            place_texture(some[i].texture_bits, to);
        }
    }
}

struct PuffSample {
    Floats opacity, bright;  // 0..1, as the texture has them
};

// Between the middles of four texels.
HWY_INLINE PuffSample sample_puff(const ScreenPuff& puff, const std::uint32_t* texels, Floats s, Floats t) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    const Floats zero = hn::Zero(d), most = set(float(puff.side) + 0.999f);
    const auto place = [&](const float* of) {
        return hn::Min(hn::Max(hn::MulAdd(set(of[1]), s, hn::MulAdd(set(of[2]), t, set(of[0]))), zero), most);
    };
    const Floats u = place(puff.u), v = place(puff.v);
    const Floats column = hn::Floor(u), row = hn::Floor(v);
    const int stride = int(puff.side) + 2;
    const auto index =
        hn::Add(hn::Mul(hn::ConvertTo(di, row), hn::Set(di, stride)), hn::ConvertTo(di, column));
    const auto* const base = reinterpret_cast<const std::int32_t*>(texels) + puff.texels;
    const auto upper = hn::GatherIndex(di, base, index),
               lower = hn::GatherIndex(di, base, hn::Add(index, hn::Set(di, stride)));
    const Floats share_u = hn::Sub(u, column), share_v = hn::Sub(v, row);
    const auto channel = [&](auto words, auto next) {
        const auto byte = hn::Set(di, 255);
        const Floats a = hn::ConvertTo(d, hn::And(words, byte)), b = hn::ConvertTo(d, hn::And(next, byte));
        return hn::MulAdd(share_u, hn::Sub(b, a), a);
    };
    const auto between = [&](Floats a, Floats b) {
        return hn::Mul(hn::MulAdd(share_v, hn::Sub(b, a), a), set(1.0f / 255.0f));
    };
    return {between(channel(upper, hn::ShiftRight<16>(upper)), channel(lower, hn::ShiftRight<16>(lower))),
            between(channel(hn::ShiftRight<8>(upper), hn::ShiftRight<24>(upper)),
                    channel(hn::ShiftRight<8>(lower), hn::ShiftRight<24>(lower)))};
}

// sum += transmittance * (what the billboard adds); transmittance *= 1 - opacity
template <bool kColours>
void add_puff(const ScreenPuff& puff, const Rows& rows, const ViewTile& tile, const Layout& layout,
              const FirstPixels* first, TileSums& sums) {
    const Lanes d;
    const std::uint32_t* const texels = puff_texels().texels.data();
    for (std::size_t block = 0; block < layout.blocks; ++block) {
        const Floats dx = hn::Add(hn::Load(d, first[block].x), set(float(tile.x) - puff.x));
        const Floats s = hn::Mul(dx, set(puff.per_half_width));
        for (std::size_t row = rows.begin; row < rows.end; row += layout.rows) {
            const std::size_t at = row * shader::kTileWidth + block * layout.lanes;
            const Floats before = hn::Load(d, sums.transmittance + at);
            const Floats dy = hn::Add(hn::Load(d, first[block].y), set(float(tile.y) + float(row) - puff.y));
            const Floats t = hn::Mul(dy, set(-puff.per_half_height));
            const PuffSample sample = sample_puff(puff, texels, s, t);
            const Floats part = hn::Mul(before, hn::Mul(sample.opacity, set(puff.opacity)));
            hn::Store(hn::Sub(before, part), d, sums.transmittance + at);
            if constexpr (kColours) {
                const Floats bend = hn::Max(hn::Sub(t, s), hn::Zero(d));
                const Floats bright = hn::Mul(before, sample.bright), thin = hn::Mul(before, sample.opacity);
                const auto channel = [&](std::size_t c, float* to) {
                    const Floats light = hn::MulAdd(
                        s, set(puff.light[1][c]),
                        hn::MulAdd(t, set(puff.light[2][c]),
                                   hn::MulAdd(bend, set(puff.light[3][c]), set(puff.light[0][c]))));
                    const Floats sum = hn::MulAdd(bright, light, hn::Load(d, to + at));
                    hn::Store(hn::MulAdd(thin, set(puff.air[c]), sum), d, to + at);
                };
                channel(0, sums.red);
                channel(1, sums.green);
                channel(2, sums.blue);
                hn::Store(hn::MulAdd(part, set(puff.distance), hn::Load(d, sums.distance + at)), d,
                          sums.distance + at);
            }
        }
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
