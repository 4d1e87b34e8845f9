// SPDX-License-Identifier: Apache-2.0

// Vector code of smoothing_kernel.cpp, compiled once per instruction set (not installed): bits to integers,
// weighted sums of rows, and integers to floats.

#if defined(NEPHOS_DENSITY_SMOOTHING_VECTORS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_DENSITY_SMOOTHING_VECTORS_INL_H_
#undef NEPHOS_DENSITY_SMOOTHING_VECTORS_INL_H_
#else
#define NEPHOS_DENSITY_SMOOTHING_VECTORS_INL_H_
#endif

#include <algorithm>
#include <cstdint>
#include <vector>

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace nephos {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr int kWord = 64;  // cells per word

// Vectors of at most one word's cells, so that a word is a whole number of them.
template <class T>
using Tag = hn::CappedTag<T, kWord>;

// out[n] = sum over d of weights[d] * lines[d][n]; weights are symmetric; kUnit: all 1. kRadius < 0:
// `radius`.
template <class T, bool kUnit, int kRadius>
HWY_INLINE void weighted_sum_of(const T* const* lines, const T* weights, int radius, int count,
                                T* HWY_RESTRICT out) {
    const Tag<T> d;
    const int r = kRadius < 0 ? radius : kRadius;
    const int lanes = int(hn::Lanes(d));
    const auto sum_at = [&](int n) {
        auto sum = hn::LoadU(d, lines[r] + n);
        if constexpr (!kUnit) sum = hn::Mul(sum, hn::Set(d, weights[r]));
        for (int m = 1; m <= r; ++m) {
            auto pair = hn::Add(hn::LoadU(d, lines[r - m] + n), hn::LoadU(d, lines[r + m] + n));
            if constexpr (!kUnit) pair = hn::Mul(pair, hn::Set(d, weights[r - m]));
            sum = hn::Add(sum, pair);
        }
        hn::StoreU(sum, d, out + n);
    };
    int n = 0;
    for (; n + 2 * lanes <= count; n += 2 * lanes) {
        sum_at(n);
        sum_at(n + lanes);
    }
    for (; n < count; n += lanes) sum_at(n);
}

template <class T, bool kUnit>
void weighted_sum(const T* const* lines, const std::vector<T>& weights, int count, T* out) {
    const int radius = int(weights.size()) / 2;
    const T* w = weights.data();
    switch (radius) {
        case 0:
            return weighted_sum_of<T, kUnit, 0>(lines, w, 0, count, out);
        case 1:
            return weighted_sum_of<T, kUnit, 1>(lines, w, 1, count, out);
        case 2:
            return weighted_sum_of<T, kUnit, 2>(lines, w, 2, count, out);
        default:
            return weighted_sum_of<T, kUnit, -1>(lines, w, radius, count, out);
    }
}

// Returns the mask of the lanes whose first is bit n.
template <class D>
HWY_INLINE hn::Mask<D> mask_at(D d, const std::uint8_t* bits, int n) {
    if (hn::Lanes(d) >= 8) return hn::LoadMaskBits(d, bits + unsigned(n) / 8);
    // LoadMaskBits starts at bit 0 of a byte, so vectors below 8 lanes need theirs moved there.
    const std::uint8_t moved[8] = {std::uint8_t(bits[n / 8] >> (n % 8))};
    return hn::LoadMaskBits(d, moved);
}

// values[n] = (kAdd: +=) weight where bit n of `bits` is 1, 0 elsewhere. count is a multiple of 8 and of the
// lanes.
template <class T, bool kAdd>
HWY_INLINE void expand_bits(const std::uint8_t* bits, int count, T weight, T* HWY_RESTRICT values) {
    if constexpr (sizeof(T) == 8) {
        for (int n = 0; n < count; ++n) {
            const T value = (bits[n / 8] >> (n % 8) & 1) ? weight : T{0};
            values[n] = kAdd ? values[n] + value : value;
        }
    } else {
        const Tag<T> d;
        const int lanes = int(hn::Lanes(d));
        const auto w = hn::Set(d, weight);
        for (int n = 0; n < count; n += lanes) {
            auto value = hn::IfThenElseZero(mask_at(d, bits, n), w);
            if constexpr (kAdd) value = hn::Add(value, hn::LoadU(d, values + n));
            hn::StoreU(value, d, values + n);
        }
    }
}

// Eight rows of running sums: out[m][n] = lines[m][n] + .. + lines[m + 2 radius][n], m = 0..7.
template <class T>
void running_sums(const T* const* lines, int radius, int count, T* HWY_RESTRICT out) {
    const Tag<T> d;
    for (int n = 0; n < count; n += int(hn::Lanes(d))) {
        auto sum = hn::LoadU(d, lines[0] + n);
        for (int m = 1; m < 2 * radius; ++m) sum = hn::Add(sum, hn::LoadU(d, lines[m] + n));
        for (int m = 0; m < 8; ++m) {
            if (radius > 0) sum = hn::Add(sum, hn::LoadU(d, lines[m + 2 * radius] + n));
            hn::StoreU(sum, d, out + std::ptrdiff_t(m) * count + n);
            sum = radius > 0 ? hn::Sub(sum, hn::LoadU(d, lines[m] + n))
                             : hn::LoadU(d, lines[std::min(m + 1, 7)] + n);
        }
    }
}

// The vector of floats with as many lanes as a vector of sums.
template <class T>
using FloatTag = hn::CappedTag<float, sizeof(T) == 8 ? Tag<double>::kPrivateN : std::size_t{kWord}>;

template <class T>
HWY_INLINE hn::Vec<FloatTag<T>> converted(const T* HWY_RESTRICT sums, float reciprocal) {
    const FloatTag<T> d;
    const hn::Rebind<std::int32_t, decltype(d)> di;
    const hn::Rebind<T, decltype(d)> dt;
    const auto sum = hn::LoadU(dt, sums);
    auto value = hn::Zero(d);
    if constexpr (sizeof(T) == 8) {
        value = hn::DemoteTo(d, sum);
    } else if constexpr (sizeof(T) == 4) {
        value = hn::ConvertTo(d, hn::BitCast(di, sum));  // sums are below 2^31
    } else {
        value = hn::ConvertTo(d, hn::PromoteTo(di, sum));
    }
    return hn::Min(hn::Mul(value, hn::Set(d, reciprocal)), hn::Set(d, 1.0f));
}

// out[n] = min(1, float(sums[n]) * reciprocal) for the 512 values of a block.
template <class T>
HWY_INLINE void block_to_floats(const T* HWY_RESTRICT sums, float reciprocal, float* HWY_RESTRICT out) {
    const FloatTag<T> d;
    for (std::size_t n = 0; n < 512; n += hn::Lanes(d))
        hn::StoreU(converted(sums + n, reciprocal), d, out + n);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace nephos
HWY_AFTER_NAMESPACE();

#endif
