// SPDX-License-Identifier: Apache-2.0

// The pixels of T's billboards in vectors: texture look-ups and compositing (render/blended/billboard.frag).

#if defined(NEPHOS_RENDER_BILLBOARD_PIXELS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_BILLBOARD_PIXELS_INL_H_
#undef NEPHOS_RENDER_BILLBOARD_PIXELS_INL_H_
#else
#define NEPHOS_RENDER_BILLBOARD_PIXELS_INL_H_
#endif

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <iterator>

#include <hwy/highway.h>

#include "render/frame/billboard_textures.h"
#include "render/cpu/screen_ball.h"
#include "render/cpu/view_scene.h"
#include "render/frame/billboard_textures.h"
#include "render/shading/floats3-inl.h"
#include "render/shading/formulas-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

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
        const std::uint32_t layer = bits & 255u, turn = bits >> 8 & 15u, level = bits >> 12 & 15u;
        const int side = kBillboardTexels >> level;
        const std::uint32_t exchanged = (turn & 4u) != 0 ? all.layers : 0;
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
    const Floats v = sampler.place(sampler.up, t), row = hn::Floor(v), fraction = hn::Sub(v, row);
    const auto index = hn::ConvertTo(di, hn::MulAdd(row, set(float(sampler.stride)), column.column));
    const Words upper = hn::GatherIndex(di, sampler.texels, index),
                lower = hn::GatherIndex(di, sampler.texels + sampler.stride, index);
    const auto between = [&](Words above, Words below) {
        const Words bytes = hn::Set(di, 0x00FF00FF);
        const Words a = pairs_times(hn::And(above, bytes), column.weights),
                    b = pairs_times(hn::And(below, bytes), column.weights);
        return hn::MulAdd(fraction, hn::ConvertTo(d, hn::Sub(b, a)), hn::ConvertTo(d, a));
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
