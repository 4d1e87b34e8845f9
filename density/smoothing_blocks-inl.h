// SPDX-License-Identifier: Apache-2.0

// Vector code of smoothing_kernel.cpp for blocks of 8x8x8 sums, compiled once per instruction set (not installed): their
// order in OpenVDB, and which of them are empty or full.

#if defined(NEPHOS_DENSITY_SMOOTHING_BLOCKS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_DENSITY_SMOOTHING_BLOCKS_INL_H_
#undef NEPHOS_DENSITY_SMOOTHING_BLOCKS_INL_H_
#else
#define NEPHOS_DENSITY_SMOOTHING_BLOCKS_INL_H_
#endif

#include <cstddef>
#include <cstdint>
#include <cstring>

#include <hwy/highway.h>

#include "density/smoothing_vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

namespace {

// Transposes one 8x8x8 block of S rows, s[z][y][x], to OpenVDB's order, block[x][y][z].
template <class T>
HWY_INLINE void transpose_block(const T* s, std::size_t stride_y, std::size_t stride_z,
                                T* HWY_RESTRICT block) {
    for (int z = 0; z < 8; ++z) {
        for (int y = 0; y < 8; ++y) {
            const T* row = s + std::size_t(z) * stride_z + std::size_t(y) * stride_y;
            for (int x = 0; x < 8; ++x) block[x * 64 + y * 8 + z] = row[x];
        }
    }
}

#if HWY_TARGET != HWY_SCALAR
// 8-bit sums in vectors: three rounds of interleaving transpose 8 rows of z into 8 rows of x.
HWY_INLINE void transpose_block(const std::uint8_t* s, std::size_t stride_y, std::size_t stride_z,
                                std::uint8_t* HWY_RESTRICT block) {
    const hn::FixedTag<std::uint8_t, 8> d8;
    const hn::FixedTag<std::uint8_t, 16> d;
    const hn::FixedTag<std::uint16_t, 8> d16;
    const hn::FixedTag<std::uint32_t, 4> d32;
    for (int y = 0; y < 8; ++y) {
        const auto pair = [&](int z) {  // x0 z, x0 z+1, x1 z, x1 z+1 ...
            const std::uint8_t* row = s + std::size_t(z) * stride_z + std::size_t(y) * stride_y;
            const auto a = hn::ZeroExtendVector(d, hn::LoadU(d8, row));
            const auto b = hn::ZeroExtendVector(d, hn::LoadU(d8, row + stride_z));
            return hn::BitCast(d16, hn::InterleaveLower(d, a, b));
        };
        const auto z01 = pair(0), z23 = pair(2), z45 = pair(4), z67 = pair(6);
        const auto lower = hn::BitCast(d32, hn::InterleaveLower(d16, z01, z23));   // x 0..3, z 0..3
        const auto upper = hn::BitCast(d32, hn::InterleaveUpper(d16, z01, z23));   // x 4..7, z 0..3
        const auto lower4 = hn::BitCast(d32, hn::InterleaveLower(d16, z45, z67));  // x 0..3, z 4..7
        const auto upper4 = hn::BitCast(d32, hn::InterleaveUpper(d16, z45, z67));  // x 4..7, z 4..7
        const auto store = [&](int x, auto v) {
            const auto bytes = hn::BitCast(d, v);
            hn::StoreU(hn::LowerHalf(d8, bytes), d8, block + x * 64 + y * 8);
            hn::StoreU(hn::UpperHalf(d8, bytes), d8, block + (x + 1) * 64 + y * 8);
        };
        store(0, hn::InterleaveLower(d32, lower, lower4));
        store(2, hn::InterleaveUpper(d32, lower, lower4));
        store(4, hn::InterleaveLower(d32, upper, upper4));
        store(6, hn::InterleaveUpper(d32, upper, upper4));
    }
}

HWY_INLINE void transpose_block(const std::uint16_t* s, std::size_t stride_y, std::size_t stride_z,
                                std::uint16_t* HWY_RESTRICT block) {
    const hn::FixedTag<std::uint16_t, 8> d;
    const hn::FixedTag<std::uint32_t, 4> d32;
    const hn::FixedTag<std::uint64_t, 2> d64;
    for (int y = 0; y < 8; ++y) {
        const auto row = [&](int z) {
            return hn::LoadU(d, s + std::size_t(z) * stride_z + std::size_t(y) * stride_y);
        };
        // x 4h .. 4h+3 with z and z+1, as 32-bit pairs.
        const auto half = [&](int z, bool high) {
            const auto a = row(z), b = row(z + 1);
            return hn::BitCast(d32, high ? hn::InterleaveUpper(d, a, b) : hn::InterleaveLower(d, a, b));
        };
        for (int h = 0; h < 2; ++h) {
            const auto z01 = half(0, h != 0), z23 = half(2, h != 0), z45 = half(4, h != 0),
                       z67 = half(6, h != 0);
            const auto a = hn::BitCast(d64, hn::InterleaveLower(d32, z01, z23));   // x 0, 1; z 0..3
            const auto b = hn::BitCast(d64, hn::InterleaveUpper(d32, z01, z23));   // x 2, 3; z 0..3
            const auto a4 = hn::BitCast(d64, hn::InterleaveLower(d32, z45, z67));  // x 0, 1; z 4..7
            const auto b4 = hn::BitCast(d64, hn::InterleaveUpper(d32, z45, z67));  // x 2, 3; z 4..7
            std::uint16_t* out = block + h * 4 * 64 + y * 8;
            hn::StoreU(hn::BitCast(d, hn::InterleaveLower(d64, a, a4)), d, out);
            hn::StoreU(hn::BitCast(d, hn::InterleaveUpper(d64, a, a4)), d, out + 64);
            hn::StoreU(hn::BitCast(d, hn::InterleaveLower(d64, b, b4)), d, out + 128);
            hn::StoreU(hn::BitCast(d, hn::InterleaveUpper(d64, b, b4)), d, out + 192);
        }
    }
}
#endif

// Sets bit n of `mask` where block[n] is not 0. Returns true when all 512 values are `total`.
template <class T>
HWY_INLINE bool classify_block(const T* block, T total, std::uint64_t (&mask)[8]) {
    if constexpr (HWY_TARGET != HWY_SCALAR && sizeof(T) <= 2) {  // whole bytes of mask
        const Tag<T> d;
        const int lanes = int(hn::Lanes(d));
        auto least = hn::Set(d, total);
        auto* bytes = reinterpret_cast<std::uint8_t*>(mask);
        for (int n = 0; n < 512; n += lanes) {
            const auto v = hn::LoadU(d, block + n);
            least = hn::Min(least, v);
            hn::StoreMaskBits(d, hn::Ne(v, hn::Zero(d)), bytes + n / 8);
        }
        return hn::AllTrue(d, hn::Eq(least, hn::Set(d, total)));
    } else {
        bool full = true;
        for (int word = 0; word < 8; ++word) {
            mask[word] = 0;
            for (int bit = 0; bit < 64; ++bit) {
                const T v = block[word * 64 + bit];
                mask[word] |= std::uint64_t(v != T{0}) << bit;
                full = full && v == total;
            }
        }
        return full;
    }
}

template <class T>
bool block_is_zero(const T* s, std::size_t stride_y, std::size_t stride_z) {
    constexpr int kParts = sizeof(T);  // 8 * sizeof(T) bytes in 8-byte parts
    std::uint64_t any = 0;
    for (int z = 0; z < 8; ++z) {
        for (int y = 0; y < 8; ++y) {
            std::uint64_t parts[kParts];
            std::memcpy(parts, s + std::size_t(z) * stride_z + std::size_t(y) * stride_y, sizeof(parts));
            for (std::uint64_t part : parts) any |= part;
        }
    }
    return any == 0;
}

}  // namespace

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
