// SPDX-License-Identifier: Apache-2.0

// An ellipsoid seen from the blocks of a row: which of them it touches, and bounds on p there (block_field.h).

#if defined(NEPHOS_ELLIPSOID_ROW_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_ELLIPSOID_ROW_INL_H_
#undef NEPHOS_ELLIPSOID_ROW_INL_H_
#else
#define NEPHOS_ELLIPSOID_ROW_INL_H_
#endif

#include <cstddef>
#include <cstdint>

#include <hwy/highway.h>

#include "automaton/block_field.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// base_a and base_b of the blocks: in double, rounded once.
inline void bases_in_row(const FieldEllipsoid& e, double dy, int bx, EllipsoidInRow& out) {
    const hn::CappedTag<double, 8> d;
    const hn::Rebind<float, decltype(d)> df;
    for (std::size_t n = 0; n < EllipsoidInRow::kBlocks; n += hn::Lanes(d)) {
        // Not Iota() of it, which goes through memory.
        const auto block = hn::Add(hn::Set(d, double(bx) + double(n)), hn::Iota(d, 0));
        const auto dx = hn::Sub(hn::Add(hn::Mul(block, hn::Set(d, double(kBlockEdge))), hn::Set(d, 0.5)),
                                hn::Set(d, e.centre_x));
        const auto a = hn::Add(hn::Mul(hn::Set(d, e.xx), dx), hn::Set(d, e.xy * dy));
        const auto b = hn::Add(hn::Mul(hn::Set(d, e.yx), dx), hn::Set(d, e.yy * dy));
        hn::StoreU(hn::DemoteTo(df, a), df, out.base_a + n);
        hn::StoreU(hn::DemoteTo(df, b), df, out.base_b + n);
    }
}

template <class DF, class M>
HWY_INLINE std::uint32_t lanes_of(DF d, M mask) {
    std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(d, mask, bytes);
    const std::uint32_t bits = std::uint32_t(bytes[0]) | std::uint32_t(bytes[1]) << 8;
    return bits & ((1u << hn::Lanes(d)) - 1);
}

void find_in_row_target(const FieldEllipsoid& e, const BlockEllipsoid& seen, double dy, int bx,
                        EllipsoidInRow& out) {
    const hn::CappedTag<float, 16> d;
    bases_in_row(e, dy, bx, out);
    out.touched = out.covered = 0;
    const auto one = hn::Set(d, 1.0f), zero = hn::Zero(d), reach = hn::Set(d, e.block_reach);
    const float c = seen.base_c + 3.5f * seen.zz;
    const float outside = (1 + e.block_reach) * (1 + e.block_reach);
    const auto falloff = [&](auto u) HWY_ATTR {
        const auto s = hn::Sub(one, hn::Mul(u, u));
        return hn::Mul(s, s);
    };
    for (std::size_t n = 0; n < EllipsoidInRow::kBlocks; n += hn::Lanes(d)) {
        // Distance of the block's centre, and so of its nearest and farthest cell at most.
        const auto a = hn::Add(hn::LoadU(d, out.base_a + n), hn::Set(d, 3.5f * (seen.xx + seen.xy)));
        const auto b = hn::Add(hn::LoadU(d, out.base_b + n), hn::Set(d, 3.5f * (seen.yx + seen.yy)));
        const auto square = hn::Add(hn::Add(hn::Mul(a, a), hn::Mul(b, b)), hn::Set(d, c * c));
        const auto distance = hn::Sqrt(square);
        const auto nearest = hn::Max(zero, hn::Sub(distance, reach)), farthest = hn::Add(distance, reach);
        const auto touched = hn::And(hn::Le(square, hn::Set(d, outside * 1.0001f)), hn::Lt(nearest, one));
        const auto covered = hn::Lt(farthest, one);
        out.touched |= lanes_of(d, touched) << n;
        out.covered |= lanes_of(d, covered) << n;
        const auto inner = falloff(nearest), outer = hn::IfThenElseZero(covered, falloff(farthest));
        for (std::size_t draw = 0; draw < 3; ++draw) {
            const auto rim = hn::Set(d, e.rim[draw]), span = hn::Set(d, e.span[draw]);
            // Rounding in the evaluation per cell can exceed the bound by a few units in the last place.
            const auto highest =
                hn::Mul(hn::Max(hn::Add(rim, hn::Mul(span, inner)), hn::Add(rim, hn::Mul(span, outer))),
                        hn::Set(d, 1.00001f));
            hn::StoreU(hn::Min(hn::Max(highest, zero), one), d, out.bound[draw] + n);
        }
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
