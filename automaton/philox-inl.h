// SPDX-License-Identifier: Apache-2.0

// Philox4x32-10 on vectors: one counter per 64-bit lane, its four words in four vectors whose upper lane
// halves are never read. A round is then two widening multiplications, two shifts and four exclusive ors,
// without shuffles.
//
// Counters of one block that differ only in their sub-index share most of the first two rounds: what depends on the
// sub-index alone is in a table (PhiloxTable), what depends on the block alone is computed once (PhiloxBlock), and each
// counter begins with the third round.

#if defined(NEPHOS_PHILOX_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_PHILOX_INL_H_
#undef NEPHOS_PHILOX_INL_H_
#else
#define NEPHOS_PHILOX_INL_H_
#endif

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>

#include <hwy/highway.h>

#include "core/random.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

inline constexpr std::uint32_t kPhiloxM0 = 0xD2511F53u, kPhiloxM1 = 0xCD9E8D57u;  // as the paper

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

#if HWY_TARGET != HWY_SCALAR  // one lane there: no 32-bit halves to multiply
template <class D>
HWY_INLINE hn::Vec<D> times(D d, hn::Vec<D> word, std::uint32_t factor) {
    const hn::Repartition<std::uint32_t, D> d32;
    return hn::MulEven(hn::BitCast(d32, word), hn::BitCast(d32, hn::Set(d, std::uint64_t{factor})));
}

// One round. The key meets the older word first: the chain from round to round is multiply, shift, exclusive or.
template <class D>
HWY_INLINE void philox_round(D d, const PhiloxKeys& keys, std::size_t round, PhiloxState<D>& x) {
    const auto product0 = times(d, x.w0, kPhiloxM0), product1 = times(d, x.w2, kPhiloxM1);
    x.w0 = hn::Xor3(hn::ShiftRight<32>(product1), x.w1, hn::Load(d, keys.key0[round]));
    x.w2 = hn::Xor3(hn::ShiftRight<32>(product0), x.w3, hn::Load(d, keys.key1[round]));
    x.w1 = product1;
    x.w3 = product0;
}
#endif

// Words 0 and 2 of a counter in one 64-bit number.
inline std::uint64_t pack_counter(std::uint32_t word0, std::uint32_t word2) {
    return word0 | std::uint64_t{word2} << 32;
}

// Returns the words of one packed counter.
inline PhiloxWords philox_of(const PhiloxBatch& batch, std::uint64_t packed) {
    const std::uint64_t seed = batch.keys.key0[0][0] | batch.keys.key1[0][0] << 32;
    return philox(seed, {std::uint32_t(packed), batch.word1, std::uint32_t(packed >> 32), batch.word3});
}

// Calls finish(state, i) with the words of the counters i, i + 1, ... of `packed`, a vector at a time. The array must
// reach up to the next multiple of the vector's lanes.
#if HWY_TARGET != HWY_SCALAR
template <class Finish>
HWY_INLINE void philox_vectors(const PhiloxBatch& batch, const std::uint64_t* HWY_RESTRICT packed, int count,
                               const Finish& finish) {
    using D = hn::ScalableTag<std::uint64_t>;
    const D d;
    const auto start = [&](int at) HWY_ATTR {
        const auto both = hn::LoadU(d, packed + at);
        return PhiloxState<D>{both, hn::Set(d, std::uint64_t{batch.word1}), hn::ShiftRight<32>(both),
                              hn::Set(d, std::uint64_t{batch.word3})};
    };
    const int lanes = int(hn::Lanes(d));
    int i = 0;
    // Several vectors at a time hide each other's latency: as many as the registers hold.
#if HWY_TARGET <= HWY_AVX3
    for (; i + 3 * lanes < count; i += 4 * lanes) {
        auto x = start(i), y = start(i + lanes), z = start(i + 2 * lanes), w = start(i + 3 * lanes);
        for (std::size_t round = 0; round < 10; ++round) {
            philox_round(d, batch.keys, round, x);
            philox_round(d, batch.keys, round, y);
            philox_round(d, batch.keys, round, z);
            philox_round(d, batch.keys, round, w);
        }
        finish(x, i);
        finish(y, i + lanes);
        finish(z, i + 2 * lanes);
        finish(w, i + 3 * lanes);
    }
#endif
    for (; i + lanes < count; i += 2 * lanes) {
        auto x = start(i), y = start(i + lanes);
        for (std::size_t round = 0; round < 10; ++round) {
            philox_round(d, batch.keys, round, x);
            philox_round(d, batch.keys, round, y);
        }
        finish(x, i);
        finish(y, i + lanes);
    }
    if (i < count) {
        auto x = start(i);
        for (std::size_t round = 0; round < 10; ++round) philox_round(d, batch.keys, round, x);
        finish(x, i);
    }
}

// Stores the four words of each counter one after the other.
template <class D>
HWY_INLINE void store_words(D d, const PhiloxState<D>& x, std::uint32_t* to) {
    const auto low = hn::Set(d, 0xFFFFFFFFu);
    const auto words01 = hn::Or(hn::And(x.w0, low), hn::ShiftLeft<32>(x.w1));
    const auto words23 = hn::Or(hn::And(x.w2, low), hn::ShiftLeft<32>(x.w3));
#if HWY_TARGET == HWY_EMU128
    // Stores lane by lane, which takes the alignment and the type of 64-bit words.
    alignas(16) std::uint64_t pairs[2 * hn::MaxLanes(d)];
    hn::StoreInterleaved2(words01, words23, d, pairs);
    std::memcpy(to, pairs, sizeof pairs);
#else
    hn::StoreInterleaved2(words01, words23, d, reinterpret_cast<std::uint64_t*>(to));
#endif
}
#endif

// out[4*i .. 4*i+3] = Philox of the counter with packed[i]. Both arrays must reach up to the next multiple of
// the vector's lanes.
HWY_INLINE void philox_counters(const PhiloxBatch& batch, const std::uint64_t* HWY_RESTRICT packed, int count,
                                std::uint32_t* HWY_RESTRICT out) {
#if HWY_TARGET == HWY_SCALAR
    for (int i = 0; i < count; ++i) {
        const PhiloxWords words = philox_of(batch, packed[i]);
        std::copy(words.begin(), words.end(), out + 4 * i);
    }
#else
    const hn::ScalableTag<std::uint64_t> d;
    philox_vectors(batch, packed, count,
                   [&](const auto& x, int i) HWY_ATTR { store_words(d, x, out + 4 * i); });
#endif
}

// The events of a sparse draw, two a counter: words 0 and 2 to first[2*i], first[2*i+1], words 1 and 3 to second. All
// arrays must reach up to the next multiple of the vector's lanes.
HWY_INLINE void philox_events(const PhiloxBatch& batch, const std::uint64_t* HWY_RESTRICT packed, int count,
                              std::uint32_t* HWY_RESTRICT first, std::uint32_t* HWY_RESTRICT second) {
#if HWY_TARGET == HWY_SCALAR
    for (int i = 0; i < count; ++i) {
        const PhiloxWords words = philox_of(batch, packed[i]);
        first[2 * i] = words[0], second[2 * i] = words[1];
        first[2 * i + 1] = words[2], second[2 * i + 1] = words[3];
    }
#else
    const hn::ScalableTag<std::uint64_t> d;
    const auto low = hn::Set(d, 0xFFFFFFFFu);
    philox_vectors(batch, packed, count, [&](const auto& x, int i) HWY_ATTR {
        const auto both = [&](auto a, auto b)
                              HWY_ATTR { return hn::Or(hn::And(a, low), hn::ShiftLeft<32>(b)); };
        hn::StoreU(both(x.w0, x.w2), d, reinterpret_cast<std::uint64_t*>(first + 2 * i));
        hn::StoreU(both(x.w1, x.w3), d, reinterpret_cast<std::uint64_t*>(second + 2 * i));
    });
#endif
}

// What the first two rounds make of the sub-indices 0 .. kMax - 1 of one draw in one slab: with the words (s, step, b, z) of a
// counter, and the keys k of each round,
//
//     round 1   w0 = hi(M1 b) ^ step ^ k0   w1 = lo(M1 b)                 of the block
//               w2 = hi(M0 s) ^ z ^ k1      w3 = lo(M0 s)                 of the sub-index
//     round 2   w0 = hi(M1 w2) ^ w1 ^ k0    w1 = lo(M1 w2)                table ^ block, table
//               w2 = hi(M0 w0) ^ w3 ^ k1    w3 = lo(M0 w0)                block ^ table, block
template <int kMax>
struct PhiloxTable {
    PhiloxTable(const PhiloxBatch& batch, Draw of) : draw(of) {
        const auto k = [](const std::uint64_t(&keys)[8]) { return std::uint32_t(keys[0]); };
        for (std::uint32_t n = 0; n < std::uint32_t(kMax); ++n) {
            const std::uint64_t product0 = std::uint64_t{kPhiloxM0} * block_word_0(draw, n);
            const std::uint64_t word = std::uint32_t(product0 >> 32) ^ batch.word3 ^ k(batch.keys.key1[0]);
            const std::uint64_t product1 = kPhiloxM1 * word;
            w0[n] = (product1 >> 32) ^ k(batch.keys.key0[1]);
            w1[n] = product1;
            w2[n] = std::uint32_t(product0) ^ k(batch.keys.key1[1]);
        }
    }
    Draw draw;
    alignas(64) std::uint64_t w0[kMax], w1[kMax], w2[kMax];
};

// What the first two rounds make of the block and the step.
struct PhiloxBlock {
    PhiloxBlock() = default;
    PhiloxBlock(const PhiloxBatch& batch, std::uint32_t block) : word2(block) {
        const std::uint64_t product1 = std::uint64_t{kPhiloxM1} * word2;
        const std::uint64_t first = (product1 >> 32) ^ batch.word1 ^ batch.keys.key0[0][0];
        const std::uint64_t product0 = kPhiloxM0 * first;
        w0 = std::uint32_t(product1);
        w2 = product0 >> 32;
        w3 = product0;
    }
    std::uint32_t word2 = 0;  // of the counters
    std::uint64_t w0 = 0, w2 = 0, w3 = 0;
};

// Eight neighbouring sub-indices of one block.
struct PhiloxJob {
    std::uint8_t block;   // in the segment
    std::uint8_t quarter;  // sub-indices 8 quarter .. 8 quarter + 7
};

#if HWY_TARGET != HWY_SCALAR
// The lower halves of the lanes of a and of b, in turn.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V alternate(D d, V a, V b) {
    const hn::Repartition<std::uint32_t, D> d32;
    return hn::BitCast(d, hn::OddEven(hn::DupEven(hn::BitCast(d32, b)), hn::BitCast(d32, a)));
}

template <class D, int kMax>
HWY_INLINE PhiloxState<D> start_at(D d, const PhiloxTable<kMax>& table, const PhiloxBlock& block, int place) {
    return {hn::Xor(hn::LoadU(d, table.w0 + place), hn::Set(d, block.w0)), hn::LoadU(d, table.w1 + place),
            hn::Xor(hn::LoadU(d, table.w2 + place), hn::Set(d, block.w2)), hn::Set(d, block.w3)};
}
#endif

// Calls finish(n, i, words01, words23) for the counters of job n from the i-th on, a vector of 64 bits at a time: words 0 and
// 1, and 2 and 3, of each. `jobs` reaches up to the next multiple of 4 with jobs that may be done twice.
template <int kMax, class Finish>
HWY_INLINE void philox_jobs(const PhiloxBatch& batch, const PhiloxTable<kMax>& table,
                            const PhiloxBlock* blocks, const PhiloxJob* jobs, int count, const Finish& finish) {
    using D = hn::CappedTag<std::uint64_t, 8>;
    const D d;
#if HWY_TARGET == HWY_SCALAR
    for (int n = 0; n < count; ++n) {
        for (int i = 0; i < 8; ++i) {
            const auto sub = std::uint32_t(8 * jobs[n].quarter + i);
            const PhiloxWords x =
                philox_of(batch, pack_counter(block_word_0(table.draw, sub), blocks[jobs[n].block].word2));
            finish(n, i, hn::Set(d, pack_counter(x[0], x[1])), hn::Set(d, pack_counter(x[2], x[3])));
        }
    }
#else
    const auto start = [&](int n, int i) HWY_ATTR {
        return start_at(d, table, blocks[jobs[n].block], 8 * jobs[n].quarter + i);
    };
    const auto end = [&](int n, int i, const PhiloxState<D>& x) HWY_ATTR {
        finish(n, i, alternate(d, x.w0, x.w1), alternate(d, x.w2, x.w3));
    };
    // Several vectors at a time hide each other's latency: as many as the registers hold.
#if HWY_TARGET <= HWY_AVX3
    for (int n = 0; n < count; n += 4) {
        auto x = start(n, 0), y = start(n + 1, 0), z = start(n + 2, 0), w = start(n + 3, 0);
        for (std::size_t round = 2; round < 10; ++round) {
            philox_round(d, batch.keys, round, x);
            philox_round(d, batch.keys, round, y);
            philox_round(d, batch.keys, round, z);
            philox_round(d, batch.keys, round, w);
        }
        end(n, 0, x);
        end(n + 1, 0, y);
        end(n + 2, 0, z);
        end(n + 3, 0, w);
    }
#else
    constexpr int kLanes = int(hn::MaxLanes(d));
    for (int n = 0; n < count; ++n) {
        for (int i = 0; i < 8; i += 2 * kLanes) {
            auto x = start(n, i), y = start(n, i + kLanes);
            for (std::size_t round = 2; round < 10; ++round) {
                philox_round(d, batch.keys, round, x);
                philox_round(d, batch.keys, round, y);
            }
            end(n, i, x);
            end(n, i + kLanes, y);
        }
    }
#endif
#endif
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
