// SPDX-License-Identifier: Apache-2.0

// Detailed density (detail.h) for vectors of places.

#if defined(NEPHOS_DENSITY_DETAIL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_DENSITY_DETAIL_INL_H_
#undef NEPHOS_DENSITY_DETAIL_INL_H_
#else
#define NEPHOS_DENSITY_DETAIL_INL_H_
#endif

#include <cstddef>
#include <cstdint>

#include <hwy/highway.h>

#include "density/detail_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace erosion {
namespace hn = hwy::HWY_NAMESPACE;

using Lanes = hn::CappedTag<float, 16>;
using Floats = hn::Vec<Lanes>;
using IntLanes = hn::RebindToSigned<Lanes>;
using Ints = hn::Vec<IntLanes>;
using Mask = hn::Mask<Lanes>;

HWY_INLINE Floats number(float value) { return hn::Set(Lanes(), value); }
HWY_INLINE Ints integer(std::int32_t value) { return hn::Set(IntLanes(), value); }

namespace text {
using Real = Floats;
using Truth = Mask;
HWY_INLINE Floats operator*(float a, Floats b) { return hn::Mul(number(a), b); }
HWY_INLINE Floats operator*(Floats a, float b) { return hn::Mul(a, number(b)); }
HWY_INLINE Floats operator+(float a, Floats b) { return hn::Add(number(a), b); }
HWY_INLINE Floats operator-(float a, Floats b) { return hn::Sub(number(a), b); }
HWY_INLINE Floats operator-(Floats a, float b) { return hn::Sub(a, number(b)); }
HWY_INLINE Floats mul_add(Floats a, Floats b, Floats c) { return hn::MulAdd(a, b, c); }
HWY_INLINE Floats min(Floats a, Floats b) { return hn::Min(a, b); }
HWY_INLINE Floats max(Floats a, Floats b) { return hn::Max(a, b); }
HWY_INLINE Floats select(Mask condition, Floats a, Floats b) { return hn::IfThenElse(condition, a, b); }
#pragma push_macro("NEPHOS_FUNCTION")
#undef NEPHOS_FUNCTION
#define NEPHOS_FUNCTION HWY_INLINE
#define Real(value) number(value)
#include "density/detail_formulas.h"
#undef Real
#pragma pop_macro("NEPHOS_FUNCTION")
}  // namespace text

HWY_INLINE Floats mixed(Floats a, Floats b, Floats weight) { return hn::MulAdd(weight, hn::Sub(b, a), a); }

HWY_INLINE Floats byte_at(Ints word, int shift) {
    return hn::ConvertTo(Lanes(), hn::And(hn::ShiftRightSame(word, shift), integer(255)));
}

// The four bytes of a word of DetailNoise, 0..255, bilinearly.
HWY_INLINE Floats of_word(Ints word, Floats x, Floats y) {
    return mixed(mixed(byte_at(word, 0), byte_at(word, 8), x), mixed(byte_at(word, 16), byte_at(word, 24), x), y);
}

// A cube of noise with `edge` voxels, a power of two and possibly another one in each lane, whose words begin at
// `first`; places in voxels; 0..1.
HWY_INLINE Floats noise_at(const std::uint32_t* words, Ints first, Ints bits, Floats x, Floats y, Floats z) {
    const Lanes d;
    const IntLanes di;
    const Floats half = number(0.5f);
    x = hn::Sub(x, half);
    y = hn::Sub(y, half);
    z = hn::Sub(z, half);
    const Floats x0 = hn::Floor(x), y0 = hn::Floor(y), z0 = hn::Floor(z);
    const Ints last = hn::Sub(hn::Shl(integer(1), bits), integer(1));
    const Ints i = hn::And(hn::ConvertTo(di, x0), last), j = hn::And(hn::ConvertTo(di, y0), last),
               k = hn::ConvertTo(di, z0);
    const auto plane = [&](Ints of) {
        return hn::Add(first, hn::Add(hn::Shl(hn::Add(hn::Shl(of, bits), j), bits), i));
    };
    const auto* base = reinterpret_cast<const std::int32_t*>(words);
    const Floats fx = hn::Sub(x, x0), fy = hn::Sub(y, y0), fz = hn::Sub(z, z0);
    const Floats low = of_word(hn::GatherIndex(di, base, plane(hn::And(k, last))), fx, fy),
                 high = of_word(hn::GatherIndex(di, base, plane(hn::And(hn::Add(k, integer(1)), last))), fx, fy);
    (void)d;
    return hn::Mul(mixed(low, high, fz), number(1.0f / 255.0f));
}

// The small noise at a level of detail, 0..3, that need not be whole; places in voxels of level 0.
HWY_INLINE Floats small_noise_at(const DetailKernel& field, Floats level, Floats x, Floats y, Floats z) {
    const Lanes d;
    const IntLanes di;
    const Floats below = hn::Min(hn::Floor(level), number(2.0f)), weight = hn::Sub(level, below);
    const Ints l = hn::ConvertTo(di, below);
    const auto at = [&](Ints of) {
        const Floats scale = hn::BitCast(d, hn::ShiftLeft<23>(hn::Sub(integer(127), of)));  // 2^-level
        const auto begins = [](int n) { return integer(std::int32_t(nephos::first_of_level(n))); };
        const Ints first =
            hn::IfThenElse(hn::Lt(of, integer(2)), hn::IfThenElse(hn::Lt(of, integer(1)), begins(0), begins(1)),
                           hn::IfThenElse(hn::Lt(of, integer(3)), begins(2), begins(3)));
        return noise_at(field.small_noise, first, hn::Sub(integer(6), of), hn::Mul(x, scale), hn::Mul(y, scale),
                        hn::Mul(z, scale));
    };
    const Floats fine = at(l);
    if (hn::AllTrue(d, hn::Eq(weight, hn::Zero(d)))) return fine;
    return mixed(fine, at(hn::Add(l, integer(1))), weight);
}

struct Node {
    Floats t, growth;
};

// t and growth at places in nodes, in bricks whose numbers are given; x, y, z: place in the brick, 0..8. `most_t` becomes
// the largest t of the eight nodes around, 0..255.
HWY_INLINE Node node_at(const DetailKernel& field, Ints brick, Floats x, Floats y, Floats z,
                        Floats* most_t = nullptr) {
    const Lanes d;
    const IntLanes di;
    constexpr int kEdge = CoverageField::kBrickNodes;
    const Floats x0 = hn::Min(hn::Floor(x), number(7)), y0 = hn::Min(hn::Floor(y), number(7)),
                 z0 = hn::Min(hn::Floor(z), number(7));
    const Ints first = hn::Add(
        hn::Mul(brick, integer(int(CoverageField::kBrickBytes))),
        hn::ShiftLeft<1>(hn::Add(
            hn::Mul(hn::Add(hn::Mul(hn::ConvertTo(di, z0), integer(kEdge)), hn::ConvertTo(di, y0)), integer(kEdge)),
            hn::ConvertTo(di, x0))));
    const Floats fx = hn::Sub(x, x0), fy = hn::Sub(y, y0), fz = hn::Sub(z, z0);
    const auto* base = reinterpret_cast<const std::int32_t*>(field.nodes);
    const auto word_of = [&](int offset) { return hn::GatherOffset(di, base, hn::Add(first, integer(offset))); };
    const auto row = [&](Ints word) {
        return Node{mixed(byte_at(word, 0), byte_at(word, 16), fx), mixed(byte_at(word, 8), byte_at(word, 24), fx)};
    };
    const Ints words[4] = {word_of(0), word_of(2 * kEdge), word_of(2 * kEdge * kEdge), word_of(2 * kEdge * (kEdge + 1))};
    const Node a = row(words[0]), b = row(words[1]), c = row(words[2]), e = row(words[3]);
    if (most_t != nullptr) {
        const auto larger = [](Ints word) { return hn::Max(byte_at(word, 0), byte_at(word, 16)); };
        *most_t = hn::Max(hn::Max(larger(words[0]), larger(words[1])), hn::Max(larger(words[2]), larger(words[3])));
    }
    const Floats t = mixed(mixed(a.t, b.t, fy), mixed(c.t, e.t, fy), fz),
                 growth = mixed(mixed(a.growth, b.growth, fy), mixed(c.growth, e.growth, fy), fz);
    (void)d;
    return {hn::Mul(t, number(1.0f / 255.0f)),
            hn::MulSub(growth, number(1.0f / 127.0f), number(128.0f / 127.0f))};
}

// Places in the tiles of the large noise: of the band of height that a point is in and, where it passes into the next, of
// that one, too.
struct InTiles {
    Floats u, v, w;
    Floats next_u, next_v, next_w;
    Floats share, apart;  // of the next; mean_of_uniform()
    bool two = false;     // whether any lane has two
};

// Adds the drift of bands at heights `z`; `used`: lanes that count.
HWY_INLINE void add_drift(const DetailKernel& field, Floats z, Mask used, InTiles& at) {
    const Lanes d;
    const IntLanes di;
    const ErosionConstants& e = *field.erosion;
    const Floats place = hn::MulAdd(hn::Sub(z, number(e.bands_begin_m)), number(e.bands_per_m), number(-0.5f));
    const Floats last = number(float(e.bands.size() - 1));
    const Floats below = hn::Min(hn::Max(hn::Floor(place), hn::Zero(d)), last),
                 above = hn::Min(hn::Add(below, number(1.0f)), last);
    at.share = text::share_of_upper(hn::Sub(place, below));
    const Mask passed = hn::Ge(at.share, number(1.0f));
    const Floats own = hn::IfThenElse(passed, above, below);
    at.share = hn::IfThenElseZero(hn::Lt(at.share, number(1.0f)), at.share);
    at.two = !hn::AllFalse(d, hn::And(used, hn::Gt(at.share, hn::Zero(d))));
    const auto add = [&](const auto& of) {  // of(band, n): number n of bands
        at.apart = of(below, 3);
        if (at.two) {  // lanes with one band alone read what is in the cache
            const Mask both = hn::And(used, hn::Gt(at.share, hn::Zero(d)));
            at.next_u = hn::IfThenElseZero(both, hn::Add(at.u, of(above, 0)));
            at.next_v = hn::IfThenElseZero(both, hn::Add(at.v, of(above, 1)));
            at.next_w = hn::IfThenElseZero(both, hn::Add(at.w, of(above, 2)));
        }
        at.u = hn::Add(at.u, of(own, 0));
        at.v = hn::Add(at.v, of(own, 1));
        at.w = hn::Add(at.w, of(own, 2));
    };
    if (e.bands.size() <= hn::Lanes(d)) {  // they fit into a vector
        add([&](Floats band, std::size_t n) {
            return hn::TableLookupLanes(hn::LoadU(d, field.bands[n].data()),
                                        hn::IndicesFromVec(d, hn::ConvertTo(di, band)));
        });
    } else {
        add([&](Floats band, std::size_t n) {
            return hn::GatherIndex(d, e.bands.front().data() + n, hn::ShiftLeft<2>(hn::ConvertTo(di, band)));
        });
    }
}

// Returns look_up(u, v, w), a noise that is uniform, where it passes from one band into the next that of both.
template <class LookUp>
HWY_INLINE Floats of_bands(const InTiles& at, Floats apart, const LookUp& look_up) {
    const Floats own = look_up(at.u, at.v, at.w);
    if (!at.two) return own;
    return text::mean_of_uniform(own, look_up(at.next_u, at.next_v, at.next_w), at.share, apart);
}

struct Eroded {
    Floats density;
    Floats margin;  // coverage that is missing to be cloud; not above 0 inside
};

// The detailed density of nodes at places relative to the field's corner, metres. Lanes that are not `asked` are 0. No
// lane depends on the others. Lanes without need of the noise do not look it up: they read a voxel that is in the cache. Those
// are the ones not asked for and, without kMargins, where margins are of no use, also those that are cloud or clear
// whatever the noise.
template <bool kMargins = false>
HWY_INLINE Eroded eroded(const DetailKernel& field, const Node& node, Floats x, Floats y, Floats z, Floats footprint,
                         Mask asked) {
    const Lanes d;
    const ErosionConstants& e = *field.erosion;
    footprint = hn::Mul(footprint, number(e.footprint_scale));
    const Floats zero = hn::Zero(d), half = number(0.5f);
    const Floats coverage = text::coverage_of(node.t), c = hn::Add(coverage, number(e.whole));
    const Floats top = text::towards_top(hn::Sub(z, number(e.base_m)));
    const Floats large = text::large_width(top, node.growth, e.base_width, e.top_width, e.dissolving_width);
    const Floats medium = text::medium_width(footprint, e.medium_width), fine = text::fine_width(footprint, e.fine_width),
                 soft = text::edge_softness(footprint);
    const Floats others = hn::Mul(half, hn::Add(medium, hn::Add(fine, soft)));
    const Floats low = hn::NegMulAdd(half, large, hn::Sub(half, others));
    const Mask needed = hn::And(asked, hn::And(hn::Gt(c, low), hn::Gt(coverage, number(e.least_coverage))));
    if (!kMargins && hn::AllFalse(d, needed)) return {zero, zero};
    const auto turned = [&](int row) {
        const auto& to = e.to_noise[std::size_t(row)];
        return hn::MulAdd(number(to[0]), x,
                          hn::MulAdd(number(to[1]), y, hn::MulAdd(number(to[2]), z, number(to[3]))));
    };
    InTiles at{turned(0), turned(1), turned(2), zero, zero, zero, zero, zero};
    const Floats edge = number(float(kLargeNoiseVoxels));
    Mask unsure = asked;
    if (!kMargins) {
        const Floats most = hn::MulAdd(half, large, hn::Add(number(0.5001f), others));
        unsure = hn::And(needed, hn::Lt(c, most));
    }
    at.u = hn::IfThenElseZero(unsure, at.u);
    at.v = hn::IfThenElseZero(unsure, at.v);
    at.w = hn::IfThenElseZero(unsure, at.w);
    if (!e.bands.empty()) add_drift(field, z, unsure, at);
    Floats noise = of_bands(at, at.apart, [&](Floats u, Floats v, Floats w) {
        return noise_at(field.large_noise, integer(0), integer(7), hn::Mul(u, edge), hn::Mul(v, edge), hn::Mul(w, edge));
    });
    noise = hn::MulAdd(large, hn::Sub(noise, half), half);
    const Mask near = hn::And(hn::And(needed, unsure), hn::Lt(hn::Abs(hn::Sub(c, noise)), others));
    if (!hn::AllFalse(d, hn::And(near, hn::Gt(medium, zero)))) {
        const auto level_of = [&](float voxels_per_m) {
            const Floats voxels = hn::Max(hn::Mul(footprint, number(voxels_per_m)), number(1.0f));
            // log2 by its exponent and a chord of the mantissa: continuous, which is what counts.
            const auto bits = hn::BitCast(IntLanes(), voxels);
            const Floats exponent = hn::ConvertTo(d, hn::Sub(hn::ShiftRight<23>(bits), integer(127)));
            const Floats mantissa = hn::BitCast(
                d, hn::Or(hn::And(bits, integer(0x7FFFFF)), integer(0x3F800000)));
            return hn::Min(hn::Add(exponent, hn::Sub(mantissa, number(1.0f))), number(3.0f));
        };
        const Floats scale = number(e.medium_scale * float(kSmallNoiseVoxels));
        const Floats medium_level = level_of(e.medium_per_m);
        const Floats uniform = of_bands(at, text::apart_of_small(at.apart), [&](Floats u, Floats v, Floats w) {
            const Floats a = hn::Mul(u, scale), b = hn::Mul(v, scale), g = hn::Mul(w, scale);
            return small_noise_at(field, medium_level, hn::NegMulAdd(number(0.8f), g, hn::Mul(number(0.6f), a)), b,
                                  hn::MulAdd(number(0.8f), a, hn::Mul(number(0.6f), g)));
        });
        const Floats bumps = hn::Sub(uniform, half);
        const Floats sign = text::billows(top, node.growth, e.wisps);
        noise = hn::IfThenElse(near, hn::MulAdd(hn::Mul(medium, sign), bumps, noise), noise);
        if (!hn::AllFalse(d, hn::And(near, hn::Gt(fine, zero)))) {
            const Floats finer = number(e.fine_scale * float(kSmallNoiseVoxels));
            const Floats fine_level = level_of(e.fine_per_m);
            const Floats grain = of_bands(at, text::apart_of_small(at.apart), [&](Floats u, Floats v, Floats w) {
                return small_noise_at(field, fine_level, hn::Mul(u, finer), hn::Mul(v, finer), hn::Mul(w, finer));
            });
            noise = hn::IfThenElse(near, hn::MulAdd(fine, hn::Sub(grain, half), noise), noise);
        }
    }
    const Floats margin = hn::Sub(hn::NegMulAdd(half, soft, noise), c);
    const Floats mask = text::saturate(hn::Add(hn::Div(hn::Sub(c, noise), soft), half));
    const Floats small = hn::Sqrt(hn::MulAdd(medium, medium, hn::Mul(soft, soft)));
    const Floats fraction = hn::Max(text::cloudy_fraction(c, large, hn::Min(small, large)), number(0.02f));
    const Floats coarse = hn::Mul(hn::Sub(footprint, number(13.0f)), number(1.0f / 12.0f));
    const Floats gain = mixed(number(e.gain[0]), number(e.gain[1]), text::saturate(coarse));
    const Floats mean = text::density_of(node.t, e.half_density);
    const Floats inside = hn::Min(hn::Div(hn::Mul(gain, mean), fraction), hn::Max(mean, number(e.cap)));
    return {hn::IfThenElseZero(needed, hn::Mul(mask, inside)), margin};
}

}  // namespace erosion
}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
