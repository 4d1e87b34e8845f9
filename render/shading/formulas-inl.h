// SPDX-License-Identifier: Apache-2.0

// render/shared/formulas.h for SIMD vectors, one ray a lane: the source of the shaders, compiled for each
// instruction set; and the layout of pixels in those vectors.

#if defined(NEPHOS_RENDER_FORMULAS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_FORMULAS_INL_H_
#undef NEPHOS_RENDER_FORMULAS_INL_H_
#else
#define NEPHOS_RENDER_FORMULAS_INL_H_
#endif

#include <algorithm>
#include <cmath>

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/shared/shared.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// At most two rows of a tile, and every number of lanes divides a tile.
using Lanes = hn::CappedTag<float, 2 * shader::kTileWidth>;
using Floats = hn::Vec<Lanes>;
using Words = hn::Vec<hn::RebindToSigned<Lanes>>;

HWY_INLINE Floats set(float value) { return hn::Set(Lanes(), value); }

// Returns exp(x) to 4e-5 of it, for -80 .. 80, as 2^n times a polynomial: the air needs no more.
HWY_INLINE Floats fast_exp(Floats x) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    const Floats binary = hn::Mul(hn::Max(x, set(-80)), set(1.44269504f)), whole = hn::Round(binary);
    const Floats rest = hn::Sub(binary, whole);
    Floats power = hn::MulAdd(rest, set(0.00961813f), set(0.05550411f));
    power = hn::MulAdd(rest, power, set(0.24022651f));
    power = hn::MulAdd(rest, power, set(0.69314718f));
    power = hn::MulAdd(rest, power, set(1));
    return hn::BitCast(d, hn::Add(hn::BitCast(di, power), hn::ShiftLeft<23>(hn::ConvertTo(di, whole))));
}

// The functions that formulas.h needs, in a namespace of their own so that no other code finds them.
namespace formulas {

using shader::kAirScale;
using shader::kPi;
using shader::kScatterAngles;
using shader::kScatterDepths;
using shader::kScatterRowsPerDoubling;

using Real = Floats;
HWY_INLINE Floats operator*(float a, Floats b) { return hn::Mul(set(a), b); }
HWY_INLINE Floats operator*(Floats a, float b) { return hn::Mul(a, set(b)); }
HWY_INLINE Floats operator+(float a, Floats b) { return hn::Add(set(a), b); }
HWY_INLINE Floats operator-(float a, Floats b) { return hn::Sub(set(a), b); }
HWY_INLINE Floats operator-(Floats a) { return hn::Neg(a); }
HWY_INLINE Floats mul_add(Floats a, Floats b, Floats c) { return hn::MulAdd(a, b, c); }
HWY_INLINE Floats select(hn::Mask<Lanes> condition, Floats a, Floats b) {
    return hn::IfThenElse(condition, a, b);
}
HWY_INLINE Floats min(Floats a, Floats b) { return hn::Min(a, b); }
HWY_INLINE Floats max(Floats a, Floats b) { return hn::Max(a, b); }
HWY_INLINE Floats abs(Floats a) { return hn::Abs(a); }
HWY_INLINE Floats sqrt(Floats a) { return hn::Sqrt(a); }
HWY_INLINE Floats log2(Floats a) { return hn::Mul(set(1.442695041f), hn::Log(Lanes(), a)); }
HWY_INLINE float exp(float a) { return std::exp(a); }

#pragma push_macro("NEPHOS_FUNCTION")
#undef NEPHOS_FUNCTION
#define NEPHOS_FUNCTION HWY_INLINE
#define Real(value) set(value)
#include "render/shared/formulas.h"
#undef Real
#pragma pop_macro("NEPHOS_FUNCTION")

}  // namespace formulas

using formulas::flash_falloff;
using formulas::air_distance;
using formulas::air_row;
using formulas::fog_column;
using formulas::layer_column;
using formulas::line_integral;
using formulas::mean_decay;
using formulas::molecule_phase;
using formulas::partial_line_integral;
using formulas::particle_phase;
using formulas::sky_across;
using formulas::sky_upwards;
using formulas::sphere_distance;

inline constexpr std::size_t kTilePixels = shader::kTileWidth * shader::kTileHeight;

// The pixels of a tile in one vector, row by row: parts of a row or whole rows. A tile is `blocks` vectors
// wide; the next vector below begins `rows` rows further down.
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
