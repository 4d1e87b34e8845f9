// SPDX-License-Identifier: Apache-2.0

// Philox4x32-10 on vectors: one counter per 64-bit lane, its four words in four vectors whose upper lane halves are
// never read. A round is then two widening multiplications, two shifts and four exclusive ors, without shuffles.

#if defined(NEPHOS_PHILOX_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_PHILOX_INL_H_
#undef NEPHOS_PHILOX_INL_H_
#else
#define NEPHOS_PHILOX_INL_H_
#endif

#include <hwy/highway.h>

#include <array>
#include <cstdint>

#include "automaton/random.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// The key of each round, in the low half of a 64-bit word.
struct PhiloxKeys {
    explicit PhiloxKeys(std::uint64_t seed) {
        std::uint32_t k0 = std::uint32_t(seed), k1 = std::uint32_t(seed >> 32);
        for (std::size_t round = 0; round < 10; ++round) {
            key0[round] = k0;
            key1[round] = k1;
            k0 += 0x9E3779B9u;  // golden ratio and sqrt(3) - 1, as the paper's key schedule
            k1 += 0xBB67AE85u;
        }
    }
    std::array<std::uint64_t, 10> key0, key1;
};

// Counters that share the words 1 (step) and 3 (slab, domain).
struct PhiloxBatch {
    const PhiloxKeys& keys;
    std::uint32_t word1, word3;
};

// out[4*i .. 4*i+3] = Philox of (word0[i], word1, word2[i], word3). The arrays must be readable and writable up to
// the next multiple of the vector's lanes.
HWY_INLINE void philox_counters(const PhiloxBatch& batch, const std::uint64_t* HWY_RESTRICT word0,
                                const std::uint64_t* HWY_RESTRICT word2, std::size_t count,
                                std::uint32_t* HWY_RESTRICT out) {
#if HWY_TARGET == HWY_SCALAR  // one lane: no 32-bit halves to multiply
    const std::uint64_t seed = batch.keys.key0[0] | batch.keys.key1[0] << 32;
    for (std::size_t i = 0; i < count; ++i) {
        const PhiloxWords words = philox(seed, {std::uint32_t(word0[i]), batch.word1, std::uint32_t(word2[i]), batch.word3});
        for (std::size_t w = 0; w < 4; ++w) out[4 * i + w] = words[w];
    }
#else
    const hn::ScalableTag<std::uint64_t> d;
    const hn::Repartition<std::uint32_t, decltype(d)> d32;
    const auto m0 = hn::BitCast(d32, hn::Set(d, 0xD2511F53u));
    const auto m1 = hn::BitCast(d32, hn::Set(d, 0xCD9E8D57u));
    const auto low = hn::Set(d, 0xFFFFFFFFu);
    for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
        auto x0 = hn::LoadU(d, word0 + i);
        auto x1 = hn::Set(d, batch.word1);
        auto x2 = hn::LoadU(d, word2 + i);
        auto x3 = hn::Set(d, batch.word3);
        for (std::size_t round = 0; round < 10; ++round) {
            const auto product0 = hn::MulEven(hn::BitCast(d32, x0), m0);
            const auto product1 = hn::MulEven(hn::BitCast(d32, x2), m1);
            x0 = hn::Xor(hn::Xor(hn::ShiftRight<32>(product1), x1), hn::Set(d, batch.keys.key0[round]));
            x2 = hn::Xor(hn::Xor(hn::ShiftRight<32>(product0), x3), hn::Set(d, batch.keys.key1[round]));
            x1 = product1;
            x3 = product0;
        }
        const auto words01 = hn::Or(hn::And(x0, low), hn::ShiftLeft<32>(x1));
        const auto words23 = hn::Or(hn::And(x2, low), hn::ShiftLeft<32>(x3));
        hn::StoreInterleaved2(words01, words23, d, reinterpret_cast<std::uint64_t*>(out + 4 * i));
    }
#endif
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
