// SPDX-License-Identifier: Apache-2.0

// Philox4x32-10 on vectors: one counter per 64-bit lane, its four words in four vectors whose upper lane
// halves are never read. A round is then two widening multiplications, two shifts and four exclusive ors,
// without shuffles.

#if defined(NEPHOS_PHILOX_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_PHILOX_INL_H_
#undef NEPHOS_PHILOX_INL_H_
#else
#define NEPHOS_PHILOX_INL_H_
#endif

#include <algorithm>
#include <array>
#include <cstdint>

#include <hwy/highway.h>

#include "core/random.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// The key of each round, in the low half of every lane of the widest vector.
struct PhiloxKeys {
    explicit PhiloxKeys(std::uint64_t seed) {
        std::uint32_t k0 = std::uint32_t(seed), k1 = std::uint32_t(seed >> 32);
        for (std::size_t round = 0; round < 10; ++round) {
            std::fill_n(key0[round], 8, std::uint64_t{k0});
            std::fill_n(key1[round], 8, std::uint64_t{k1});
            k0 += 0x9E3779B9u;  // golden ratio and sqrt(3) - 1, as the paper's key schedule
            k1 += 0xBB67AE85u;
        }
    }
    alignas(64) std::uint64_t key0[10][8];
    alignas(64) std::uint64_t key1[10][8];
};

// Counters that share the words 1 (step) and 3 (slab, domain).
struct PhiloxBatch {
    const PhiloxKeys& keys;
    std::uint32_t word1, word3;
};

// One vector of counters between two rounds.
template <class D>
struct PhiloxState {
    hn::Vec<D> w0, w1, w2, w3;
};

// Words 0 and 2 of a counter in one 64-bit number.
inline std::uint64_t pack_counter(std::uint32_t word0, std::uint32_t word2) {
    return word0 | std::uint64_t{word2} << 32;
}

// out[4*i .. 4*i+3] = Philox of the counter with packed[i]. Both arrays must reach up to the next multiple of
// the vector's lanes.
HWY_INLINE void philox_counters(const PhiloxBatch& batch, const std::uint64_t* HWY_RESTRICT packed, int count,
                                std::uint32_t* HWY_RESTRICT out) {
#if HWY_TARGET == HWY_SCALAR  // one lane: no 32-bit halves to multiply
    const std::uint64_t seed = batch.keys.key0[0][0] | batch.keys.key1[0][0] << 32;
    for (int i = 0; i < count; ++i) {
        const auto words = philox(
            seed, {std::uint32_t(packed[i]), batch.word1, std::uint32_t(packed[i] >> 32), batch.word3});
        std::copy(words.begin(), words.end(), out + 4 * i);
    }
#else
    const hn::ScalableTag<std::uint64_t> d;
    const hn::Repartition<std::uint32_t, decltype(d)> d32;
    const auto m0 = hn::BitCast(d32, hn::Set(d, 0xD2511F53u));
    const auto m1 = hn::BitCast(d32, hn::Set(d, 0xCD9E8D57u));
    const auto low = hn::Set(d, 0xFFFFFFFFu);
    const auto start = [&](const std::uint64_t* at) HWY_ATTR {
        const auto both = hn::LoadU(d, at);
        return PhiloxState<decltype(d)>{both, hn::Set(d, std::uint64_t{batch.word1}),
                                        hn::ShiftRight<32>(both), hn::Set(d, std::uint64_t{batch.word3})};
    };
    const auto advance = [&](PhiloxState<decltype(d)>& x, std::size_t round) HWY_ATTR {
        const auto product0 = hn::MulEven(hn::BitCast(d32, x.w0), m0);
        const auto product1 = hn::MulEven(hn::BitCast(d32, x.w2), m1);
        // The key meets the older word first: the chain from round to round is multiply, shift, exclusive or.
        x.w0 = hn::Xor3(hn::ShiftRight<32>(product1), x.w1, hn::Load(d, batch.keys.key0[round]));
        x.w2 = hn::Xor3(hn::ShiftRight<32>(product0), x.w3, hn::Load(d, batch.keys.key1[round]));
        x.w1 = product1;
        x.w3 = product0;
    };
    const auto finish = [&](const PhiloxState<decltype(d)>& x, std::uint32_t* to) HWY_ATTR {
        const auto words01 = hn::Or(hn::And(x.w0, low), hn::ShiftLeft<32>(x.w1));
        const auto words23 = hn::Or(hn::And(x.w2, low), hn::ShiftLeft<32>(x.w3));
        hn::StoreInterleaved2(words01, words23, d, reinterpret_cast<std::uint64_t*>(to));
    };
    const int lanes = int(hn::Lanes(d));
    int i = 0;
    // Several vectors at a time hide each other's latency: as many as the registers hold.
#if HWY_TARGET <= HWY_AVX3
    for (; i + 3 * lanes < count; i += 4 * lanes) {
        auto x = start(packed + i), y = start(packed + i + lanes), z = start(packed + i + 2 * lanes),
             w = start(packed + i + 3 * lanes);
        for (std::size_t round = 0; round < 10; ++round) {
            advance(x, round);
            advance(y, round);
            advance(z, round);
            advance(w, round);
        }
        finish(x, out + 4 * i);
        finish(y, out + 4 * (i + lanes));
        finish(z, out + 4 * (i + 2 * lanes));
        finish(w, out + 4 * (i + 3 * lanes));
    }
#endif
    for (; i + lanes < count; i += 2 * lanes) {
        auto x = start(packed + i), y = start(packed + i + lanes);
        for (std::size_t round = 0; round < 10; ++round) {
            advance(x, round);
            advance(y, round);
        }
        finish(x, out + 4 * i);
        finish(y, out + 4 * (i + lanes));
    }
    if (i < count) {
        auto x = start(packed + i);
        for (std::size_t round = 0; round < 10; ++round) advance(x, round);
        finish(x, out + 4 * i);
    }
#endif
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
