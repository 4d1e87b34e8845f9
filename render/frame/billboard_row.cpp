// SPDX-License-Identifier: Apache-2.0
#include "render/frame/billboard_row.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/frame/billboard_row.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

void shade_texels(const TurnedTexture& texture, const PlacesInRow& places, float up, float opacity,
                  std::span<float> light) {
    const hn::ScalableTag<float> d;
    const hn::RebindToSigned<decltype(d)> di;
    const auto number = [&](float value) { return hn::Set(d, value); };
    const float y = std::clamp(texture.middle + texture.up_scale * up, 0.0f, texture.last);
    const int row = int(y);
    const auto* const above = reinterpret_cast<const std::int32_t*>(texture.texels) + row * texture.stride;
    const auto* const below = above + texture.stride;
    const auto down = number(y - float(row)), most = number(opacity / 255);
    const auto step = number(texture.across * places.step);
    const float first = texture.middle + texture.across * places.first;
    const std::size_t lanes = hn::Lanes(d);
    for (std::size_t n = 0; n < light.size(); n += lanes) {
        const auto at = hn::MulAdd(hn::Iota(d, float(n)), step, number(first));
        const auto x = hn::Min(hn::Max(at, hn::Zero(d)), number(texture.last));
        const auto column = hn::ConvertTo(di, x);
        const auto part = hn::Sub(x, hn::ConvertTo(d, column));
        const auto line = [&](const std::int32_t* texels) {
            const auto pair = hn::GatherIndex(di, texels, column), byte = hn::Set(di, 255);
            const auto here = hn::ConvertTo(d, hn::And(pair, byte)),
                       next = hn::ConvertTo(d, hn::And(hn::ShiftRight<16>(pair), byte));
            return hn::MulAdd(part, hn::Sub(next, here), here);
        };
        const auto upper = line(above), value = hn::MulAdd(down, hn::Sub(line(below), upper), upper);
        const auto left = hn::NegMulAdd(most, value, number(1));
        if (n + lanes <= light.size()) {
            hn::StoreU(hn::Mul(hn::LoadU(d, &light[n]), left), d, &light[n]);
            continue;
        }
        HWY_ALIGN float rest[hn::MaxLanes(d)];
        hn::Store(left, d, rest);
        for (std::size_t i = 0; n + i < light.size(); ++i) light[n + i] *= rest[i];
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(shade_texels);

void shade_row(const TurnedTexture& texture, const PlacesInRow& places, float up, float opacity,
               std::span<float> light) {
    HWY_DYNAMIC_DISPATCH(shade_texels)(texture, places, up, opacity, light);
}

}  // namespace nephos
#endif
