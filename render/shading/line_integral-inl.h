// SPDX-License-Identifier: Apache-2.0

// line_integral() and partial_line_integral() of render/shared/shared.h for vectors, and the rows of a tile that a vector holds.

#if defined(NEPHOS_RENDER_LINE_INTEGRAL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_LINE_INTEGRAL_INL_H_
#undef NEPHOS_RENDER_LINE_INTEGRAL_INL_H_
#else
#define NEPHOS_RENDER_LINE_INTEGRAL_INL_H_
#endif

#include <algorithm>

#include <hwy/highway.h>

#include "render/shared/shared.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// At most two rows of a tile, and every number of lanes divides a tile.
using Lanes = hn::CappedTag<float, 2 * shader::kTileWidth>;
using Floats = hn::Vec<Lanes>;

inline constexpr std::size_t kTilePixels = shader::kTileWidth * shader::kTileHeight;

HWY_INLINE Floats set(float value) { return hn::Set(Lanes(), value); }

// `root`: the square root of w.
HWY_INLINE Floats line_integral(Floats w, Floats root) {
    const Floats factor = hn::MulAdd(set(0.406349206349206f), w, set(0.592592592592593f));
    return hn::Mul(hn::Mul(hn::Mul(w, w), root), factor);
}

HWY_INLINE Floats partial_line_integral(Floats w, Floats s) {
    const Floats s2 = hn::Mul(s, s), w2 = hn::Mul(w, w);
    const Floats square = hn::MulAdd(s2, hn::MulAdd(set(-2.0f / 3.0f), w, hn::Mul(set(0.2f), s2)), w2);
    const Floats inner = hn::NegMulAdd(set(1.0f / 7.0f), s2, hn::Mul(set(0.6f), w));
    const Floats cube = hn::MulAdd(s2, hn::MulSub(s2, inner, w2), hn::Mul(w2, w));
    return hn::Mul(s, hn::MulAdd(set(5.0f / 9.0f), square, hn::Mul(set(4.0f / 9.0f), cube)));
}

// Which pixels of a tile, counted row by row, a vector holds: parts of a row or whole rows. A tile is
// `blocks` vectors wide; going down by one vector is going down by `rows`.
struct Layout {
    std::size_t lanes, blocks, rows;
    Layout()  // here, not at the members: only what stands in a function is compiled for the target
        : lanes(hn::Lanes(Lanes())),
          blocks(std::max<std::size_t>(1, shader::kTileWidth / lanes)),
          rows(std::max<std::size_t>(1, lanes / shader::kTileWidth)) {}
};

// x and y of the pixels of the first vector of a block, from the tile's corner on.
struct FirstPixels {
    HWY_ALIGN float x[2 * shader::kTileWidth], y[2 * shader::kTileWidth];
    FirstPixels(const Layout& layout, std::size_t block) {
        for (std::size_t lane = 0; lane < layout.lanes; ++lane) {
            const std::size_t pixel = block * layout.lanes + lane;
            x[lane] = float(pixel % shader::kTileWidth) + 0.5f;
            y[lane] = float(pixel / shader::kTileWidth) + 0.5f;
        }
    }
};

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
