// SPDX-License-Identifier: Apache-2.0
#include "density/export/voxel_kernel.h"

// Compiled once for each SIMD target of Highway and dispatched at run time.
#ifndef HWY_DISABLED_TARGETS
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4)
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "density/export/voxel_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace nephos {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using Floats = hn::ScalableTag<float>;
using Ints = hn::Repartition<std::int32_t, Floats>;
using Words = hn::Repartition<std::uint32_t, Floats>;

// Calls vector(n) for every whole vector of `count` values, and tail(n) for each of the rest.
template <class Vector, class Tail>
HWY_INLINE void for_each(std::size_t count, const Vector& vector, const Tail& tail) {
    const std::size_t lanes = hn::Lanes(Floats());
    std::size_t n = 0;
    for (; n + lanes <= count; n += lanes) vector(n);
    for (; n < count; ++n) tail(n);
}

template <class Code>
void codes_of(const float* values, std::size_t count, float factor, Code* codes) {
    const Floats d;
    const Ints di;
    const hn::Rebind<Code, Ints> dc;
    const float most = float(Code(~Code(0)));
    const auto vector = [&](std::size_t n) HWY_ATTR {
        const auto scaled = hn::Mul(hn::LoadU(d, values + n), hn::Set(d, factor));
        const auto clamped = hn::Min(hn::Max(scaled, hn::Zero(d)), hn::Set(d, most));
        const auto whole = hn::ConvertTo(di, hn::Add(clamped, hn::Set(d, 0.5f)));
        hn::StoreU(hn::DemoteTo(dc, whole), dc, codes + n);
    };
    for_each(count, vector, [&](std::size_t n) {
        const float scaled = values[n] * factor;
        codes[n] = Code(std::int32_t((scaled > 0 ? (scaled < most ? scaled : most) : 0.0f) + 0.5f));
    });
}

// In a half's normal range 13 bits are rounded away, and the exponent is moved from a single's bias to a half's. Below it
// a half counts units of 2^-24, which are also those of a single from 0.5 to 1: adding 0.5 rounds to them.
template <class D>
HWY_INLINE hn::Vec<hn::Repartition<std::uint32_t, D>> half_of(D d, hn::Vec<D> value) {
    const hn::Repartition<std::uint32_t, D> dw;
    value = hn::Min(value, hn::Set(d, 65504.0f));
    const auto bits = hn::BitCast(dw, value);
    const auto odd = hn::And(hn::ShiftRight<13>(bits), hn::Set(dw, 1u));
    const auto normal = hn::Sub(hn::ShiftRight<13>(hn::Add(hn::Add(bits, hn::Set(dw, 0xFFFu)), odd)), hn::Set(dw, 112u << 10));
    const auto small = hn::Sub(hn::BitCast(dw, hn::Add(value, hn::Set(d, 0.5f))), hn::Set(dw, 0x3F000000u));
    const auto is_small = hn::Lt(value, hn::Set(d, 0x1p-14f));
    return hn::IfThenElse(hn::RebindMask(dw, is_small), small, normal);
}

}  // namespace

void codes8(const float* values, std::size_t count, float factor, std::uint8_t* codes) {
    codes_of(values, count, factor, codes);
}
void codes16(const float* values, std::size_t count, float factor, std::uint16_t* codes) {
    codes_of(values, count, factor, codes);
}

void halves(const float* values, std::size_t count, float factor, std::uint16_t* out) {
    const Floats d;
    const Ints di;
    const hn::Rebind<std::uint16_t, Ints> dh;
    const hn::CappedTag<float, 1> d1;
    const auto vector = [&](std::size_t n) HWY_ATTR {
        const auto half = half_of(d, hn::Mul(hn::LoadU(d, values + n), hn::Set(d, factor)));
        hn::StoreU(hn::DemoteTo(dh, hn::BitCast(di, half)), dh, out + n);
    };
    const auto tail = [&](std::size_t n) HWY_ATTR { out[n] = std::uint16_t(hn::GetLane(half_of(d1, hn::Set(d1, values[n] * factor)))); };
    for_each(count, vector, tail);
}

void halved_rows(const float* a, const float* b, const float* c, const float* e, std::size_t count, float* to) {
    const Floats d;
    // Sums of neighbours, a vector of them from two of the row.
    const auto pairs = [&](const float* row) HWY_ATTR {
        hn::Vec<Floats> even, odd;
        hn::LoadInterleaved2(d, row, even, odd);
        return hn::Add(even, odd);
    };
    const auto vector = [&](std::size_t n) HWY_ATTR {
        const auto sum = hn::Add(hn::Add(pairs(a + 2 * n), pairs(b + 2 * n)), hn::Add(pairs(c + 2 * n), pairs(e + 2 * n)));
        hn::StoreU(hn::Mul(sum, hn::Set(d, 0.125f)), d, to + n);
    };
    for_each(count, vector, [&](std::size_t n) {
        const std::size_t i = 2 * n;
        to[n] = 0.125f * (((a[i] + a[i + 1]) + (b[i] + b[i + 1])) + ((c[i] + c[i + 1]) + (e[i] + e[i + 1])));
    });
}

}  // namespace HWY_NAMESPACE
}  // namespace nephos
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(codes8);
HWY_EXPORT(codes16);
HWY_EXPORT(halves);
HWY_EXPORT(halved_rows);

void to_codes(const float* values, std::size_t count, float factor, std::uint8_t* codes) {
    HWY_DYNAMIC_DISPATCH(codes8)(values, count, factor, codes);
}
void to_codes(const float* values, std::size_t count, float factor, std::uint16_t* codes) {
    HWY_DYNAMIC_DISPATCH(codes16)(values, count, factor, codes);
}
void to_halves(const float* values, std::size_t count, float factor, std::uint16_t* out) {
    HWY_DYNAMIC_DISPATCH(halves)(values, count, factor, out);
}
void halve_rows(const float* a, const float* b, const float* c, const float* d, std::size_t count, float* to) {
    HWY_DYNAMIC_DISPATCH(halved_rows)(a, b, c, d, count, to);
}

}  // namespace nephos
#endif
