// SPDX-License-Identifier: Apache-2.0

// Which of the shadow map a tile shows (processor_view.h).

#if defined(NEPHOS_RENDER_VISIBILITY_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_VISIBILITY_INL_H_
#undef NEPHOS_RENDER_VISIBILITY_INL_H_
#else
#define NEPHOS_RENDER_VISIBILITY_INL_H_
#endif

#include <algorithm>
#include <cstdint>

#include <hwy/highway.h>

#include "render/cpu/view_scene.h"
#include "render/frame/tile_bins.h"
#include "render/shading/background-inl.h"
#include "render/shading/formulas-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// Marks the tiles of the shadow map that the ground wears where it is seen.
inline void mark_ground(const ViewScene& scene, const ViewTile& tile, const TileSums& sums,
                        std::uint8_t* marks) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    const Layout layout;
    const PictureFrame& frame = *scene.frame;
    const Floats size = set(float(scene.shadow_size)), last = set(float(scene.shadow_size - 1));
    const int columns = TileGrid{scene.shadow_size, scene.shadow_size}.columns();
    int marked = -1;
    for (std::size_t at = 0; at < kTilePixels; at += layout.lanes) {
        const FirstPixels first(layout, at / layout.lanes % layout.blocks);
        const float row = float(at / (layout.lanes * layout.blocks) * layout.rows);
        const Floats3 direction = pixel_direction(frame, hn::Add(hn::Load(d, first.x), set(float(tile.x))),
                                                  hn::Add(hn::Load(d, first.y), set(float(tile.y) + row)));
        const Floats3 ray = times(hn::Div(set(1.0f), hn::Sqrt(dot(direction, direction))), direction);
        const Floats distance = ground_distance(frame, ray.z);
        const auto shown = hn::And(hn::Lt(distance, set(kNowhere)),
                                   hn::Ge(hn::Load(d, sums.transmittance + at), hn::Load(d, sums.opaque + at)));
        if (hn::AllFalse(d, shown)) continue;
        const Floats3 point = times(hn::IfThenElseZero(shown, distance), ray);
        const auto texel = [&](const shader::vec4& axis) {
            const Floats place = hn::Add(dot(set3(axis), point), set(axis.w));
            return hn::Floor(hn::Min(hn::Max(hn::MulSub(place, size, set(0.5f)), set(-2.0f)), last));
        };
        HWY_ALIGN std::int32_t x[2 * shader::kTileWidth], y[2 * shader::kTileWidth];
        hn::Store(hn::ConvertTo(di, texel(frame.shadow_u)), di, x);
        hn::Store(hn::ConvertTo(di, texel(frame.shadow_v)), di, y);
        HWY_ALIGN float is_shown[2 * shader::kTileWidth];
        hn::Store(hn::IfThenElseZero(shown, set(1.0f)), d, is_shown);
        for (std::size_t lane = 0; lane < layout.lanes; ++lane) {
            if (!(is_shown[lane] > 0) || (x[lane] << 16 ^ y[lane]) == marked) continue;
            marked = x[lane] << 16 ^ y[lane];
            for (const int column : {std::max(x[lane], 0), std::min(x[lane] + 1, scene.shadow_size - 1)})
                for (const int line : {std::max(y[lane], 0), std::min(y[lane] + 1, scene.shadow_size - 1)})
                    mark(marks[line / int(shader::kTileHeight) * columns + column / int(shader::kTileWidth)]);
        }
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
