// SPDX-License-Identifier: Apache-2.0
#include "density/export/voxel_kernel.h"

#include <cstring>

// Compiled once for each SIMD target of Highway and dispatched at run time.
#if defined(__OPTIMIZE__) && !defined(HWY_DISABLED_TARGETS)  // with -O0 as all files (docs/determinism.md)
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

// Indices of the four voxels of a row: how many sevenths each lies below the largest of its block, as 0, 2, 3, .., 7, 1.
#if HWY_TARGET == HWY_SCALAR
std::uint64_t bc4_indices(const float* row, float to_code, float top, float sevenths) {
    std::uint64_t indices = 0;
    for (int n = 0; n < 4; ++n) {
        const float below = (top - row[n] * to_code) * sevenths;
        const auto t = std::uint64_t((below > 0 ? (below < 7 ? below : 7.0f) : 0.0f) + 0.5f);
        indices |= (t == 0 ? 0 : t == 7 ? 1 : t + 1) << (3 * n);
    }
    return indices;
}

void extremes_of(const float* const (&rows)[4], std::size_t at, float& low, float& high) {
    low = high = rows[0][at];
    for (const float* row : rows) {
        for (std::size_t n = at; n < at + 4; ++n) {
            low = row[n] < low ? row[n] : low;
            high = row[n] > high ? row[n] : high;
        }
    }
}
#else
std::uint64_t bc4_indices(const float* row, float to_code, float top, float sevenths) {
    const hn::FixedTag<float, 4> d;
    const hn::RebindToSigned<decltype(d)> di;
    HWY_ALIGN static constexpr float kPlaces[4] = {1, 8, 64, 512};  // of indices of three bits
    const auto one = hn::Set(d, 1.0f), seven = hn::Set(d, 7.0f), scaled = hn::Mul(hn::LoadU(d, row), hn::Set(d, to_code));
    const auto below = hn::Mul(hn::Sub(hn::Set(d, top), scaled), hn::Set(d, sevenths));
    const auto rounded = hn::Add(hn::Min(hn::Max(below, hn::Zero(d)), seven), hn::Set(d, 0.5f));
    const auto t = hn::ConvertTo(d, hn::ConvertTo(di, rounded));
    const auto next = hn::IfThenElse(hn::Eq(t, seven), one, hn::Add(t, one));
    const auto index = hn::IfThenZeroElse(hn::Eq(t, hn::Zero(d)), next);
    return std::uint64_t(hn::GetLane(hn::SumOfLanes(d, hn::Mul(index, hn::Load(d, kPlaces)))));
}

void extremes_of(const float* const (&rows)[4], std::size_t at, float& low, float& high) {
    const hn::FixedTag<float, 4> d;
    const auto a = hn::LoadU(d, rows[0] + at), b = hn::LoadU(d, rows[1] + at), c = hn::LoadU(d, rows[2] + at),
               e = hn::LoadU(d, rows[3] + at);
    low = hn::GetLane(hn::MinOfLanes(d, hn::Min(hn::Min(a, b), hn::Min(c, e))));
    high = hn::GetLane(hn::MaxOfLanes(d, hn::Max(hn::Max(a, b), hn::Max(c, e))));
}
#endif

void bc4_blocks(const float* a, const float* b, const float* c, const float* e, std::size_t count, float to_code,
                std::uint8_t* blocks) {
    const float* const rows[4] = {a, b, c, e};
    const auto code = [to_code](float value) {
        const float scaled = value * to_code;
        return std::uint32_t((scaled < 255.0f ? scaled : 255.0f) + 0.5f);
    };
    for (std::size_t n = 0; n < count; ++n, blocks += 8) {
        float low = 0, high = 0;
        extremes_of(rows, 4 * n, low, high);
        const std::uint32_t first = code(high), second = code(low);
        std::uint64_t block = first | second << 8;
        if (first != second) {
            const float top = float(first), sevenths = 7.0f / float(first - second);
            for (std::size_t y = 0; y < 4; ++y)
                block |= bc4_indices(rows[y] + 4 * n, to_code, top, sevenths) << (16 + 12 * y);
        }
        std::memcpy(blocks, &block, sizeof block);
    }
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
HWY_EXPORT(bc4_blocks);
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
void to_bc4_blocks(const float* a, const float* b, const float* c, const float* d, std::size_t count, float to_code,
                   std::uint8_t* blocks) {
    HWY_DYNAMIC_DISPATCH(bc4_blocks)(a, b, c, d, count, to_code, blocks);
}
void halve_rows(const float* a, const float* b, const float* c, const float* d, std::size_t count, float* to) {
    HWY_DYNAMIC_DISPATCH(halved_rows)(a, b, c, d, count, to);
}

}  // namespace nephos
#endif
